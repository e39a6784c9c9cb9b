// The path of a clamp request allocates nothing: from arming over the ramp to the result and the
// cool-down, and with each kind of fault that ends it.
#include <gtest/gtest.h>

#include <set>

#include "daemon/core/loop/pipeline.h"
#include "tests/loop/closed_loop.h"
#include "tests/loop/recorded_drive.h"
#include "tests/support/alloc_guard.h"
#include "tools/sim/vehicle_scenario.h"

namespace beltgrip::test {
namespace {

using daemon::State;

std::set<State> expect_no_allocation(const sim::VehicleScenario& scenario) {
  const daemon::Config config = vehicle_config(scenario);
  const std::vector<DriveStep> steps = record_drive(scenario, config);
  daemon::Pipeline pipeline(config);
  std::set<State> states;
  std::size_t clamp_frames = 0;
  for (const DriveStep& step : steps) {
    daemon::Outbox out;
    State state{};
    std::size_t allocations = 0, frees = 0;
    {
      const AllocGuard guard;
      if (step.is_frame) {
        pipeline.on_frame(step.frame);
      } else {
        state = pipeline.on_sample(step.t, out).state;
      }
      allocations = AllocGuard::allocations();
      frees = AllocGuard::frees();
    }
    EXPECT_EQ(allocations, 0U);
    EXPECT_EQ(frees, 0U);
    if (step.is_frame) continue;
    EXPECT_EQ(state, step.state);
    states.insert(state);
    for (std::size_t i = 0; i < out.size; ++i) clamp_frames += out.frames[i].id.value == 0x6A2;
  }
  EXPECT_GT(clamp_frames, 5U);
  return states;
}

TEST(CommandNoAlloc, AWholeExperiment) {
  const std::set<State> states =
      expect_no_allocation(sim::shipped_vehicle_scenario("coast-overdrive").scenario);
  for (const State state : {State::kInhibited, State::kIdle, State::kSettling, State::kRamping,
                            State::kEvaluating, State::kReleasing, State::kCooldown}) {
    EXPECT_TRUE(states.contains(state)) << static_cast<int>(state);
  }
}

TEST(CommandNoAlloc, WhateverEndsIt) {
  for (const sim::FaultKind kind :
       {sim::FaultKind::kAccelerator, sim::FaultKind::kBrake, sim::FaultKind::kTcuWithdraws,
        sim::FaultKind::kTcuIgnores, sim::FaultKind::kFrameSilent, sim::FaultKind::kFrameTruncated,
        sim::FaultKind::kBusOff, sim::FaultKind::kForeignFrames, sim::FaultKind::kEchoLost}) {
    sim::VehicleScenario scenario = sim::shipped_vehicle_scenario("coast-overdrive").scenario;
    scenario.duration_s = 20.0;  // the request waits until 13 s
    scenario.faults.push_back({kind, "", 3.0, true, 3.0, 1.0});
    const std::set<State> states = expect_no_allocation(scenario);
    EXPECT_TRUE(states.contains(State::kReleasing)) << static_cast<int>(kind);
  }
}

}  // namespace
}  // namespace beltgrip::test
