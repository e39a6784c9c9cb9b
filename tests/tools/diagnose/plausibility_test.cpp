// What contradicts itself: torques before and behind the belt, whose powers are compared where the
// shafts turn steadily alone; ratios of two machines.
#include "tools/diagnose/decide/plausibility.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace beltgrip::diagnose {
namespace {

constexpr int kSamples = 300;

// Drives at 100 rad/s with 50 Nm against 20 Nm at 220 rad/s. Of every three samples two are sped up
// by acceleration, where the torque behind the belt has what the inertia there makes of it.
ExperimentData run_with(double acceleration_rad_s2, double behind_there_Nm) {
  ExperimentData run;
  run.name = "run1";
  run.t_s = Eigen::ArrayXd::LinSpaced(kSamples, 0.0, 0.1 * (kSamples - 1));
  run.valid.assign(kSamples, true);
  run.valid_count = kSamples;
  const auto constant = [](double value) {
    return Eigen::ArrayXd(Eigen::ArrayXd::Constant(kSamples, value));
  };
  run.omega_p.value = constant(100.0);
  run.omega_s.value = constant(220.0);
  run.omega_p.slow_slope = constant(0.0);
  run.torque.value = constant(50.0);
  run.torque_s.value = constant(20.0);
  run.torque_s.present = true;
  for (int k = 0; k < kSamples; ++k) {
    run.torque.value[k] += 0.1 * (k % 7);  // noise: neither channel stands still
    run.torque_s.value[k] += 0.05 * (k % 5);
    if (k % 3 == 0) continue;
    run.omega_p.slow_slope[k] = acceleration_rad_s2;
    run.torque_s.value[k] = behind_there_Nm;
  }
  return run;
}

std::string doubt_of(const ExperimentData& run) {
  Implausible doubts;
  check_torques({run}, doubts);
  EXPECT_FALSE(doubts.impossible) << "a cause may be between them";
  torques_are_impossible(doubts);
  EXPECT_EQ(doubts.impossible.has_value(), !doubts.notes.empty());
  return doubts.notes.empty() ? "" : doubts.notes.front();
}

TEST(CheckTorques, AgreeingTorquesRaiseNoDoubt) { EXPECT_EQ(doubt_of(run_with(0.0, 20.0)), ""); }

TEST(CheckTorques, WhatSpeedingUpTakesIsNoContradiction) {
  for (const double acceleration : {5.0, 20.0, -20.0}) {
    EXPECT_EQ(doubt_of(run_with(acceleration, -60.0)), "") << acceleration;
    EXPECT_EQ(doubt_of(run_with(acceleration, 200.0)), "") << acceleration;
  }
}

TEST(CheckTorques, AtSteadySpeedItIs) {
  for (const double acceleration : {0.0, 4.9, -4.9}) {
    EXPECT_NE(doubt_of(run_with(acceleration, -60.0)).find("opposite sign"), std::string::npos);
    EXPECT_NE(doubt_of(run_with(acceleration, 200.0)).find("power at the secondary shaft"),
              std::string::npos);
  }
}

// 50 Nm before the belt; behind it 22.7 Nm at most arrive.
TEST(CheckTorques, WhatADragLeavesOfASmallTorqueIsOfEitherSign) {
  const auto doubt_at = [](double behind_Nm) {
    ExperimentData run = run_with(0.0, behind_Nm);
    run.torque_s.value.setConstant(behind_Nm);
    run.torque_s.value[0] += 0.1;
    return doubt_of(run);
  };
  EXPECT_EQ(doubt_at(-3.0), "");
  EXPECT_EQ(doubt_at(3.0), "");
  EXPECT_NE(doubt_at(-8.0).find("opposite sign"), std::string::npos);
  EXPECT_NE(doubt_at(1.0).find("power at the secondary shaft"), std::string::npos);
}

TEST(CheckTorques, ATorqueThatIsNotRecordedSaysNothing) {
  ExperimentData run = run_with(0.0, -60.0);
  run.torque_s.present = false;
  EXPECT_EQ(doubt_of(run), "");
}

// At one clamp force, the slip held at each of some levels for as long: the torque follows it.
ExperimentData slip_held_at(const std::vector<double>& slips_share, double ratio, int first = 0) {
  ExperimentData run = run_with(0.0, 20.0);
  run.name = "held";
  run.stop.assign(kSamples, kOverdriveStop);
  run.pressure.value = Eigen::ArrayXd::Constant(kSamples, 6e5);
  for (int k = 0; k < kSamples; ++k) {
    const auto level = (static_cast<std::size_t>(k / 30 + first)) % slips_share.size();
    run.omega_s.value[k] = 100.0 * ratio * (1.0 - slips_share[level]);
    run.torque.value[k] = 90.0 * std::tanh(slips_share[level] / 0.02);
    run.pressure.value[k] += 1e3 * ((k * 7 + first) % 11);  // noise: highest anywhere
  }
  return run;
}

TEST(CheckSameMachine, ARigThatHoldsTheSlipIsOneMachine) {
  const std::vector<double> slips_share{0.001, 0.005, 0.02, 0.06, 0.09};
  Implausible doubts;
  check_same_machine({slip_held_at(slips_share, 2.25), slip_held_at(slips_share, 2.25, 3)}, {},
                     doubts);
  EXPECT_FALSE(doubts.impossible) << doubts.notes.front();
}

TEST(CheckSameMachine, TwoRatiosAreTwoMachines) {
  const std::vector<double> slips_share{0.001, 0.005, 0.02};
  Implausible doubts;
  check_same_machine({slip_held_at(slips_share, 2.25), slip_held_at(slips_share, 2.4)}, {}, doubts);
  ASSERT_TRUE(doubts.impossible);
  EXPECT_NE(doubts.notes.front().find("cannot be of one machine"), std::string::npos);
}

}  // namespace
}  // namespace beltgrip::diagnose
