// Control "observe": what begins an experiment that somebody else makes, what ends it, and when it
// is over, for every trigger.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "daemon/core/loop/pipeline.h"
#include "tests/daemon/frame_player.h"
#include "tests/daemon/test_vehicle.h"

namespace beltgrip::daemon {
namespace {

using estimator::PeakKind;
using estimator::StopReason;
using test::Drive;
using test::drive_frames;
using Frames = std::vector<can::StampedFrame>;

struct Observed {
  std::vector<ExperimentResult> results;
  std::vector<SampleReport> reports;
  bool clamp_frame = false;
};

Config config_of(const std::string& trigger) {
  std::string toml = test::kVehicleToml;
  toml.replace(toml.find("\"always\""), 8, '"' + trigger + '"');
  toml.insert(toml.find("[experiment]"), "experiment_permitted = \"Flags.Permitted\"\n");
  return test::vehicle_config(toml + "primary_speed_min_rad_s = 90\n");
}

// The flag experiment_permitted is set until this instant.
Frames permitted(Frames frames, MonoTime until = MonoTime::max()) {
  for (can::StampedFrame& each : frames) {
    if (each.frame.id == can::CanId{0x103, false} && each.t_ns < until.ns())
      each.frame.data[0] |= 4;
  }
  return frames;
}

Frames joined(Frames first, const Frames& second) {
  first.insert(first.end(), second.begin(), second.end());
  return first;
}

Observed observe(const std::string& trigger, Frames frames) {
  test::FramePlayer port(std::move(frames));
  test::ReportKeeper keeper;
  const Config config = config_of(trigger);
  Pipeline pipeline(config);
  run_loop(port, pipeline, config.estimator.sample_rate_hz, StopReason::kTraceEnd, &keeper);
  const bool clamp = std::any_of(port.sent.begin(), port.sent.end(),
                                 [](const auto& each) { return each.frame.id.value == 0x6A2; });
  return {keeper.results, keeper.reports, clamp};
}

TEST(Observe, EveryTriggerMeasuresTheRampThatOthersMake) {
  struct Case {
    const char* trigger;
    bool overrun;
    bool measures;
  };
  for (const Case& each : {Case{"always", false, true}, Case{"always", true, true},
                           Case{"signal", false, true}, Case{"signal", true, true},
                           Case{"coast_down", true, true}, Case{"coast_down", false, false},
                           Case{"steady", false, true}, Case{"steady", true, false}}) {
    SCOPED_TRACE(testing::Message() << each.trigger << (each.overrun ? " overrun" : " drive"));
    Drive drive;
    drive.overrun = each.overrun;
    drive.active_from_ms = 500;
    drive.active_to_ms = 12'000;
    const Observed seen = observe(each.trigger, permitted(drive_frames(drive)));
    EXPECT_FALSE(seen.clamp_frame);
    ASSERT_EQ(seen.results.size(), each.measures ? 1U : 0U);
    if (!each.measures) continue;
    const ExperimentResult& result = seen.results[0];
    EXPECT_EQ(result.outcome, Outcome::kCompleted);
    EXPECT_TRUE(result.stopped);
    EXPECT_EQ(result.direction,
              each.overrun ? estimator::Direction::kOverrun : estimator::Direction::kDrive);
    EXPECT_NEAR(result.peak.mu_max, test::kTrueMuMax, 0.003);
    EXPECT_GT(result.samples, 600);
    // Nobody has raised the force again: the flag stays.
    EXPECT_TRUE(seen.reports.back().macro_slip_stop);
  }
}

TEST(Observe, TheForceBackEndsTheFlagAndTheNextRampIsMeasured) {
  Drive drive;
  drive.overrun = true;
  drive.duration_s = 9.0;
  Frames frames = drive_frames(drive);
  drive.start_ns += (9 * kSecond).ns();
  frames = permitted(joined(frames, drive_frames(drive)));
  const Observed seen = observe("coast_down", frames);
  ASSERT_EQ(seen.results.size(), 2U);
  for (const ExperimentResult& result : seen.results) {
    EXPECT_EQ(result.outcome, Outcome::kCompleted);
    EXPECT_NEAR(result.peak.mu_max, test::kTrueMuMax, 0.003);
  }
  const auto at = [&](MonoTime t) {
    return std::find_if(seen.reports.begin(), seen.reports.end(),
                        [&](const SampleReport& report) { return report.t >= t; });
  };
  EXPECT_TRUE(at(MonoTime::of_ns(drive.start_ns) - 20 * kMillisecond)->macro_slip_stop);
  EXPECT_FALSE(at(MonoTime::of_ns(drive.start_ns) + 500 * kMillisecond)->macro_slip_stop);
}

TEST(Observe, TheCarEndsItWithItsReason) {
  Drive drive;
  drive.overrun = true;
  const MonoTime until = MonoTime::of_ns(drive.start_ns) + 4 * kSecond;
  const Observed seen = observe("coast_down", permitted(drive_frames(drive), until));
  ASSERT_EQ(seen.results.size(), 1U);
  EXPECT_EQ(seen.results[0].outcome, Outcome::kInconclusive);
  EXPECT_EQ(seen.results[0].stop_reason, StopReason::kPermission);
  EXPECT_FALSE(seen.results[0].stopped);
  EXPECT_GT(seen.results[0].samples, 400);
  EXPECT_NE(seen.results[0].peak.kind, PeakKind::kValue);
  EXPECT_FALSE(seen.reports.back().in_experiment);
}

TEST(Observe, ASignalOfTheConditionsThatIsLostAborts) {
  Drive drive;
  drive.overrun = true;
  Frames frames = permitted(drive_frames(drive));
  std::erase_if(frames, [&](const can::StampedFrame& each) {
    return each.frame.id == can::CanId{0x103, false} &&
           each.t_ns > drive.start_ns + (4 * kSecond).ns();
  });
  const Observed seen = observe("coast_down", frames);
  ASSERT_EQ(seen.results.size(), 1U);
  EXPECT_EQ(seen.results[0].outcome, Outcome::kAborted);
  EXPECT_EQ(seen.results[0].stop_reason, StopReason::kInputs);
}

// One coast-down is one experiment, however long it lasts before anybody lowers the force.
TEST(Observe, WithoutARampThereIsOneBound) {
  Drive drive;
  drive.overrun = true;
  drive.ramp_N_per_s = 0.0;
  const Observed seen = observe("coast_down", permitted(drive_frames(drive)));
  ASSERT_EQ(seen.results.size(), 1U);
  EXPECT_EQ(seen.results[0].outcome, Outcome::kInconclusive);
  EXPECT_EQ(seen.results[0].stop_reason, StopReason::kTraceEnd);
  EXPECT_NE(seen.results[0].peak.kind, PeakKind::kValue);
}

TEST(Observe, ARampLateInALongSteadyDriveIsMeasured) {
  Drive drive;
  drive.ramp_N_per_s = 0.0;
  drive.duration_s = 300.0;
  const Frames before = drive_frames(drive);
  drive.start_ns += (300 * kSecond).ns();
  drive.ramp_N_per_s = 300.0;
  drive.duration_s = 12.0;
  const Observed seen = observe("steady", permitted(joined(before, drive_frames(drive))));
  ASSERT_EQ(seen.results.size(), 1U);
  EXPECT_EQ(seen.results[0].outcome, Outcome::kCompleted);
  EXPECT_NEAR(seen.results[0].peak.mu_max, test::kTrueMuMax, 0.003);
}

}  // namespace
}  // namespace beltgrip::daemon
