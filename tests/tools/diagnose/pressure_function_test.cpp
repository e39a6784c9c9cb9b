// What follows the secondary pressure, as the friction curve does in a ramp and the rounding of a
// torque in ramps that are alike. The recordings are the blind generator's.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/tools/diagnose/recorded_runs.h"
#include "tools/diagnose/decide/criticism.h"
#include "tools/diagnose/decide/namer.h"
#include "tools/diagnose/decide/thresholds.h"

namespace beltgrip::diagnose {
namespace {

blind::Trial planted(const std::string& cause, double size) {
  blind::Trial trial;
  trial.seed = 7;
  blind::Random random(trial.seed);
  trial.plan = blind::draw_plan(random, trial.machine.setting, 10);
  for (const std::size_t i : {1U, 4U, 7U}) {
    trial.plan[i].low = true;
    trial.plan[i].torque_Nm = 40.0;
  }
  if (!cause.empty()) trial.planted = {{cause, {{"size", size}}, ""}};
  return trial;
}

Criticism criticised(Campaign campaign) {
  Engine engine(std::move(campaign));
  name_effects(engine, [] { return false; });
  return criticise(engine);
}

bool follows_pressure(const Cell& cell) {
  return std::string_view(cell.abscissa.variable->name) == "secondary_pressure";
}

// The largest gain of a cell over the pressure that counts.
double most_over_pressure(const Criticism& criticism) {
  double most = 0.0;
  for (const Cell& cell : criticism.cells) {
    if (follows_pressure(cell) && !cell.is_told_by_form) most = std::max(most, cell.gain());
  }
  return most;
}

TEST(OverThePressure, AHealthyMachineHasNothing) {
  const Criticism criticism = criticised(campaign_of(planted("", 0.0)));
  EXPECT_LT(most_over_pressure(criticism), thresholds::kLawCell / 2.0);
}

TEST(OverThePressure, ADragThatSetsInIsOneOfTheTorque) {
  const Criticism criticism = criticised(campaign_of(planted("x_loss_force_step", 2.0)));
  ASSERT_FALSE(criticism.cells.empty());
  const Cell& best = criticism.cells.front();
  EXPECT_TRUE(follows_pressure(best)) << best.abscissa.variable->name;
  EXPECT_EQ(best.injection->injection, Injection::kTorque);
  EXPECT_GT(best.gain(), 2.0 * thresholds::kSmoothCell);
  EXPECT_GE(best.abscissa.levels, thresholds::kLevelsMin);
}

TEST(OverThePressure, ARatioThatStepsIsOneOfTheRatio) {
  const Criticism criticism = criticised(campaign_of(planted("x_ratio_force_step", 3e-3)));
  ASSERT_FALSE(criticism.cells.empty());
  const Cell& best = criticism.cells.front();
  EXPECT_TRUE(follows_pressure(best)) << best.abscissa.variable->name;
  EXPECT_EQ(best.injection->injection, Injection::kRatio);
  EXPECT_GT(best.gain(), 2.0 * thresholds::kSmoothCell);
}

// At one torque the curve could be of that form, and no test is failed by it.
TEST(OverThePressure, ARatioAtOneTorqueFailsNoTest) {
  blind::Trial trial = planted("x_ratio_force_step", 3e-3);
  trial.plan = blind::paper_plan(12);
  const Criticism criticism = criticised(campaign_of(trial));
  for (const Cell& cell : criticism.cells) {
    if (!follows_pressure(cell) || cell.injection->injection != Injection::kRatio) continue;
    EXPECT_TRUE(cell.is_told_by_form);
    EXPECT_GT(cell.gain(), thresholds::kSmoothCell);
  }
  EXPECT_FALSE(criticism.function_fails());
}

// A torque that is read in steps of 1 Nm without noise to carry it over them, on equal ramps.
TEST(OverThePressure, WhatRoundingLeavesIsNoTorque) {
  blind::Trial trial = planted("", 0.0);
  trial.plan = blind::paper_plan(8);
  trial.machine.noise_torque_Nm = 0.02;
  estimator::VariatorParameters variator;
  variator.primary_inertia_kg_m2 = trial.machine.primary_inertia_kg_m2;
  std::vector<ExperimentData> runs;
  for (const std::string& text : blind::record(trial).csv) {
    SignalTable table = parse_csv(text, "run.csv");
    for (double& value : table[daemon::Role::kPrimaryTorque].value) value = std::round(value);
    runs.push_back(prepare(table, variator));
  }
  ASSERT_FALSE(runs.front().rests_torque.empty());
  const Criticism criticism =
      criticised(make_campaign(std::move(runs), nominal_model(variator), Accuracies{}));
  for (const Cell& cell : criticism.cells) {
    const Injection point = cell.injection->injection;
    EXPECT_FALSE(follows_pressure(cell) &&
                 (point == Injection::kTorque || point == Injection::kTorqueGain));
  }
}

}  // namespace
}  // namespace beltgrip::diagnose
