// A pressure that is held, in steps much larger than its noise: off by up to half a step for as
// long as an experiment lasts, and by another part of it in the next.
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "tests/tools/diagnose/noise.h"
#include "tests/tools/diagnose/rig_table.h"
#include "tools/diagnose/decide/criticism.h"
#include "tools/diagnose/decide/namer.h"
#include "tools/diagnose/infer/infer.h"

namespace beltgrip::diagnose {
namespace {

constexpr double kStep_Pa = 4e4, kNoise_Pa = 3e3;

// A rig of its own equations, friction 2x / (1 + x^2): the clamp force held, the torque raised
// towards what it lets the belt carry, level by level.
SignalTable held(const estimator::VariatorParameters& variator, int number, double pressure_Pa,
                 Noise& noise) {
  constexpr double kOmega_rad_s = 100.0, kMuMax = 0.1, kPeakSlip_share = 0.02;
  const double force_N =
      variator.secondary_piston_area_m2 * pressure_Pa + variator.secondary_spring_force_N;
  const double capacity_Nm = 2.0 * variator.primary_radius_overdrive_m * kMuMax * force_N /
                             std::cos(variator.half_wedge_angle_rad);
  SignalTable out = rig_table(3000, 0.01, [&](double t_s) {
    constexpr std::array kLevels{0.2, 0.45, 0.7, 0.85, 0.95};
    const auto level = static_cast<std::size_t>(t_s / 6.0);
    const double y = kLevels[std::min(level, kLevels.size() - 1)];
    const double slip = kPeakSlip_share * (1.0 - std::sqrt(1.0 - y * y)) / y;
    const double ratio = variator.ratio_overdrive * (1.0 - 1e-6 * force_N);
    return RigSample{
        .omega_p_rad_s = kOmega_rad_s * (1.0 + 5e-5 * noise()),
        .omega_s_rad_s = kOmega_rad_s * ratio * (1.0 - slip) * (1.0 + 5e-5 * noise()),
        .pressure_Pa = std::round((pressure_Pa + kNoise_Pa * noise()) / kStep_Pa) * kStep_Pa,
        .torque_Nm = y * capacity_Nm + 1.0 + 5e-5 * force_N + 0.1 * noise()};
  });
  out.name = "held" + std::to_string(number);
  return out;
}

Engine engine_of_held() {
  const estimator::VariatorParameters variator;
  Noise noise;
  std::vector<SignalTable> tables;
  for (const double pressure_Pa :
       {4.63e5, 7.05e5, 6.21e5, 5.49e5, 2.93e5, 3.67e5, 6.12e5, 4.28e5}) {
    tables.push_back(held(variator, static_cast<int>(tables.size()), pressure_Pa, noise));
  }
  std::vector<const SignalTable*> all;
  for (const SignalTable& table : tables) all.push_back(&table);
  std::vector<ExperimentData> runs;
  for (const SignalTable& table : tables) {
    runs.push_back(prepare(table, variator, sensors_of(all)));
  }
  return Engine(make_campaign(std::move(runs), nominal_model(variator)));
}

TEST(HeldSteps, AreNoFrictionThatDiffersBetweenExperiments) {
  Engine engine = engine_of_held();
  const Naming naming = name_effects(engine, [] { return false; });
  EXPECT_TRUE(naming.accepted.empty());
  EXPECT_FALSE(naming.unknown);
  for (const JudgedTest& each : criticise(engine).tests) {
    EXPECT_TRUE(each.passed()) << each.name << ' ' << each.value << " of " << each.limit;
  }
}

// In usual scatters: what half a step comes to in the friction, against mu_max itself.
TEST(HeldSteps, FreeTheLevelOfTheirExperiment) {
  const Engine engine = engine_of_held();
  const Campaign& campaign = engine.campaign();
  const ExperimentData& run = campaign.runs[0];
  Residuals at = residuals_of(campaign, 0, engine.state());
  const RawColumns raw =
      raw_columns(campaign, 0, engine.state(), at, {kLnMuMax}, Eigen::VectorXd::Ones(1), true);
  const Eigen::ArrayXd& level = raw.columns[raw.columns.size() - kRandomEffects][kFrictionResidual];
  const double scatter =
      std::sqrt(level.square().sum() / raw.columns[0][kFrictionResidual].square().sum());
  const double force_N = campaign.variator.secondary_piston_area_m2 * run.pressure.value.mean() +
                         campaign.variator.secondary_spring_force_N;
  const double off =
      campaign.variator.secondary_piston_area_m2 * run.rounding_pressure_Pa / force_N;
  EXPECT_NEAR(scatter, off / std::sqrt(default_scatter().variance[0]), 0.1 * scatter);
  EXPECT_GT(scatter, 3.0);
}

}  // namespace
}  // namespace beltgrip::diagnose
