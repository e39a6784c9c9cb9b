// Running radii of the Van Doorne pushbelt (L = 703 mm, d = 168 mm) against a table that was solved
// outside of this project and rounded to 0.01 mm, and the cases that no pair of radii solves.
#include "estimator/physics/variator_geometry.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace beltgrip::estimator {
namespace {

constexpr double kBelt_m = 0.703;
constexpr double kCentres_m = 0.168;
constexpr double kRounding_m = 0.0051e-3;

struct Row {
  double ratio, primary_mm, secondary_mm;
};

class RadiiTable : public testing::TestWithParam<Row> {};

TEST_P(RadiiTable, RadiiCloseTheBelt) {
  const RunningRadii radii = running_radii(GetParam().ratio, kBelt_m, kCentres_m);
  EXPECT_NEAR(radii.primary_m, GetParam().primary_mm * 1e-3, kRounding_m);
  EXPECT_NEAR(radii.secondary_m, GetParam().secondary_mm * 1e-3, kRounding_m);
  EXPECT_NEAR(radii.primary_m / radii.secondary_m, GetParam().ratio, 1e-12);
}

INSTANTIATE_TEST_SUITE_P(Pushbelt, RadiiTable,
                         testing::Values(Row{0.380, 30.84, 81.15}, Row{0.405, 32.43, 80.06},
                                         Row{0.50, 38.02, 76.05}, Row{0.60, 43.22, 72.03},
                                         Row{0.80, 51.78, 64.72}, Row{1.00, 58.41, 58.41},
                                         Row{1.25, 64.72, 51.78}, Row{1.50, 69.48, 46.32},
                                         Row{1.80, 73.78, 40.99}, Row{2.25, 78.37, 34.83},
                                         Row{2.40, 79.56, 33.15}));

TEST(BeltLength, EqualPulleysAreTwoHalfCirclesAndTwoStraights) {
  EXPECT_DOUBLE_EQ(belt_length_m(0.05, 0.05, 0.2), 0.4 + 0.1 * std::numbers::pi);
}

TEST(BeltLength, IsTheSumOfArcsAndStraights) {
  // R_p - R_s = d / 2: phi is 30 degrees, each straight d cos 30, wraps 240 and 120 degrees.
  constexpr double d = 0.2, primary = 0.15, secondary = 0.05;
  const double straights = 2.0 * d * std::numbers::sqrt3 / 2.0;
  const double arcs = (4.0 * primary + 2.0 * secondary) * std::numbers::pi / 3.0;
  EXPECT_NEAR(belt_length_m(primary, secondary, d), straights + arcs, 1e-15);
}

TEST(RunningRadii, SwappingThePulleysInvertsTheRatio) {
  for (const double ratio : {0.3, 0.7, 1.7, 3.0}) {
    const RunningRadii there = running_radii(ratio, kBelt_m, kCentres_m);
    const RunningRadii back = running_radii(1.0 / ratio, kBelt_m, kCentres_m);
    EXPECT_NEAR(there.primary_m, back.secondary_m, 1e-12) << ratio;
    EXPECT_NEAR(there.secondary_m, back.primary_m, 1e-12) << ratio;
  }
}

TEST(RunningRadii, NoneForABeltThatDoesNotReachAround) {
  for (const double length : {0.1, 0.3359, 2.0 * kCentres_m}) {
    const RunningRadii radii = running_radii(1.5, length, kCentres_m);
    EXPECT_EQ(radii.primary_m, 0.0) << length;
    EXPECT_EQ(radii.secondary_m, 0.0) << length;
  }
}

TEST(RunningRadii, NoneWhereTheRadiiWouldDifferByMoreThanTheCentres) {
  // The longest belt of a ratio has R_p - R_s = d and runs around the larger pulley alone:
  // L = 2 pi d r / (r - 1), 1.1729 m at r = 10.
  const double longest_m = 2.0 * std::numbers::pi * kCentres_m * 10.0 / 9.0;
  for (const double ratio : {10.0, 0.1}) {
    const RunningRadii none = running_radii(ratio, longest_m * 1.001, kCentres_m);
    EXPECT_EQ(none.primary_m, 0.0) << ratio;
    EXPECT_EQ(none.secondary_m, 0.0) << ratio;
    const RunningRadii some = running_radii(ratio, longest_m * 0.999, kCentres_m);
    EXPECT_GT(some.primary_m, 0.0) << ratio;
    EXPECT_LT(std::abs(some.primary_m - some.secondary_m), kCentres_m) << ratio;
  }
}

}  // namespace
}  // namespace beltgrip::estimator
