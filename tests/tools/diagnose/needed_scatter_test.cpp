// Experiments that differ by more than usual, where few of them tell it and where many do; and
// ramps that are alike, which say the same of no friction at all. The recordings are the blind
// generator's.
#include "tools/diagnose/decide/needed_scatter.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/tools/diagnose/recorded_runs.h"
#include "tools/diagnose/decide/namer.h"

namespace beltgrip::diagnose {
namespace {

// A belt whose level of friction differs by that share from one experiment to the next.
blind::Trial scattered(double friction, int experiments) {
  blind::Trial trial;
  trial.seed = 16;
  blind::Random random(trial.seed);
  trial.machine = blind::draw_machine(random);
  trial.machine.scatter_friction = friction;
  trial.machine.scatter_torque_Nm = 0.05;
  trial.machine.scatter_ratio = 1.5e-4;
  trial.plan = blind::draw_plan(random, trial.machine.setting, experiments);
  return trial;
}

TEST(NeededScatter, WhatFiveExperimentsDoNotProveIsBounded) {
  Engine engine(campaign_of(scattered(0.012, 5)));
  name_effects(engine, [] { return false; });
  const Criticism criticism = criticise(engine);
  ASSERT_FALSE(criticism.test("unusual_friction").passed());
  const std::optional<Engine> bounded = without_needless_scatter(engine, criticism);
  ASSERT_TRUE(bounded.has_value());
  EXPECT_LT(bounded->scatter().variance[0], engine.scatter().variance[0]);
  const Criticism after = criticise(*bounded);
  EXPECT_TRUE(after.test("unusual_friction").passed());
  EXPECT_TRUE(after.test("unusual_scatter").passed());
}

TEST(NeededScatter, WhatTheDataProveStays) {
  Engine engine(campaign_of(scattered(0.03, 8)));
  name_effects(engine, [] { return false; });
  const Criticism criticism = criticise(engine);
  ASSERT_FALSE(criticism.test("unusual_friction").passed());
  EXPECT_FALSE(without_needless_scatter(engine, criticism).has_value());
}

TEST(NeededScatter, WhereAllPassNothingIsBounded) {
  Engine engine(campaign_of(scattered(0.004, 5)));
  name_effects(engine, [] { return false; });
  const Criticism criticism = criticise(engine);
  ASSERT_TRUE(criticism.passed());
  EXPECT_FALSE(without_needless_scatter(engine, criticism).has_value());
}

TEST(NeededScatter, DecidesTheVerdict) {
  EXPECT_EQ(diagnose(request_of(scattered(0.012, 5))).diagnosis.verdict, Verdict::kNothingWrong);
  const Diagnosis differs = diagnose(request_of(scattered(0.03, 8))).diagnosis;
  EXPECT_EQ(differs.verdict, Verdict::kUnexplained);
  EXPECT_TRUE(differs.learned.empty());  // what follows nothing is no function of anything
}

// What the data prove is no scatter of a healthy machine stands in its residuals all the same.
TEST(WithinHealthyScatter, LeavesWhatDiffersToTheResiduals) {
  Engine engine(campaign_of(scattered(0.03, 8)));
  name_effects(engine, [] { return false; });
  const Criticism criticism = criticise(engine);
  const std::optional<Engine> bounded = within_healthy_scatter(engine, criticism);
  ASSERT_TRUE(bounded.has_value());
  EXPECT_LT(bounded->scatter().variance[0], engine.scatter().variance[0]);
  EXPECT_GT(score_cells(*bounded).front().gain(), 2.0 * criticism.cells.front().gain());
}

// A drag that grows as the oil gets colder, of which the zeros of the torques take the most.
TEST(WithinHealthyScatter, LetsAFunctionBeFoundThatTheScatterTakes) {
  blind::Trial trial;
  trial.seed = 6;
  blind::Random random(trial.seed);
  trial.machine = blind::draw_machine(random);
  trial.plan = blind::draw_plan(random, trial.machine.setting, 12);
  trial.planted = {blind::draw_outside(random, "x_loss_temperature", 3.0)};
  const Diagnosis found = diagnose(request_of(trial)).diagnosis;
  EXPECT_EQ(found.verdict, Verdict::kExplained);
  ASSERT_EQ(found.learned.size(), 1U);
  EXPECT_EQ(found.learned.front().acts_on, "torque");
  EXPECT_EQ(found.learned.front().depends_on, std::vector<std::string>{"oil_temperature"});
}

// Of equal ramps without the torque behind the belt.
TEST(UsualLosses, AreNoMoreThanVariatorsLose) {
  blind::Trial trial;
  trial.seed = 11;
  blind::Random random(trial.seed);
  trial.machine = blind::draw_machine(random);
  trial.machine.setting = blind::Setting::kRigNoOutputTorque;
  trial.plan = blind::paper_plan(7);
  Accuracies accuracies{};
  for (const Role role : {Role::kPrimaryTorque, Role::kEngineTorque}) {
    accuracies[static_cast<std::size_t>(role)].bias = 1.3;
    accuracies[static_cast<std::size_t>(role)].gain = 0.05;
  }
  const auto sigmas_off = [&](Losses losses) {
    Engine engine(campaign_of(trial, accuracies), 1, losses);
    engine.fit_machine();
    engine.update_noise();
    engine.accept(engine.refine({}));
    const NuisanceRow& row = engine.campaign().nuisances[kLossConstant_Nm];
    return std::abs(engine.state().nuisance[kLossConstant_Nm] - row.nominal) / row.tolerance;
  };
  EXPECT_GT(sigmas_off(Losses::kAsFitted), 4.0);
  EXPECT_LE(sigmas_off(Losses::kUsual), 3.0 + 1e-9);
}

}  // namespace
}  // namespace beltgrip::diagnose
