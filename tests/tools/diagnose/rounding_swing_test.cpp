// A swing that the steps of a reading hide is no line of the machine, and one that they cannot is.
#include "tools/diagnose/infer/rounding_swing.h"

#include <gtest/gtest.h>

#include "tests/tools/diagnose/swinging_rig.h"
#include "tools/diagnose/decide/thresholds.h"
#include "tools/diagnose/infer/line_test.h"
#include "tools/diagnose/infer/slow_line.h"

namespace beltgrip::diagnose {
namespace {

constexpr double kSlow_Hz = 0.4, kFast_Hz = 1.43;
// Of a torque whose noise is a fifth of it, so that it rests for long.
constexpr double kStep_Nm = 0.5;
constexpr double kWithinAStep = 0.004;  // of 44 and 50 Nm
constexpr double kBeyond = 0.05;        // of the clamp force

SpectralLine fast_line(const Engine& engine) {
  return strongest_line(engine.campaign(), engine.state());
}

TEST(RoundingSwing, OfATorqueWithinAStepIsNoLine) {
  EXPECT_LT(
      slow_line(
          fitted({.torque_share = kWithinAStep, .torque_Hz = kSlow_Hz, .torque_step_Nm = kStep_Nm}))
          .excess,
      thresholds::kSlowLine);
  EXPECT_LT(
      fast_line(
          fitted({.torque_share = kWithinAStep, .torque_Hz = kFast_Hz, .torque_step_Nm = kStep_Nm}))
          .excess,
      thresholds::kLine);
}

TEST(RoundingSwing, BeyondTheStepsStaysALine) {
  const SpectralLine slow =
      slow_line(fitted({.force_share = kBeyond, .force_Hz = kSlow_Hz, .torque_step_Nm = kStep_Nm}));
  EXPECT_GT(slow.excess, thresholds::kSlowLine);
  EXPECT_NEAR(slow.frequency_Hz, kSlow_Hz, 0.03);
  const SpectralLine fast =
      fast_line(fitted({.force_share = kBeyond, .force_Hz = kFast_Hz, .torque_step_Nm = kStep_Nm}));
  EXPECT_GT(fast.excess, thresholds::kLine);
  EXPECT_NEAR(fast.frequency_Hz, kFast_Hz, 0.03);
}

// As if all that a reading is off by were one swing: 1 / sqrt(6) of a step where it rests.
TEST(RoundingSwing, IsAsLargeAsTheRoundingOfTheReading) {
  constexpr double kRests_Nm = 1.0;
  const Engine engine = fitted({.torque_step_Nm = kRests_Nm});
  Residuals at = residuals_of(engine.campaign(), 0, engine.state());
  move_to_foot(engine.campaign(), 0, at);
  double most_Nm = 0.0;
  for (const ResidualColumns& each : rounding_swings(engine.campaign(), 0, at)) {
    const Eigen::ArrayXd& column = each[kFrictionResidual];
    for (Eigen::Index k = 0; k < column.size(); ++k) {
      if (at.weight[k] > 0.0) most_Nm = std::max(most_Nm, column[k] / at.weight[k]);
    }
  }
  EXPECT_NEAR(most_Nm, kRests_Nm / std::sqrt(6.0), 0.1 * kRests_Nm);
}

}  // namespace
}  // namespace beltgrip::diagnose
