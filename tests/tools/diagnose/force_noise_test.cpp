// What the pressure's noise comes to in the capacity is the same share of it in every hypothesis:
// one that has more clamp force must not fit better for dividing the noise by more.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "tests/tools/diagnose/noise.h"
#include "tests/tools/diagnose/recorded_runs.h"
#include "tests/tools/diagnose/rig_table.h"
#include "tools/diagnose/decide/namer.h"

namespace beltgrip::diagnose {
namespace {

constexpr double kPressure_Pa = 4e5;

SignalTable steady(const estimator::VariatorParameters& variator) {
  return rig_table(4000, 0.005, [&](double t_s) -> RigSample {
    return {100.0, 100.0 * variator.ratio_overdrive * 0.99,
            kPressure_Pa + 1e5 * std::sin(2.0 * std::numbers::pi * 0.05 * t_s), 50.0};
  });
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

// Pulleys that give way bring it into the slip as well, where it counts by itself: whoever says
// that they do, the machine, a model file or an effect, the noise of the slip is that of the
// speeds.
TEST(ForceNoise, IsNoneOfTheSlip) {
  constexpr double kPerkN = 4e-3, kSpeed_rad_s = 5e-3, kPressureNoise_Pa = 3e3;
  const estimator::VariatorParameters variator;
  Noise noise;
  const SignalTable table = rig_table(12000, 0.005, [&](double t_s) -> RigSample {
    const double pressure_Pa = kPressure_Pa + 1e5 * std::sin(2.0 * std::numbers::pi * 0.05 * t_s);
    const double ratio = variator.ratio_overdrive * 0.99;
    return {100.0 + kSpeed_rad_s * noise(), 100.0 * ratio,
            pressure_Pa + kPressureNoise_Pa * noise(), 50.0};
  });
  Campaign campaign = make_campaign({prepare(table, variator)}, nominal_model(variator));
  ModelState stiff;
  stiff.nuisance.setZero(kNuisanceCount);
  stiff.nuisance[kLnMuMax] = std::log(0.1);
  stiff.effects.setZero(static_cast<Eigen::Index>(campaign.slots.size()));
  const double of_speeds = estimate_noise_levels(campaign, stiff).slip_share;
  campaign.noise.slip_share = of_speeds;
  const double share = estimate_slip_noise_shares(campaign, stiff)[0];
  const auto expect_that = [&](const ModelState& state) {
    EXPECT_NEAR(estimate_noise_levels(campaign, state).slip_share, of_speeds, 0.02 * of_speeds);
    EXPECT_NEAR(estimate_slip_noise_shares(campaign, state)[0], share, 0.02 * share);
  };
  ModelState machine = stiff;
  machine.nuisance[kDeformationPerkN] = kPerkN;
  expect_that(machine);
  const auto slot =
      std::find_if(campaign.slots.begin(), campaign.slots.end(),
                   [](const Slot& each) { return each.label() == "pulley_deformation.per_kN"; });
  ASSERT_NE(slot, campaign.slots.end());
  const auto index = slot - campaign.slots.begin();
  ModelState effect = stiff;
  effect.effects[index] = kPerkN;
  expect_that(effect);
  campaign.switched_on[index] = kPerkN;
  expect_that(stiff);
}

// In overrun it moves capacity and slip in one direction. As nothing explains it, a fit of all that
// there is leaves it as it was.
TEST(ForceNoise, IsExplainedByNoFit) {
  for (const double torque_Nm : {-45.0, 45.0}) {
    SCOPED_TRACE(torque_Nm);
    blind::Trial trial;
    trial.seed = 5;
    trial.machine.setting = blind::Setting::kCar;
    trial.machine.noise_pressure_Pa = 15e3;
    trial.machine.deformation_per_kN = 2e-3;
    trial.plan = blind::paper_plan(10);
    for (std::size_t i = 0; i < trial.plan.size(); ++i) {
      trial.plan[i].torque_Nm = torque_Nm;
      trial.plan[i].speed_rad_s = 100.0 + 8.0 * static_cast<double>(i % 5);
    }
    Engine engine(campaign_of(trial));
    engine.fit_machine();
    engine.update_noise();
    EXPECT_GT(engine.whitening().filter[kFrictionResidual].sigma.front(), 0.85);
  }
}

// Two experiments in the middle with less friction than those before and behind them: that is no
// wear, which does not come back.
TEST(Wear, DoesNotComeBack) {
  blind::Trial trial;
  trial.seed = 11;
  blind::Random random(trial.seed);
  trial.plan = blind::draw_plan(random, trial.machine.setting, 10);
  estimator::VariatorParameters variator;
  variator.primary_inertia_kg_m2 = trial.machine.primary_inertia_kg_m2;
  std::vector<std::string> csv = blind::record(trial).csv;
  trial.planted.push_back({"wear", {{"step", 0.08}, {"at", 0.0}}, {}});
  const std::vector<std::string> worn = blind::record(trial).csv;
  for (const std::size_t i : {5U, 6U}) csv[i] = worn[i];
  std::vector<ExperimentData> runs;
  for (const std::string& text : csv) runs.push_back(prepare(parse_csv(text, "run.csv"), variator));
  Engine engine(make_campaign(std::move(runs), nominal_model(variator)));
  const Naming naming = name_effects(engine, [] { return false; });
  int steps = 0;
  for (const Accepted& each : naming.accepted) {
    steps += engine.campaign().slots[static_cast<std::size_t>(each.slot)].counts_experiments();
  }
  EXPECT_LT(steps, 2);
}

}  // namespace
}  // namespace beltgrip::diagnose
