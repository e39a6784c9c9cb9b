// What stands in a page of courses over time, decoded by hand.
#include <gtest/gtest.h>

#include <limits>
#include <string>

#include "tools/report/courses.h"

namespace beltgrip::report {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

bool has(const std::string& text, const std::string& what) {
  return text.find(what) != std::string::npos;
}

// 0, 65534 and no value in two bytes each, low byte first: 00 00 fe ff ff ff.
TEST(CoursesScript, AValueIsItsPlaceBetweenTheLeastAndTheGreatest) {
  Courses courses;
  courses.t_s = {1.0, 1.5, 2.0};
  courses.period_s = 0.5;
  courses.panels = {{"p", {{"a", {-1.0, 65533.0, kNone}}}, {}, {}, {}}};
  const std::string script = courses_script("plot1", courses);
  EXPECT_TRUE(has(script, "[\"a\",\"line\",-1,1,\"AAD+////\"]")) << script;
  EXPECT_TRUE(has(script, "count:3,offset:0,period:0.5,runs:[[0,1],]")) << script;
}

TEST(CoursesScript, AConstantAndACourseWithoutValues) {
  Courses courses;
  courses.t_s = {0.0};
  courses.panels = {{"p", {{"a", {7.0}}, {"b", {kNone}, Style::kSteps}}, {}, {}, {}}};
  const std::string script = courses_script("plot1", courses);
  EXPECT_TRUE(has(script, "[\"a\",\"line\",7,0,\"AAA=\"]")) << script;
  EXPECT_TRUE(has(script, "[\"b\",\"steps\",0,0,\"//8=\"]")) << script;
}

TEST(CoursesScript, AGapBeginsAnotherRun) {
  Courses courses;
  courses.t_s = {0.0, 0.5, 1.0, 2.0, 2.5};
  courses.period_s = 0.5;
  EXPECT_TRUE(has(courses_script("plot1", courses), "runs:[[0,0],[3,2],]"));
}

// A stamp with a date is too long for an axis.
TEST(CoursesScript, DatedTimesCountFromTheFirst) {
  Courses courses;
  courses.t_s = {1.7e9, 1.7e9 + 0.5};
  courses.period_s = 0.5;
  courses.marks = {{1.7e9 + 0.25, "here"}};
  const std::string script = courses_script("plot1", courses);
  EXPECT_TRUE(has(script, "offset:1700000000,period:0.5,runs:[[0,0],]")) << script;
  EXPECT_TRUE(has(script, "marks:[[0.25,\"here\"],]")) << script;
}

TEST(CoursesScript, NamesOfOthersCannotEndTheScript) {
  Courses courses;
  courses.t_s = {0.0};
  courses.panels = {{"</script>", {}, {}, {}, {{"a\"b", LaneKind::kFault, {{0.0, 1.0}}}}}};
  const std::string script = courses_script("plot1", courses);
  EXPECT_FALSE(has(script, "</")) << script;
  EXPECT_TRUE(has(script, "[\"a\\u0022b\",1,[0,1,]]")) << script;
}

}  // namespace
}  // namespace beltgrip::report
