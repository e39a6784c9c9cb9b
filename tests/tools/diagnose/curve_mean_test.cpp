// A sample is the mean over a tenth of a second: of a curve that is bent it is not the curve at the
// mean slip.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tools/diagnose/infer/engine.h"

namespace beltgrip::diagnose {
namespace {

constexpr double kMuMax = 0.1, kPeakSlip = 0.02, kPressure_Pa = 6e5;

// On the nominal curve, the slip to and fro within a second.
SignalTable swinging(const estimator::VariatorParameters& variator) {
  const CurveShape curve(std::array<double, kShapeKnots>{}, 0.0);
  const double force_N =
      variator.secondary_piston_area_m2 * kPressure_Pa + variator.secondary_spring_force_N;
  const double capacity_Nm = 2.0 * variator.primary_radius_overdrive_m * force_N * kMuMax /
                             std::cos(variator.half_wedge_angle_rad);
  SignalTable table;
  for (int i = 0; i < 4000; ++i) {
    const double t_s = 0.005 * i;
    const double slip_share = 0.007 + 0.003 * std::sin(2.0 * std::numbers::pi * t_s);
    const auto add = [&](Role role, double value) {
      table[role].t_s.push_back(t_s);
      table[role].value.push_back(value);
    };
    add(Role::kPrimarySpeed, 100.0);
    add(Role::kSecondarySpeed, 100.0 * variator.ratio_overdrive * (1.0 - slip_share));
    add(Role::kSecondaryPressure, kPressure_Pa);
    add(Role::kPrimaryTorque, capacity_Nm * curve.evaluate(slip_share / kPeakSlip).value);
  }
  return table;
}

// By the curve at the mean slip the torque is off by up to 1.2 Nm.
TEST(CurveMean, IsThatOfTheSlipsWithinASample) {
  estimator::VariatorParameters variator;
  variator.secondary_centrifugal_N_s2 = 0.0;
  const Campaign campaign =
      make_campaign({prepare(swinging(variator), variator)}, nominal_model(variator));
  ModelState state;
  state.nuisance.setZero(kNuisanceCount);
  state.nuisance[kLnMuMax] = std::log(kMuMax);
  state.nuisance[kLnPeakSlipOverdrive] = std::log(kPeakSlip);
  state.nuisance[kLnPeakSlipLow] = std::log(kPeakSlip);
  state.effects.setZero(static_cast<Eigen::Index>(campaign.slots.size()));
  const Residuals at = residuals_of(campaign, 0, state);
  const ExperimentData& run = campaign.runs[0];
  ASSERT_GT(run.valid_count, 100);
  for (int k = 0; k < run.size(); ++k) {
    if (!run.valid[static_cast<std::size_t>(k)]) continue;
    EXPECT_NEAR(at.value[kFrictionResidual][k] / at.weight[k], 0.0, 0.2) << k;
  }
}

}  // namespace
}  // namespace beltgrip::diagnose
