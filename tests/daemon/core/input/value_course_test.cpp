// When a signal that is still received counts as standing still.
#include "daemon/core/input/value_course.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace beltgrip::daemon {
namespace {

constexpr Duration kPeriod = 10 * kMillisecond;

// Values of a level with white noise, rounded to whole steps, for a while; then the last one for
// good. For how long it then counts as live; rest: the longest that is tried.
double live_for_s(double sigma, double level, double rest_s) {
  ValueCourse course(1.0);
  std::mt19937_64 random(7);
  const auto normal = [&random] {
    double sum = 0.0;
    for (int i = 0; i < 12; ++i) sum += static_cast<double>(random() >> 11) * 0x1p-53;
    return sum - 6.0;
  };
  MonoTime t{};
  double value = 0.0;
  for (int i = 0; i < 600; ++i) {
    value = std::round(level + sigma * normal());
    course.add(t += kPeriod, value);
  }
  const MonoTime begun = t;
  while (t - begun < Duration::of_s(rest_s)) {
    course.add(t += kPeriod, value);
    if (course.stands_still(0.0, true)) return static_cast<double>((t - begun).ns()) * 1e-9;
  }
  return rest_s;
}

TEST(ValueCourse, NoiseOfSeveralStepsThatCeasesIsSeen) {
  EXPECT_LT(live_for_s(1.5, 0.3, 10.0), 1.0);
  EXPECT_LT(live_for_s(3.0, 0.0, 10.0), 1.0);
}

// At the edge of a step little noise goes to and fro between two values; then the level moves to
// the middle of a step and the value rests. Taken for noise of half a step, that was a standstill.
TEST(ValueCourse, AValueThatLeftTheEdgeOfAStepMayRest) {
  EXPECT_EQ(live_for_s(0.1, 0.5, 30.0), 30.0);
  EXPECT_EQ(live_for_s(0.2, 0.48, 30.0), 30.0);
}

}  // namespace
}  // namespace beltgrip::daemon
