// One log format, line by line. Parsers keep what a format's header says (number base, columns,
// kind of time) and nothing of the length of the log. Tools only.
#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include "can_dbc/log/can_log.h"

namespace beltgrip::can {

enum class LineKind {
  kFrame,    // the record is filled
  kNothing,  // empty, a comment, a header, an event that is no frame
  kBad       // should have been a frame; reason() says what is wrong
};

class LineParser {
 public:
  virtual ~LineParser() = default;
  virtual LineKind parse(std::string_view line, LogRecord& record) = 0;
  // A frame from the front of the log's text, where the format knows a shorter way to it than
  // parse(): behind its line. nullptr: go by parse().
  virtual const char* quick_frame(std::string_view, LogRecord&) { return nullptr; }
  const char* reason() const noexcept { return reason_; }

 protected:
  LineKind bad(const char* reason) noexcept {
    reason_ = reason;
    return LineKind::kBad;
  }

 private:
  const char* reason_ = "";
};

// `sample`: the first lines of the log. Some formats have to look ahead to know what a time stamp
// or a number means.
using Sample = std::vector<std::string_view>;
std::unique_ptr<LineParser> make_candump_parser(const Sample& sample);
std::unique_ptr<LineParser> make_asc_parser();
std::unique_ptr<LineParser> make_trc_parser();
std::unique_ptr<LineParser> make_csv_parser(const Sample& sample);

// Whatever the format: no line or record may say more than one of these.
bool is_of_two_kinds(const CanFrame& frame);
inline constexpr const char* kTwoKinds =
    "a frame of two kinds: remote, error and CAN FD exclude each other";
void count_bad(LogStats& stats, BadLine bad);

}  // namespace beltgrip::can
