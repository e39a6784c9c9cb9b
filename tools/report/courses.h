// What runs over time, as panels over one time axis: every sample is in the page, and what is shown
// of them is chosen there for each view. Tools only.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace beltgrip::report {

// How the values of a course are drawn. kWhiskers: points, each with the interval that the next two
// courses of the panel give (kHidden).
enum class Style : std::uint8_t { kLine, kDashed, kSteps, kPoints, kWhiskers, kHidden };

struct Course {
  std::string name;           // within its panel no other has it
  std::vector<double> value;  // one a sample; what is not finite is a gap
  Style style = Style::kLine;
};

struct Interval {
  double low = 0.0, high = 0.0;
};

// A height that is drawn across the panel.
struct Level {
  std::string name;
  double value = 0.0;
};

// When something stood: a bar for each span of time.
enum class LaneKind : std::uint8_t { kGoes, kForbids, kFault };
struct Lane {
  std::string name;
  LaneKind kind = LaneKind::kForbids;
  std::vector<Interval> spans_s;
};

struct Panel {
  std::string label;  // what it shows, with its unit
  std::vector<Course> courses;
  std::vector<Level> levels;
  std::optional<Interval> band;  // shaded across the panel
  std::vector<Lane> lanes;       // in place of courses
};

struct Mark {
  double t_s = 0.0;
  std::string name;
};

struct Courses {
  std::vector<double> t_s;  // or what else they run over; ascending; two that are further apart
                            // than 1.5 periods have a gap
  double period_s = 0.0;    // 0: each sample stands alone
  std::string label = "time, s";
  std::vector<std::string> names;  // of the samples, told in place of their times; empty: none
  std::vector<Panel> panels;
  std::vector<Mark> marks;        // across all panels
  std::vector<Interval> spans_s;  // shaded in all panels
};

// As an object for plots.js.
std::string courses_script(const std::string& id, const Courses& courses);

}  // namespace beltgrip::report
