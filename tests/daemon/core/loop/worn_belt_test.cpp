// MinClampForce on a belt that has lost friction: it never rests on a history that the last value
// contradicts, and only a measured value ends the doubt.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "daemon/core/config/load/load_config.h"
#include "daemon/core/loop/pipeline.h"
#include "daemon/core/publish/own_frames.h"
#include "daemon/io/history_keeper.h"
#include "tests/daemon/frame_player.h"
#include "tests/daemon/test_vehicle.h"

namespace beltgrip::daemon {
namespace {

using test::Drive;

// As the daemon: every result goes to the history, what that says comes back. late: what it says
// once it can be read, after the start.
class Learner final : public SampleSink {
 public:
  Learner(Pipeline& pipeline, HistoryKeeper& history, test::ReportKeeper& keeper,
          std::optional<estimator::LearnedFriction> late)
      : pipeline_(pipeline), history_(history), keeper_(keeper), late_(std::move(late)) {}
  void on_report(const SampleReport& report) noexcept override {
    keeper_.on_report(report);
    if (late_) pipeline_.learn(*late_);
    late_.reset();
    if (report.new_result) pipeline_.learn(history_.take(report.result));
  }

 private:
  Pipeline& pipeline_;
  HistoryKeeper& history_;
  test::ReportKeeper& keeper_;
  std::optional<estimator::LearnedFriction> late_;
};

double min_clamp_N(const can::CanFrame& frame) {
  const can::MessageDef* message = own_database().find_message(frame.id);
  return can::SignalCodec(*message->find_signal("MinClampForce")).decode(frame.payload());
}

struct Course {
  std::vector<ExperimentResult> results;
  std::vector<double> least_margin;   // after each experiment, until the next one begins
  std::vector<double> margin_before;  // least in each drive until its experiment has a result
  std::vector<bool> doubtful;         // at the end of each
};

constexpr std::size_t kNever = 1000;

struct Plan {
  std::vector<double> belts;  // mu_max, one experiment each; 0: one in which nothing is lowered
  double start_force_N = 6000.0;
  std::vector<bool> overrun{};      // by experiment; none: drive
  std::size_t restart_at = kNever;  // the daemon starts anew before this one
  bool late = false;                // the history can be read only after the start
};

// One experiment after the other.
Course drive_belts(const Plan& plan) {
  const std::vector<double>& belts = plan.belts;
  constexpr double kCos = 0.98162718, kRadius_m = 0.0784;
  std::vector<can::StampedFrame> frames;
  constexpr double kEach_s = 14.0;
  double mu = 0.0;
  std::vector<double> truth;
  for (std::size_t i = 0; i < belts.size(); ++i) {
    Drive drive;
    drive.duration_s = kEach_s - 0.1;
    drive.start_ns += static_cast<std::int64_t>(static_cast<double>(i) * kEach_s * 1e9);
    drive.start_force_N = plan.start_force_N;
    drive.overrun = i < plan.overrun.size() && plan.overrun[i];
    drive.seed = 100 + i;
    drive.active_from_ms = 500;
    drive.active_to_ms = 13'000;
    drive.ramp_N_per_s = belts[i] > 0.0 ? 300.0 : 0.0;
    if (belts[i] > 0.0) mu = belts[i];
    drive.mu_max = mu;
    truth.push_back(mu);
    for (const auto& each : test::drive_frames(drive)) frames.push_back(each);
  }
  const Config config = test::vehicle_config(test::signalled_toml());
  test::TemporaryDirectory folder;
  double time_s = 1.7e9;
  test::ReportKeeper keeper;
  std::vector<test::SentFrame> sent_frames;
  const auto run_daemon = [&](const std::vector<can::StampedFrame>& heard) {
    if (heard.empty()) return;
    Pipeline pipeline(config);
    HistoryKeeper history(
        folder.path(), "belt", [](bool, const std::string&) {}, [&] { return time_s += 60.0; });
    std::optional<estimator::LearnedFriction> kept = history.open();
    pipeline.learn(plan.late ? estimator::LearnedFriction{} : *kept);
    if (!plan.late) kept.reset();
    test::FramePlayer port(heard);
    Learner learner(pipeline, history, keeper, kept);
    run_loop(port, pipeline, config.estimator.sample_rate_hz, estimator::StopReason::kTraceEnd,
             &learner);
    sent_frames.insert(sent_frames.end(), port.sent.begin(), port.sent.end());
  };
  const auto restart_ns =
      static_cast<std::int64_t>(1e9 + static_cast<double>(plan.restart_at) * kEach_s * 1e9);
  const auto restart = std::find_if(frames.begin(), frames.end(),
                                    [&](const auto& each) { return each.t_ns >= restart_ns; });
  run_daemon({frames.begin(), restart});
  run_daemon({restart, frames.end()});

  Course run;
  run.results = keeper.results;
  std::size_t next_report = 0;
  for (std::size_t i = 0; i < belts.size(); ++i) {
    const auto end_ns = static_cast<std::int64_t>(1e9 + static_cast<double>(i + 1) * kEach_s * 1e9);
    double least = 1e9, before = 1e9;
    bool doubtful = false;
    for (; next_report < keeper.reports.size() && keeper.reports[next_report].t.ns() < end_ns;
         ++next_report) {
      const SampleReport& report = keeper.reports[next_report];
      doubtful = (report.faults & fault_bit(Fault::kResultDoubtful)) != 0;
    }
    for (std::size_t k = 0; k < run.results.size(); ++k) {
      // The frames with and after the result of this drive, at the torque of their sample.
      const ExperimentResult& result = run.results[k];
      if (result.end.ns() >= end_ns ||
          result.end.ns() < end_ns - static_cast<std::int64_t>(kEach_s * 1e9)) {
        continue;
      }
      std::size_t at = 0;
      for (const test::SentFrame& sent : sent_frames) {
        const std::int64_t begin_ns = end_ns - static_cast<std::int64_t>(kEach_s * 1e9);
        if (sent.frame.id.value != 0x6A0 || sent.t.ns() < begin_ns || sent.t.ns() >= end_ns)
          continue;
        while (at + 1 < keeper.reports.size() && keeper.reports[at].t < sent.t) ++at;
        const SampleReport& report = keeper.reports[at];
        const bool told = report.result.end == result.end;
        const bool early = sent.t < result.end - kSecond;
        const double torque_Nm = std::abs(report.curve.torque_p_Nm);
        if (!(told || early) || !report.curve.usable || torque_Nm < 10.0) continue;
        const double slips_N = torque_Nm * kCos / (2.0 * kRadius_m * truth[i]);
        double& margin = told ? least : before;
        margin = std::min(margin, min_clamp_N(sent.frame) / slips_N);
      }
    }
    run.least_margin.push_back(least);
    run.margin_before.push_back(before);
    run.doubtful.push_back(doubtful);
  }
  return run;
}

TEST(WornBelt, NoFrameRestsOnTheOldBelt) {
  constexpr double kBelt = 0.105;
  for (const double loss : {0.05, 0.12, 0.30}) {
    for (const int before : {1, 2, 5}) {
      std::vector<double> belts(static_cast<std::size_t>(before), kBelt);
      belts.push_back((1.0 - loss) * kBelt);
      belts.push_back((1.0 - loss) * kBelt);
      const Course run = drive_belts({belts});
      ASSERT_EQ(run.results.size(), belts.size()) << loss << " " << before;
      for (std::size_t i = 0; i < belts.size(); ++i) {
        ASSERT_EQ(run.results[i].outcome, Outcome::kCompleted) << loss << " " << before << " " << i;
        EXPECT_GT(run.least_margin[i], 1.26) << loss << " after " << before << ", at " << i;
        EXPECT_LT(run.least_margin[i], 1.40) << loss << " after " << before << ", at " << i;
      }
    }
  }
}

// The ramp begins so near the worn belt's peak that there is no value: what it carried at the most
// is then all that may be counted on.
TEST(WornBelt, ABeltThatSlipsBeforeItsCurveIsSeenIsNotTheOldOne) {
  for (const double start_force_N : {4200.0, 4500.0, 4800.0}) {
    const Course run = drive_belts({{0.105, 0.105, 0.0735, 0.0735}, start_force_N});
    ASSERT_EQ(run.results.size(), 4U) << start_force_N;
    for (std::size_t i = 2; i < 4; ++i) {
      EXPECT_GT(run.least_margin[i], 1.2) << start_force_N << " N, at " << i;
      EXPECT_TRUE(run.doubtful[i] || run.results[i].outcome == Outcome::kCompleted)
          << start_force_N << " N, at " << i;
    }
  }
}

TEST(WornBelt, OnlyAMeasuredValueEndsTheDoubt) {
  const Course run = drive_belts({{0.105, 0.105, 0.105, 0.0735, 0.0, 0.0735, 0.0735}});
  ASSERT_EQ(run.results.size(), 7U);
  EXPECT_EQ(run.results[4].outcome, Outcome::kInconclusive);
  EXPECT_FALSE(run.doubtful[2]);
  EXPECT_TRUE(run.doubtful[3]);
  EXPECT_TRUE(run.doubtful[4]);  // nothing was measured
  EXPECT_FALSE(run.doubtful[6]);
  for (std::size_t i = 3; i < 7; ++i) EXPECT_GT(run.least_margin[i], 1.26) << i;
}

// What the last experiment said counts after a restart too, with a value and without, and where the
// history can be read only after the start.
TEST(WornBelt, ARestartDoesNotBringTheOldBeltBack) {
  for (const bool late : {false, true}) {
    const Course measured =
        drive_belts({.belts = {0.105, 0.105, 0.105, 0.105, 0.105, 0.0735, 0.0735},
                     .restart_at = 6,
                     .late = late});
    ASSERT_EQ(measured.results.size(), 7U);
    EXPECT_GT(measured.margin_before[6], 1.26) << late;
    EXPECT_LT(measured.margin_before[6], 1.40) << late;

    const Course slipped = drive_belts({.belts = {0.105, 0.105, 0.0735, 0.0},
                                        .start_force_N = 4500.0,
                                        .restart_at = 3,
                                        .late = late});
    ASSERT_EQ(slipped.results.size(), 4U);
    ASSERT_NE(slipped.results[2].outcome, Outcome::kCompleted);
    EXPECT_GT(slipped.margin_before[3], 1.2) << late;
    EXPECT_TRUE(slipped.doubtful[3]) << late;
  }
}

// It is one belt: friction that is lost in overrun is lost in drive, until drive is measured again.
TEST(WornBelt, WhatOneDirectionHasLostTheOtherHasLostToo) {
  for (const std::size_t restart_at : {kNever, std::size_t{5}}) {
    const Course run = drive_belts({.belts = {0.105, 0.105, 0.105, 0.105, 0.0735, 0.0, 0.0735},
                                    .overrun = {false, false, true, true, true, false, false},
                                    .restart_at = restart_at});
    ASSERT_EQ(run.results.size(), 7U);
    EXPECT_LT(run.margin_before[4], 1.0);  // nothing has shown it yet
    EXPECT_GT(run.margin_before[5], 1.26) << restart_at;
    EXPECT_LT(run.margin_before[5], 1.40) << restart_at;
    EXPECT_TRUE(run.doubtful[5]) << restart_at;
    EXPECT_GT(run.least_margin[6], 1.26) << restart_at;
    EXPECT_LT(run.least_margin[6], 1.40) << restart_at;
  }
}

// With constants that are assumed a history keeps friction as it was weighed, and a slip is read
// under the configuration's: here 1.9 times as high, as with a centrifugal force that nobody
// stated.
TEST(WornBelt, ASlipIsHeldAgainstWhatWasReadNotAgainstWhatWasWeighed) {
  std::string toml = test::stated(test::kVehicleToml);
  const std::size_t at = toml.find("\nsecondary_centrifugal_N_s2 =");
  ASSERT_NE(at, std::string::npos);
  toml.erase(at, toml.find('\n', at + 1) - at);
  test::TemporaryDirectory folder;
  folder.write("vehicle.dbc", test::kVehicleDbc);
  const ConfigResult loaded = load_config(folder.write("beltgripd.toml", toml));
  ASSERT_TRUE(loaded.config.has_value());
  const Config& config = *loaded.config;
  ASSERT_TRUE(config.friction_is_assumed);
  constexpr double kWeighed = 0.105, kRead = 1.9 * kWeighed, kLeft = 0.7;
  const double per_force = 2.0 * 0.0784 / 0.98162718;  // torque by clamp force and friction
  estimator::BeltExperiment value{.time_s = 1.7e9,
                                  .kind = estimator::PeakKind::kValue,
                                  .mu_max = kWeighed,
                                  .mu_max_std = 0.01,
                                  .ci95_low = 0.085,
                                  .ci95_high = 0.125,
                                  .sensor_std = 0.0099,
                                  .carried_Nm_per_N = kRead * per_force};
  estimator::BeltExperiment slip{
      .time_s = 1.7e9 + 60.0, .carried_Nm_per_N = kLeft * kRead * per_force, .slipped = true};
  Drive drive;
  drive.ramp_N_per_s = 0.0;
  drive.duration_s = 3.0;
  const auto force_N = [&](const std::vector<estimator::BeltExperiment>& rows) {
    Pipeline pipeline(config);
    pipeline.learn(estimator::learn(rows, 1.7e9 + 120.0));
    test::FramePlayer port(test::drive_frames(drive));
    test::ReportKeeper keeper;
    run_loop(port, pipeline, config.estimator.sample_rate_hz, estimator::StopReason::kTraceEnd,
             &keeper);
    double last_N = 0.0;
    for (const test::SentFrame& sent : port.sent) {
      if (sent.frame.id.value == 0x6A0) last_N = min_clamp_N(sent.frame);
    }
    return last_N;
  };
  const double healthy_N = force_N({value});
  ASSERT_LT(healthy_N, 32000.0);
  EXPECT_NEAR(force_N({value, slip}) / healthy_N, 1.0 / kLeft, 0.01);
}

}  // namespace
}  // namespace beltgrip::daemon
