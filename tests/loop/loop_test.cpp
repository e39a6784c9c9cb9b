// The experiment in the virtual vehicle, from the first frame to the result: what each shipped
// scenario must come to, silence at every instant of the ramp, the same bytes for the same seed.
#include <gtest/gtest.h>

#include <cmath>

#include "daemon/core/arming.h"
#include "tests/loop/closed_loop.h"
#include "tests/loop/silence.h"
#include "tools/sim/vehicle_scenario.h"

namespace beltgrip::test {
namespace {

using daemon::Outcome;
using estimator::PeakKind;
using estimator::StopReason;

sim::VehicleScenario scenario(const char* name, const std::vector<std::string>& settings = {}) {
  std::vector<sim::ScenarioLayer> layers;
  for (const std::string& setting : settings) layers.push_back(sim::setting_layer(setting));
  sim::VehicleScenarioResult result = sim::shipped_vehicle_scenario(name, layers);
  EXPECT_TRUE(result.errors.empty()) << result.errors.front();
  return result.scenario;
}

void expect_unbroken(const LoopRun& run) {
  for (const auto& [which, how] : run.broken) ADD_FAILURE() << which << ": " << how;
}

const daemon::ExperimentResult* completed(const LoopRun& run) {
  for (const daemon::ExperimentResult& result : run.results) {
    if (result.outcome == Outcome::kCompleted) return &result;
  }
  return nullptr;
}

TEST(ClosedLoop, CoastOverdriveCompletesNearTheTruth) {
  const sim::VehicleScenario s = scenario("coast-overdrive");
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE(seed);
    const LoopRun run = run_closed(s, vehicle_config(s), seed);
    expect_unbroken(run);
    const daemon::ExperimentResult* result = completed(run);
    ASSERT_NE(result, nullptr);
    EXPECT_EQ(result->direction, estimator::Direction::kOverrun);
    EXPECT_EQ(result->end_stop, estimator::EndStop::kOverdrive);
    EXPECT_NEAR(result->peak.mu_max, 0.105, 0.003);
    EXPECT_LE(result->peak.ci95_low, 0.105);
    EXPECT_GE(result->peak.ci95_high, 0.105);
    ASSERT_EQ(run.requests.size(), 1u);
    EXPECT_TRUE(run.requests[0].peak_passed);
    EXPECT_LT(run.requests[0].slip_at_end, 0.05);
    EXPECT_LT(run.requests[0].slip_max, 0.06);
    EXPECT_EQ(run.stalls, 0);
  }
}

TEST(ClosedLoop, TheWornBeltHasLess) {
  const sim::VehicleScenario s = scenario("worn-belt");
  const LoopRun run = run_closed(s, vehicle_config(s), 1);
  expect_unbroken(run);
  const daemon::ExperimentResult* result = completed(run);
  ASSERT_NE(result, nullptr);
  EXPECT_NEAR(result->peak.mu_max, 0.090, 0.003);
}

TEST(ClosedLoop, UnreachableIsRefusedWithALowerBound) {
  const sim::VehicleScenario s = scenario("coast-overdrive-unreachable");
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const LoopRun run = run_closed(s, vehicle_config(s), seed);
    expect_unbroken(run);
    EXPECT_TRUE(run.requests.empty());
    ASSERT_FALSE(run.results.empty());
    for (const daemon::ExperimentResult& result : run.results) {
      EXPECT_EQ(result.outcome, Outcome::kInconclusive);
      EXPECT_EQ(result.stop_reason, StopReason::kForceFloor);
      EXPECT_EQ(result.peak.kind, PeakKind::kLowerBound);
      EXPECT_LT(result.peak.mu_max, 0.105);
      EXPECT_GT(result.peak.mu_max, 0.03);
    }
    EXPECT_EQ(run.inhibits, daemon::inhibit_bit(daemon::Inhibit::kUnreachable));
  }
}

TEST(ClosedLoop, TheRampEndsAtTheFloorWhereReachWasMisjudged) {
  // The belt grips better than anybody expected: the floor comes before the peak.
  const sim::VehicleScenario s = scenario("coast-overdrive", {"belt.mu_max=0.16"});
  const LoopRun run = run_closed(s, vehicle_config(s), 1);
  expect_unbroken(run);
  ASSERT_FALSE(run.results.empty());
  EXPECT_EQ(run.results[0].outcome, Outcome::kInconclusive);
  EXPECT_EQ(run.results[0].stop_reason, StopReason::kForceFloor);
  EXPECT_EQ(run.results[0].peak.kind, PeakKind::kLowerBound);
  EXPECT_LT(run.results[0].peak.mu_max, 0.16);
  EXPECT_GT(run.results[0].peak.mu_max, 0.08);
}

TEST(ClosedLoop, SteadyDriveTorqueCompletes) {
  const sim::VehicleScenario s = scenario("cruise-drive-torque");
  const LoopRun run = run_closed(s, vehicle_config(s, {{"trigger", "\"steady\""}}), 1);
  expect_unbroken(run);
  const daemon::ExperimentResult* result = completed(run);
  ASSERT_NE(result, nullptr);
  EXPECT_EQ(result->direction, estimator::Direction::kDrive);
  EXPECT_NEAR(result->peak.mu_max, 0.105, 0.008);  // accessories and losses count as friction
}

TEST(ClosedLoop, LowAndColdOilAreLeftAlone) {
  for (const char* name : {"coast-low", "cold-oil"}) {
    const sim::VehicleScenario s = scenario(name);
    const LoopRun run = run_closed(s, vehicle_config(s), 1);
    expect_unbroken(run);
    EXPECT_TRUE(run.requests.empty()) << name;
    EXPECT_EQ(completed(run), nullptr) << name;
  }
}

TEST(ClosedLoop, ACurveWithoutAPeakEndsByBackup) {
  const sim::VehicleScenario s =
      scenario("coast-overdrive", {"belt.curve=saturating", "belt.peak_slip_percent=3"});
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const LoopRun run = run_closed(s, vehicle_config(s), seed);
    expect_unbroken(run);
    for (const sim::RequestTruth& request : run.requests) {
      EXPECT_LT(request.slip_max, 0.10);
      EXPECT_LT(request.slip_speed_max_m_s, 0.8);
    }
  }
}

// X3: an estimator that never stops. Macro slip pulls the engine down in overrun and lets it flare
// up in drive; the backup stops find both.
TEST(ClosedLoop, TheBackupStopsAloneKeepTheLimits) {
  for (const char* name : {"coast-overdrive", "cruise-drive-torque"}) {
    const bool coast = std::string(name) == "coast-overdrive";
    const sim::VehicleScenario s = scenario(name);
    daemon::Config config =
        vehicle_config(s, {{"trigger", coast ? "\"coast_down\"" : "\"steady\""}});
    config.estimator.method = estimator::Method::kPaper;
    config.estimator.stop_slope = -1e9;
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      SCOPED_TRACE(testing::Message() << name << " " << seed);
      const LoopRun run = run_closed(s, config, seed);
      expect_unbroken(run);
      ASSERT_FALSE(run.requests.empty());
      EXPECT_TRUE(run.requests[0].peak_passed);
      EXPECT_LT(run.requests[0].slip_max, 0.10);
      EXPECT_LT(run.requests[0].slip_speed_max_m_s, 0.8);
      EXPECT_LT(run.requests[0].macro_energy_J, 100.0);
      ASSERT_FALSE(run.results.empty());
      EXPECT_TRUE(run.results[0].stop_reason == StopReason::kSlip ||
                  run.results[0].stop_reason == StopReason::kSlipRate ||
                  run.results[0].stop_reason == StopReason::kSlipEnergy)
          << static_cast<int>(run.results[0].stop_reason);
      EXPECT_EQ(run.stalls, 0);
    }
  }
}

TEST(ClosedLoop, ObserveNeverSendsAClampFrame) {
  const sim::VehicleScenario s = scenario("coast-overdrive");
  const LoopRun run = run_closed(s, vehicle_config(s, {{"control", "\"observe\""}}), 1);
  expect_unbroken(run);
  EXPECT_TRUE(run.requests.empty());
}

TEST(ClosedLoop, SameSeedSameRun) {
  const sim::VehicleScenario s = scenario("coast-overdrive");
  const LoopRun a = run_closed(s, vehicle_config(s), 3);
  const LoopRun b = run_closed(s, vehicle_config(s), 3);
  ASSERT_EQ(a.results.size(), b.results.size());
  for (std::size_t i = 0; i < a.results.size(); ++i) {
    EXPECT_EQ(a.results[i].peak.mu_max, b.results[i].peak.mu_max);
    EXPECT_EQ(a.results[i].end, b.results[i].end);
  }
  EXPECT_EQ(a.slip_bins, b.slip_bins);
  EXPECT_EQ(a.sent_hash, b.sent_hash);
}

// Every 5 ms of the whole ramp: tests/campaign --silence.
TEST(ClosedLoop, SilenceAtEveryInstantOfTheRamp) {
  const SilenceResult silence = silence_over_the_ramp(scenario("coast-overdrive"), 0.2, 0.005, 0.5);
  for (const auto& [which, how] : silence.broken) ADD_FAILURE() << which << ": " << how;
  EXPECT_GT(silence.runs, 200);
  EXPECT_GT(silence.slip_max, 0.02);  // the peak was passed
  EXPECT_LT(silence.slip_max, 0.10);
  EXPECT_LT(silence.slip_speed_max_m_s, 0.8);
  EXPECT_LT(silence.energy_J, 100.0);
}

// X13: the driver does something at every 50 ms of the ramp and every 5 ms around its end.
TEST(ClosedLoop, TheDriverActsAtAnyInstant) {
  const sim::VehicleScenario base = scenario("coast-overdrive");
  const daemon::Config config = vehicle_config(base);
  const LoopRun whole = run_closed(base, config, 1);
  const double length_s = whole.requests[0].end_s - whole.requests[0].begin_s;
  double worst = 0.0;
  struct Act {
    sim::FaultKind kind;
    double size;
  };
  for (const Act& act :
       {Act{sim::FaultKind::kAccelerator, 0.3}, Act{sim::FaultKind::kAccelerator, 1.0},
        Act{sim::FaultKind::kBrake, 2.0}, Act{sim::FaultKind::kBrake, 7.0}}) {
    for (double at_s = 0.1; at_s < length_s; at_s += at_s < length_s - 0.4 ? 0.4 : 0.01) {
      sim::VehicleScenario s = base;
      s.duration_s = whole.requests[0].end_s + 3.0;
      s.faults.push_back({act.kind, "", at_s, true, 1.5, act.size});
      const LoopRun run = run_closed(s, config, 1);
      for (const auto& [which, how] : run.broken) {
        ADD_FAILURE() << which << ": " << how << ", " << at_s;
      }
      for (const sim::RequestTruth& request : run.requests) {
        EXPECT_LT(request.slip_max, 0.10)
            << static_cast<int>(act.kind) << " " << act.size << " at " << at_s;
        worst = std::max(worst, request.slip_max);
      }
      if (!run.results.empty()) {
        EXPECT_NE(run.results[0].outcome, Outcome::kNone);
      }
    }
  }
  std::printf("worst slip %.2f %%\n", 100.0 * worst);
}

}  // namespace
}  // namespace beltgrip::test
