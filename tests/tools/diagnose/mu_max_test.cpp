// How surely the largest friction is known: where the samples end below the peak of the curve.
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "tools/diagnose/infer/peak.h"

namespace beltgrip::diagnose {
namespace {

constexpr double kOfOne = 1e-4;  // variance of the friction in one experiment

CurveShape nominal_curve() {
  static constexpr std::array<double, kShapeKnots> kNone{};
  return CurveShape(kNone, 0.0);
}

TEST(HeightBeyond, LiesAnywhereBetweenWhatWasReachedAndTheFormsPeak) {
  const CurveShape curve = nominal_curve();
  const double ln_end = std::log(curve.evaluate(0.4).value);
  const CurveHeight told = height_beyond(curve, {0.4, {}}, 0.0, kOfOne);
  EXPECT_NEAR(told.ln, 0.5 * ln_end, 1e-9);
  EXPECT_NEAR(told.sigma, -ln_end / std::sqrt(12.0), 1e-9);
}

TEST(HeightBeyond, ABeltThatRunsAwayWhileTheLoadHardlyMovesHasComeToThePeak) {
  const CurveShape curve = nominal_curve();
  const double ln_end = std::log(curve.evaluate(0.4).value);
  const ReachedCurve reached{0.4, {{0.4, 0.01}, {0.4, 0.01}, {0.4, 0.01}}};
  const CurveHeight told = height_beyond(curve, reached, 0.0, kOfOne);
  EXPECT_NEAR(told.ln, ln_end + 0.005, 0.01);
  EXPECT_LT(told.sigma, 0.01);
}

TEST(HeightBeyond, WhatRunsAwayFromAFastLoadTellsLittle) {
  const CurveShape curve = nominal_curve();
  const CurveHeight none = height_beyond(curve, {0.4, {}}, 0.0, kOfOne);
  const CurveHeight told = height_beyond(curve, {0.4, {{0.2, 2.0}}}, 0.0, kOfOne);
  EXPECT_NEAR(told.sigma, none.sigma, 0.1 * none.sigma);
}

TEST(HeightBeyond, NeverLeavesItsBounds) {
  const CurveShape curve = nominal_curve();
  const double ln_end = std::log(curve.evaluate(0.4).value);
  EXPECT_DOUBLE_EQ(height_beyond(curve, {0.4, {{0.1, 0.0}}}, 0.0, 1e-12).ln, ln_end);
  EXPECT_LE(height_beyond(curve, {0.4, {{1.0, 0.1}}}, 0.0, 1e-12).ln, 0.0);
  EXPECT_DOUBLE_EQ(
      height_beyond(curve, {1.2, {}}, std::log(curve.evaluate(1.2).value), kOfOne).sigma, 0.0);
}

}  // namespace
}  // namespace beltgrip::diagnose
