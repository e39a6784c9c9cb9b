// The balance of torques before and behind the belt, of a machine without any loss.
#include <gtest/gtest.h>

#include <cmath>

#include "tools/diagnose/infer/engine.h"

namespace beltgrip::diagnose {
namespace {

constexpr double kInertia_kgm2 = 0.2;

// The speed goes up by 20 rad/s within a second, which takes some Nm of the engine's torque.
SignalTable pulse(const estimator::VariatorParameters& variator, double engine_reads = 1.0) {
  SignalTable table;
  for (int i = 0; i < 2000; ++i) {
    const double t_s = 0.01 * i;
    const double steep = 1.0 / std::cosh((t_s - 10.0) / 0.4);
    const auto add = [&](Role role, double value) {
      table[role].t_s.push_back(t_s);
      table[role].value.push_back(value);
    };
    const double omega_p = 100.0 + 10.0 * std::tanh((t_s - 10.0) / 0.4);
    const double slope_p = 25.0 * steep * steep;
    const double belt_Nm = 40.0 + 2.0 * std::sin(0.5 * t_s);
    add(Role::kPrimarySpeed, omega_p);
    add(Role::kSecondarySpeed, 0.995 * variator.ratio_overdrive * omega_p);
    add(Role::kSecondaryPressure, 6e5);
    add(Role::kEngineTorque, engine_reads * (belt_Nm + kInertia_kgm2 * slope_p));
    add(Role::kSecondaryTorque, belt_Nm / variator.ratio_overdrive);
  }
  return table;
}

// By the fast slope against the slow torque it is off by several tenths of a Nm.
TEST(Balance, HoldsWhileTheEngineSpeedsUp) {
  estimator::VariatorParameters variator;
  variator.primary_inertia_kg_m2 = kInertia_kgm2;
  const Campaign campaign =
      make_campaign({prepare(pulse(variator), variator)}, nominal_model(variator));
  ModelState state;
  state.nuisance.setZero(kNuisanceCount);
  state.effects.setZero(static_cast<Eigen::Index>(campaign.slots.size()));
  const Quantities q = quantities(campaign, campaign.runs[0], 0, state);
  const ExperimentData& run = campaign.runs[0];
  ASSERT_GT(run.valid_count, 150);
  for (int k = 0; k < run.size(); ++k) {
    if (!run.valid[static_cast<std::size_t>(k)]) continue;
    EXPECT_NEAR(q.balance[k], 0.0, 0.02) << k;
  }
}

// An engine's torque that reads 3 % too much does so of what speeding up takes as well: no other
// inertia. Half a Nm is missing there where the gain is taken for the secondary torque's.
TEST(Balance, HoldsWhereTheEnginesTorqueReadsTooMuch) {
  estimator::VariatorParameters variator;
  variator.primary_inertia_kg_m2 = kInertia_kgm2;
  constexpr double kReads = 1.03;
  Accuracies accuracies{};
  accuracies[static_cast<std::size_t>(Role::kEngineTorque)].gain = 0.03;
  const Campaign campaign = make_campaign({prepare(pulse(variator, kReads), variator)},
                                          nominal_model(variator), accuracies);
  EXPECT_DOUBLE_EQ(campaign.primary_share_of_gain, 1.0);
  ModelState state;
  state.nuisance.setZero(kNuisanceCount);
  state.effects.setZero(static_cast<Eigen::Index>(campaign.slots.size()));
  const ExperimentData& run = campaign.runs[0];
  ASSERT_GT(run.valid_count, 150);
  state.nuisance[kSecondaryTorqueGain] = 1.0 / kReads - 1.0;
  const Eigen::ArrayXd balance = quantities(campaign, run, 0, state).balance;
  for (int k = 0; k < run.size(); ++k) {
    if (!run.valid[static_cast<std::size_t>(k)]) continue;
    EXPECT_NEAR(balance[k], 0.0, 0.03) << k;
  }
}

// By the more accurate one less: of stated 3 and 4 % a gain is the primary's by 9 in 25.
TEST(Balance, TheGainIsThePrimarysByItsShareOfTheVariance) {
  estimator::VariatorParameters variator;
  Accuracies accuracies{};
  accuracies[static_cast<std::size_t>(Role::kEngineTorque)].gain = 0.03;
  accuracies[static_cast<std::size_t>(Role::kSecondaryTorque)].gain = 0.04;
  const Campaign campaign =
      make_campaign({prepare(pulse(variator), variator)}, nominal_model(variator), accuracies);
  EXPECT_NEAR(campaign.primary_share_of_gain, 9.0 / 25.0, 1e-12);
}

}  // namespace
}  // namespace beltgrip::diagnose
