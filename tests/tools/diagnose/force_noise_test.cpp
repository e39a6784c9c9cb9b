// What the pressure's noise comes to in the capacity is the same share of it in every hypothesis:
// one that has more clamp force must not fit better for dividing the noise by more.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>

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
