#include "tools/report/courses.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string_view>

#include "tools/report/script_text.h"

namespace beltgrip::report {
namespace {

// Of kMissing steps between its least and its greatest value a course has a place: finer than a
// screen, and a third of the size of numbers as text.
constexpr std::uint16_t kMissing = 65535;
constexpr double kSteps = kMissing - 1;
constexpr double kEarliestDate_s = 315'532'800.0;  // 1980: a stamp before it has no date
constexpr std::array<std::string_view, 6> kStyles{"line",   "dashed",   "steps",
                                                  "points", "whiskers", "hidden"};
constexpr std::array<int, 3> kLaneColours{2, 4, 1};  // of plots.js, by LaneKind

void append_base64(std::string& out, const std::vector<std::uint8_t>& bytes) {
  constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t left = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t three = 0;
    for (std::size_t k = 0; k < 3; ++k) three = three << 8 | (k < left ? bytes[i + k] : 0U);
    for (std::size_t k = 0; k < 4; ++k) {
      out += k <= left ? kDigits[three >> (18 - 6 * k) & 63U] : '=';
    }
  }
}

void append_course(std::string& out, const Course& course) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const double value : course.value) {
    if (!std::isfinite(value)) continue;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  if (high < low) low = high = 0.0;
  const double step = (high - low) / kSteps;
  std::vector<std::uint8_t> bytes;
  bytes.reserve(2 * course.value.size());
  for (const double value : course.value) {
    std::uint16_t code = kMissing;
    if (std::isfinite(value)) {
      code = step > 0.0 ? static_cast<std::uint16_t>(std::lround((value - low) / step)) : 0;
    }
    bytes.push_back(static_cast<std::uint8_t>(code & 255U));
    bytes.push_back(static_cast<std::uint8_t>(code >> 8));
  }
  out += '[' + quoted(course.name) + ',' + quoted(kStyles[static_cast<std::size_t>(course.style)]) +
         ',';
  append_number(out, low, kTimeDigits);
  out += ',';
  append_number(out, step, kTimeDigits);
  out += ",\"";
  append_base64(out, bytes);
  out += "\"]";
}

// Something for each of several, between brackets.
void append_list(std::string& out, const auto& all, const auto& append) {
  out += '[';
  for (const auto& each : all) {
    append(each);
    out += ',';
  }
  out += ']';
}

// Times in the page count from its offset.
struct Clock {
  double offset_s;
  void append(std::string& out, double t_s) const {
    append_number(out, t_s - offset_s, kTimeDigits);
  }
  void append(std::string& out, const std::vector<Interval>& spans_s) const {
    append_list(out, spans_s, [&](const Interval& span) {
      append(out, span.low);
      out += ',';
      append(out, span.high);
    });
  }
};

void append_panel(std::string& out, const Panel& panel, const Clock& clock) {
  out += "{label:" + quoted(panel.label) + ",series:";
  append_list(out, panel.courses, [&](const Course& course) { append_course(out, course); });
  out += ",levels:";
  append_list(out, panel.levels, [&](const Level& level) {
    out += '[' + quoted(level.name) + ',';
    append_number(out, level.value);
    out += ']';
  });
  out += ",bands:[";
  if (panel.band) {
    out += '[';
    append_number(out, panel.band->low);
    out += ',';
    append_number(out, panel.band->high);
    out += ']';
  }
  out += "],lanes:";
  append_list(out, panel.lanes, [&](const Lane& lane) {
    out += '[' + quoted(lane.name) + ',' +
           std::to_string(kLaneColours[static_cast<std::size_t>(lane.kind)]) + ',';
    clock.append(out, lane.spans_s);
    out += ']';
  });
  out += '}';
}

}  // namespace

std::string courses_script(const std::string& id, const Courses& courses) {
  const double first_s = courses.t_s.empty() ? 0.0 : courses.t_s.front();
  const Clock clock{first_s >= kEarliestDate_s ? first_s : 0.0};
  constexpr double kGap = 1.5;  // periods
  std::string out = "{id:" + quoted(id) + ",label:" + quoted(courses.label) +
                    ",count:" + std::to_string(courses.t_s.size()) + ",offset:";
  append_number(out, clock.offset_s, kTimeDigits);
  out += ",period:";
  append_number(out, courses.period_s, kTimeDigits);
  out += ",runs:[";
  for (std::size_t i = 0; i < courses.t_s.size(); ++i) {
    if (i > 0 && courses.t_s[i] - courses.t_s[i - 1] < kGap * courses.period_s) continue;
    out += '[' + std::to_string(i) + ',';
    clock.append(out, courses.t_s[i]);
    out += "],";
  }
  out += "],names:";
  append_list(out, courses.names, [&](const std::string& name) { out += quoted(name); });
  out += ",marks:";
  append_list(out, courses.marks, [&](const Mark& mark) {
    out += '[';
    clock.append(out, mark.t_s);
    out += ',' + quoted(mark.name) + ']';
  });
  out += ",spans:";
  clock.append(out, courses.spans_s);
  out += ",panels:";
  append_list(out, courses.panels, [&](const Panel& panel) { append_panel(out, panel, clock); });
  return out + "}";
}

}  // namespace beltgrip::report
