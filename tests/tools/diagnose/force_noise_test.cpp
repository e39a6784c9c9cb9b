// What the pressure's noise comes to in the capacity is the same share of it in every hypothesis:
// one that has more clamp force must not fit better for dividing the noise by more.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tools/diagnose/infer/engine.h"

namespace beltgrip::diagnose {
namespace {

constexpr double kPressure_Pa = 4e5;

SignalTable steady(const estimator::VariatorParameters& variator) {
  SignalTable table;
  for (int i = 0; i < 4000; ++i) {
    const double t_s = 0.005 * i;
    const auto add = [&](Role role, double value) {
      table[role].t_s.push_back(t_s);
      table[role].value.push_back(value);
    };
    add(Role::kPrimarySpeed, 100.0);
    add(Role::kSecondarySpeed, 100.0 * variator.ratio_overdrive * 0.99);
    add(Role::kSecondaryPressure,
        kPressure_Pa + 1e5 * std::sin(2.0 * std::numbers::pi * 0.05 * t_s));
    add(Role::kPrimaryTorque, 50.0);
  }
  return table;
}

TEST(ForceNoise, IsTheSameShareOfTheCapacityInEveryHypothesis) {
  const estimator::VariatorParameters variator;
  const Campaign campaign =
      make_campaign({prepare(steady(variator), variator)}, nominal_model(variator));
  const ExperimentData& run = campaign.runs[0];
  ModelState state;
  state.nuisance.setZero(kNuisanceCount);
  state.nuisance[kLnMuMax] = std::log(0.1);
  state.effects.setZero(static_cast<Eigen::Index>(campaign.slots.size()));
  Eigen::ArrayXd noisy = run.pressure.value;
  for (Eigen::Index k = 0; k < noisy.size(); ++k) noisy[k] += k % 2 == 0 ? 3e3 : -3e3;
  const auto share = [&] {
    const Eigen::ArrayXd calm = quantities(campaign, run, 0, state).capacity;
    const Eigen::ArrayXd with =
        quantities(campaign, run, {noisy, run.torque.value}, 0, state).capacity;
    return Eigen::ArrayXd(with / calm - 1.0);
  };
  const Eigen::ArrayXd before = share();
  EXPECT_GT(before.abs().maxCoeff(), 3e-3);
  int tried = 0;
  for (std::size_t i = 0; i < campaign.slots.size(); ++i) {
    const EffectRow& row = *campaign.slots[i].row;
    if (row.id != "pressure_offset" && row.id != "pressure_gain" && row.id != "spring_force" &&
        row.id != "centrifugal_force" && row.id != "friction_load") {
      continue;
    }
    SCOPED_TRACE(row.id);
    state.effects.setZero();
    state.effects[static_cast<Eigen::Index>(i)] = row.typical;
    const Eigen::ArrayXd here = share();
    for (int k = 0; k < run.size(); ++k) {
      if (!run.valid[static_cast<std::size_t>(k)]) continue;
      ASSERT_NEAR(here[k], before[k], 1e-9) << k;
    }
    ++tried;
  }
  EXPECT_EQ(tried, 5);
}

}  // namespace
}  // namespace beltgrip::diagnose
