// Constants of the machine and sizes of effects have ends. A fit that comes to one goes on with the
// others.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include "tests/tools/diagnose/recorded_runs.h"

namespace beltgrip::diagnose {
namespace {

// No effect, a machine whose torque ratio stays: fitted as one whose ratio follows, the secondary
// torque's gain comes to its end.
Campaign with_a_gain_at_its_end(std::uint64_t seed) {
  blind::Trial trial;
  trial.seed = seed;
  blind::Random random(trial.seed);
  trial.machine = blind::draw_machine(random);
  trial.machine.setting = blind::Setting::kRig;
  trial.machine.deformation_per_kN = 3e-3;
  trial.machine.torque_ratio_stays = true;
  trial.plan = blind::draw_plan(random, trial.machine.setting, 8);
  Accuracies accuracies{};
  accuracies[static_cast<std::size_t>(Role::kPrimaryTorque)].gain = 3e-3;
  accuracies[static_cast<std::size_t>(Role::kSecondaryTorque)].gain = 3e-3;
  return campaign_of(trial, accuracies);
}

// By hand: a step to (3, 1) is wanted, with a curvature of 1 and 0.8 between both. With the first
// at its end, 1 away, the second is best where it makes up for it: 1 + 0.8 (3 - 1).
TEST(Ranges, TheOthersGoWhereTheyFitBestWithWhatIsAtItsEnd) {
  const Engine engine(with_a_gain_at_its_end(16));
  const std::vector<int> parameters{kSecondaryTorqueGain, kLossConstant_Nm};
  const Range gain = engine.range(kSecondaryTorqueGain);
  ModelState from = engine.state();
  from.nuisance[kSecondaryTorqueGain] = gain.most - engine.scale(kSecondaryTorqueGain);
  Eigen::Matrix2d curvature;
  curvature << 1.0, 0.8, 0.8, 1.0;
  const Eigen::Vector2d wanted(3.0, 1.0);
  const auto solved = [&](const Prior& prior) -> Eigen::VectorXd {
    const Eigen::Matrix2d all = curvature + Eigen::Matrix2d(prior.precision.asDiagonal());
    return all.ldlt().solve(curvature * wanted + prior.precision.cwiseProduct(prior.pull));
  };
  const Prior none{Eigen::Vector2d::Zero(), Eigen::Vector2d::Zero()};
  const Eigen::VectorXd step = engine.step_within_ranges(parameters, from, none, solved);
  EXPECT_NEAR(step[0], 1.0, 1e-9);
  EXPECT_NEAR(step[1], 2.6, 1e-9);
  // Within its range nothing is held, and from the end it comes back.
  from.nuisance[kSecondaryTorqueGain] = gain.least;
  EXPECT_NEAR(engine.step_within_ranges(parameters, from, none, solved)[0], 3.0, 1e-9);
}

// Going where they would fit with a gain that is never reached, the others settle nowhere: 900 of
// the log likelihood are left to gain in the first, 170 in the second, and 27 and 13 are gained
// between the 20th step and the 80th.
TEST(Ranges, AFitWithAConstantAtItsEndSettles) {
  for (const std::uint64_t seed : {16U, 20U}) {
    Engine engine(with_a_gain_at_its_end(seed));
    engine.fit_machine();
    engine.update_noise();
    const Hypothesis settled = engine.refine({}, 20);
    const double gain = settled.state.nuisance[kSecondaryTorqueGain];
    const Range range = engine.range(kSecondaryTorqueGain);
    EXPECT_TRUE(gain == range.least || gain == range.most) << seed << ": " << gain;
    EXPECT_NEAR(engine.refine({}, 80).log_likelihood, settled.log_likelihood, 0.1) << seed;
  }
}

}  // namespace
}  // namespace beltgrip::diagnose
