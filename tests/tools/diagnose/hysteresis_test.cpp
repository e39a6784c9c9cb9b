// Play between the measured pressure and the clamp force: found in its true size, whatever went
// before the recording; of the size that any cylinder has it is the machine's.
#include <gtest/gtest.h>

#include <string>

#include "tests/tools/diagnose/recorded_runs.h"
#include "tools/diagnose/decide/namer.h"

namespace beltgrip::diagnose {
namespace {

constexpr double kForce_N = 240.0;

// A machine and a plan; before: where the clamp force comes from, 0 to 2 (the generator's).
blind::Trial trial_of(std::uint64_t machine, std::uint64_t before, double force_N = kForce_N) {
  blind::Random random(machine);
  blind::Trial trial;
  trial.machine = blind::draw_machine(random);
  trial.plan = blind::draw_plan(random, trial.machine.setting, 12);
  trial.planted.push_back({"clamp_hysteresis", {{"force_N", force_N}}, {}});
  trial.seed = 3 * machine + before;
  return trial;
}

// By what went before.
class Hysteresis : public testing::TestWithParam<std::uint64_t> {};

TEST_P(Hysteresis, IsFoundInItsSize) {
  const char* const kRole[] = {"raised", "", "lowered"};
  Engine engine(campaign_of(trial_of(1, GetParam())));
  const Naming naming = name_effects(engine, [] { return false; });
  ASSERT_EQ(naming.accepted.size(), 1U);
  const Accepted& found = naming.accepted.front();
  const Slot& slot = engine.campaign().slots[static_cast<std::size_t>(found.slot)];
  EXPECT_EQ(slot.row->id, "clamp_hysteresis");
  EXPECT_EQ(slot.role, kRole[GetParam()]);
  EXPECT_NEAR(naming.hypothesis.state.effects[found.slot], kForce_N, 0.03 * kForce_N);
}

INSTANTIATE_TEST_SUITE_P(WhateverWentBefore, Hysteresis, testing::Range<std::uint64_t>(0, 3));

// Whatever went before the recording.
TEST(Play, OfAnyCylinderIsAConstantOfTheMachineAndNoFinding) {
  for (const auto& [force_N, before] : {std::pair{0.0, 1U}, {30.0, 1U}, {60.0, 0U}, {60.0, 2U}}) {
    SCOPED_TRACE(force_N);
    Engine engine(campaign_of(trial_of(1, before, force_N)));
    const Naming naming = name_effects(engine, [] { return false; });
    EXPECT_TRUE(naming.accepted.empty());
    const Eigen::VectorXd& machine = naming.hypothesis.state.nuisance;
    EXPECT_NEAR(machine[kPlay_N], force_N, 3.0);
    const double from = force_N > 0.0 ? static_cast<double>(before) - 1.0 : 0.0;
    EXPECT_NEAR(machine[kPlayFrom], from, 0.5);  // nearer than to any other
  }
}

// What the machine's own may be is part of what is told.
TEST(Play, BeyondAnyCylindersIsToldAsAWhole) {
  constexpr double kBeyond_N = 100.0;
  Engine engine(campaign_of(trial_of(1, 1, kBeyond_N)));
  const Naming naming = name_effects(engine, [] { return false; });
  ASSERT_EQ(naming.accepted.size(), 1U);
  EXPECT_NEAR(naming.hypothesis.state.effects[naming.accepted.front().slot], kBeyond_N, 5.0);
  EXPECT_NEAR(naming.hypothesis.state.nuisance[kPlay_N], 0.0, 1e-9);
}

}  // namespace
}  // namespace beltgrip::diagnose
