// A View as lines of text of a given size, each piece with its tone. Pure: the terminal only puts
// them down. Every character is ASCII, so that a character is a column. Tools only.
#pragma once

#include <string>
#include <vector>

#include "tools/monitor/view.h"

namespace beltgrip::monitor {

// What a terminal may show by colour; the words say it too.
enum class Tone { kPlain, kDim, kStrong, kGood, kWarning, kAlarm };
struct Piece {
  std::string text;
  Tone tone = Tone::kPlain;
};
using Line = std::vector<Piece>;

struct Size {
  int columns = 80, rows = 24;
};

// At most size.rows lines, none longer than size.columns.
std::vector<Line> layout(const View& view, Size size);
// Without tones; blanks at the ends of lines are left out.
std::string text_of(const std::vector<Line>& lines);

// "2026-11-23 09:22:16", local time.
std::string wall_text(std::int64_t wall_ns);
// "0.1068, 95 % 0.0915 to 0.1221"; "at least 0.0950"; "-"
std::string friction_text(const Friction& friction);

}  // namespace beltgrip::monitor
