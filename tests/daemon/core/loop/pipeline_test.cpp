// The whole pipeline over drives: experiments and their outcomes, the stop flag, periods and
// at-once rules of what is published, refusals, determinism.
#include "daemon/core/loop/pipeline.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <numbers>
#include <set>

#include "can_dbc/frame/e2e.h"
#include "daemon/core/publish/own_frames.h"
#include "tests/daemon/frame_player.h"
#include "tests/daemon/test_vehicle.h"

namespace beltgrip::daemon {
namespace {

using estimator::PeakKind;
using estimator::StopReason;
using test::Drive;
using test::drive_frames;

struct Played {
  std::vector<test::SentFrame> sent;
  std::vector<SampleReport> reports;
  std::vector<ExperimentResult> results;
  PipelineCounters counters;
};

Played run_frames(const Config& config, std::vector<can::StampedFrame> frames,
                  StopReason end = StopReason::kTraceEnd) {
  test::FramePlayer port(std::move(frames));
  test::ReportKeeper keeper;
  Pipeline pipeline(config);
  run_loop(port, pipeline, config.estimator.sample_rate_hz, end, &keeper);
  return {port.sent, keeper.reports, keeper.results, pipeline.counters()};
}

std::string signal_toml() {
  std::string toml = test::kVehicleToml;
  toml.replace(toml.find("\"always\""), 8, "\"signal\"");
  return toml;
}

// Value of one signal of a published frame, through the DBC.
double value_of(const can::CanFrame& frame, const std::string& signal) {
  const can::MessageDef* message = own_database().find_message(frame.id);
  return can::SignalCodec(*message->find_signal(signal)).decode(frame.payload());
}

std::vector<test::SentFrame> of_id(const Played& run, std::uint32_t id) {
  std::vector<test::SentFrame> found;
  for (const auto& each : run.sent) {
    if (each.frame.id.value == id) found.push_back(each);
  }
  return found;
}

// The pressure in one page of its message, which comes every 20 ms; the pages in this order.
std::vector<can::StampedFrame> paged(std::vector<can::StampedFrame> frames,
                                     const std::vector<int>& pages) {
  std::size_t next = 0;
  for (can::StampedFrame& each : frames) {
    if (each.frame.id != can::CanId{0x101, false}) continue;
    const int page = pages[next++ % pages.size()];
    if (page != 1) each.frame.data[0] = each.frame.data[1] = 0x11;  // something else
    each.frame.data[3] = static_cast<std::uint8_t>(page);
  }
  return frames;
}

std::string paged_dbc() {
  std::string dbc = test::kVehicleDbc;
  const std::string pressure = " SG_ SecondaryPressure :";
  dbc.replace(dbc.find(pressure), pressure.size(),
              " SG_ Page M : 24|8@1+ (1,0) [0|255] \"\" ECU\n SG_ SecondaryPressure m1 :");
  return dbc;
}

TEST(Pipeline, AMultiplexedPressureIsAsOldAsItsOwnPeriodLetsIt) {
  const Config config = test::vehicle_config(test::kVehicleToml, paged_dbc());
  for (const std::vector<int>& pages :
       {std::vector<int>{1, 2, 3}, {1, 2, 1, 3, 4}, {1, 0, 0, 1, 0, 2, 0}}) {
    const Played run = run_frames(config, paged(drive_frames({.ramp_N_per_s = 250.0}), pages));
    ASSERT_EQ(run.results.size(), 1U) << pages.size();
    EXPECT_EQ(run.results[0].outcome, Outcome::kCompleted) << pages.size();
    EXPECT_NEAR(run.results[0].peak.mu_max, test::kTrueMuMax, 0.004);
    for (const SampleReport& report : run.reports) {
      EXPECT_EQ(report.faults & fault_bit(Fault::kInputStale), 0U) << report.t;
    }
  }
}

TEST(Pipeline, AConfiguredPeriodWinsOverTheLearnedOne) {
  std::string toml = test::kVehicleToml;
  const std::string pressure = "\"Pressure.SecondaryPressure\"";
  toml.replace(toml.find(pressure), pressure.size(),
               "{ signal = " + pressure + ", period_ms = 20 }");
  const Config config = test::vehicle_config(toml, paged_dbc());
  const Played run = run_frames(config, paged(drive_frames({}), {1, 2, 3}));
  const bool stale = std::any_of(run.reports.begin(), run.reports.end(), [](const auto& report) {
    return (report.faults & fault_bit(Fault::kInputStale)) != 0;
  });
  EXPECT_TRUE(stale);
}

// Inputs that come in bursts, 70 ms apart, are stale for a while before each: without a hold the
// state went to and fro fourteen times a second.
TEST(Pipeline, InputsThatComeAndGoChangeTheStateTwiceASecondAtMost) {
  std::vector<can::StampedFrame> frames = drive_frames({.duration_s = 10.0, .ramp_N_per_s = 0.0});
  std::erase_if(frames, [&](const can::StampedFrame& each) {
    return (each.t_ns - 1'000'000'000) % 140'000'000 > 65'000'000;
  });
  const Played run = run_frames(test::vehicle_config(signal_toml()), frames);
  std::vector<MonoTime> changes;
  for (std::size_t i = 1; i < run.reports.size(); ++i) {
    if (run.reports[i].state != run.reports[i - 1].state) changes.push_back(run.reports[i].t);
  }
  ASSERT_FALSE(changes.empty());
  for (std::size_t i = 2; i < changes.size(); ++i) {
    EXPECT_GE(changes[i] - changes[i - 2], kSecond) << i;
  }
}

TEST(Pipeline, AnExperimentIsCompletedAndPublishedAtOnce) {
  const Played run = run_frames(test::vehicle_config(), drive_frames({}));
  ASSERT_EQ(run.results.size(), 1U);
  const ExperimentResult& result = run.results[0];
  EXPECT_EQ(result.outcome, Outcome::kCompleted);
  EXPECT_TRUE(result.stopped);
  EXPECT_NE(result.stop_reason, StopReason::kNone);
  EXPECT_EQ(result.peak.kind, PeakKind::kValue);
  EXPECT_NEAR(result.peak.mu_max, test::kTrueMuMax, 0.003);
  EXPECT_GT(result.samples, 1000);
  EXPECT_GT(result.sigma_stop_percent, 1.0);
  EXPECT_LT(result.sigma_stop_percent, 10.0);

  // In the sample of the decision the flag leaves; the result when the half second after the stop
  // has been watched (after_stop.h) and the evaluation with it, a piece of it per sample, is done.
  const auto first_stop = std::find_if(run.sent.begin(), run.sent.end(), [](const auto& each) {
    return each.frame.id.value == 0x6A1 && value_of(each.frame, "MacroSlipStop") == 1.0;
  });
  ASSERT_NE(first_stop, run.sent.end());
  EXPECT_EQ(first_stop->t, result.end);
  const auto first_value = std::find_if(run.sent.begin(), run.sent.end(), [](const auto& each) {
    return each.frame.id.value == 0x6A0 && value_of(each.frame, "MuMaxValid") == 1.0;
  });
  ASSERT_NE(first_value, run.sent.end());
  EXPECT_LE(first_value->t - result.end, kSecond);
  EXPECT_NEAR(value_of(first_value->frame, "MuMax"), result.peak.mu_max, 0.6e-5);
  EXPECT_EQ(value_of(first_value->frame, "MuMaxKind"), 1.0);
  EXPECT_GE(value_of(first_value->frame, "MuMaxStd"), result.peak.mu_max_std);
  EXPECT_EQ(value_of(first_value->frame, "ExperimentCount"), 1.0);

  // It stays up to the end.
  bool stop = false;
  for (const auto& each : of_id(run, 0x6A1)) {
    const bool now = value_of(each.frame, "MacroSlipStop") == 1.0;
    EXPECT_TRUE(now || !stop);
    stop = now;
  }
  EXPECT_TRUE(stop);
}

TEST(Pipeline, MinimumClampForceFollowsTheTorque) {
  Drive drive;
  drive.duration_s = 10.0;
  const Played run = run_frames(test::vehicle_config(), drive_frames(drive));
  ASSERT_EQ(run.results.size(), 1U);
  const double mu = run.results[0].peak.mu_max;
  std::size_t available = 0;
  for (const auto& each : of_id(run, 0x6A0)) {
    const double force = value_of(each.frame, "MinClampForce");
    if (value_of(each.frame, "MuMaxValid") == 0.0) {
      EXPECT_EQ(force, 8191 * 4.0);  // not available
      continue;
    }
    if (force == 8191 * 4.0) continue;
    ++available;
    const auto at = std::find_if(run.reports.begin(), run.reports.end(),
                                 [&](const SampleReport& report) { return report.t >= each.t; });
    ASSERT_NE(at, run.reports.end());
    const double wanted = 1.3 * at->curve.torque_p_Nm * std::cos(11.0 * std::numbers::pi / 180.0) /
                          (2.0 * 0.0784 * mu);
    EXPECT_GE(force, wanted);
    EXPECT_LT(force, wanted + 4.5);
  }
  EXPECT_GT(available, 5U);
}

// What all experiments say goes before what the last one says, from the first sample on; results go
// the other way.
TEST(Pipeline, MinimumClampForceRestsOnTheHistoryWhereThereIsOne) {
  const Config config = test::vehicle_config();
  HistoryRings rings;
  estimator::LearnedFriction learned;
  estimator::FusedFriction& drive = learned.groups[estimator::LearnedFriction::index(
      estimator::Direction::kDrive, estimator::EndStop::kOverdrive)];
  drive.known = true;
  drive.mu_max = 0.0875;
  learned.doubtful = learned.unwritten = true;
  rings.learned.push(learned);
  test::FramePlayer port(drive_frames({}));
  test::ReportKeeper keeper;
  Pipeline pipeline(config);
  run_loop(port, pipeline, config.estimator.sample_rate_hz, StopReason::kTraceEnd, &keeper, nullptr,
           nullptr, {.history = &rings});
  Played run{port.sent, keeper.reports, keeper.results, pipeline.counters()};

  std::size_t before = 0;
  for (const auto& each : of_id(run, 0x6A0)) {
    const double force = value_of(each.frame, "MinClampForce");
    if (force == 8191 * 4.0) continue;
    before += value_of(each.frame, "MuMaxKind") == 0.0;
    const auto at = std::find_if(run.reports.begin(), run.reports.end(),
                                 [&](const SampleReport& report) { return report.t >= each.t; });
    ASSERT_NE(at, run.reports.end());
    const double wanted = 1.3 * at->curve.torque_p_Nm * std::cos(11.0 * std::numbers::pi / 180.0) /
                          (2.0 * 0.0784 * 0.0875);
    EXPECT_GE(force, wanted);
    EXPECT_LT(force, wanted + 4.5);
  }
  EXPECT_GT(before, 50U);
  const std::uint32_t faults = run.reports.back().faults;
  EXPECT_NE(faults & fault_bit(Fault::kResultDoubtful), 0U);
  EXPECT_NE(faults & fault_bit(Fault::kHistoryUnwritten), 0U);

  ASSERT_EQ(run.results.size(), 1U);
  ExperimentResult result;
  ASSERT_TRUE(rings.results.pop(result));
  EXPECT_EQ(result.peak.mu_max, run.results[0].peak.mu_max);
  EXPECT_NEAR(result.omega_p_rad_s, run.reports.back().sample.omega_p_rad_s, 50.0);
  EXPECT_GT(result.torque_Nm, 10.0);
  EXPECT_GT(result.clamp_force_N, 500.0);
  EXPECT_TRUE(std::isnan(result.oil_degC));  // no such signal
  EXPECT_FALSE(rings.results.pop(result));
}

TEST(Pipeline, APeakOutOfReachIsALowerBoundAndNeverAValue) {
  Drive drive;
  drive.duration_s = 4.0;  // mu* reaches 0.1 at most
  drive.start_force_N = 5200.0;
  const Played run = run_frames(test::vehicle_config(), drive_frames(drive));
  ASSERT_EQ(run.results.size(), 1U);
  EXPECT_EQ(run.results[0].outcome, Outcome::kInconclusive);
  EXPECT_EQ(run.results[0].stop_reason, StopReason::kTraceEnd);
  EXPECT_FALSE(run.results[0].stopped);
  EXPECT_EQ(run.results[0].peak.kind, PeakKind::kLowerBound);
  for (const auto& each : of_id(run, 0x6A0)) {
    EXPECT_EQ(value_of(each.frame, "MuMaxValid"), 0.0);
    EXPECT_NE(value_of(each.frame, "MuMaxKind"), 1.0);
    EXPECT_EQ(value_of(each.frame, "MuMaxStd"), 0.0);
  }
  const auto estimates = of_id(run, 0x6A0);
  EXPECT_EQ(value_of(estimates.back().frame, "MuMaxKind"), 2.0);
  EXPECT_LT(value_of(estimates.back().frame, "MuMax"), test::kTrueMuMax);
  for (const auto& each : of_id(run, 0x6A1)) {
    EXPECT_EQ(value_of(each.frame, "MacroSlipStop"), 0.0);
  }
}

TEST(Pipeline, ShutdownEndsAnExperimentWithItsReason) {
  Drive drive;
  drive.duration_s = 3.0;
  const Played run = run_frames(test::vehicle_config(), drive_frames(drive), StopReason::kShutdown);
  ASSERT_EQ(run.results.size(), 1U);
  EXPECT_EQ(run.results[0].stop_reason, StopReason::kShutdown);
  const auto statuses = of_id(run, 0x6A3);
  EXPECT_EQ(value_of(statuses.back().frame, "StopReason"), 15.0);
  EXPECT_EQ(value_of(statuses.back().frame, "State"), 0.0);
}

// Each input in turn falls silent in the middle of an experiment.
TEST(Pipeline, ALostInputAbortsWithinItsStaleTime) {
  for (const std::uint32_t id : {0x100U, 0x101U, 0x12345678U}) {
    auto frames = drive_frames({});
    const MonoTime silent = MonoTime::of_ns(frames.front().t_ns) + 3 * kSecond;
    MonoTime last{};
    std::erase_if(frames, [&](const can::StampedFrame& each) {
      if (each.frame.id.value != id) return false;
      if (MonoTime::of_ns(each.t_ns) < silent) last = MonoTime::of_ns(each.t_ns);
      return MonoTime::of_ns(each.t_ns) >= silent;
    });
    const Played run = run_frames(test::vehicle_config(), frames);
    ASSERT_EQ(run.results.size(), 1U) << id;
    const ExperimentResult& result = run.results[0];
    EXPECT_EQ(result.outcome, Outcome::kAborted);
    EXPECT_EQ(result.stop_reason, StopReason::kInputs);
    EXPECT_EQ(result.peak.kind, PeakKind::kNone);
    EXPECT_GT(result.end - last, 50 * kMillisecond);
    EXPECT_LE(result.end - last, 55 * kMillisecond + kNanosecond);
    const auto stop = std::find_if(run.sent.begin(), run.sent.end(), [](const auto& each) {
      return each.frame.id.value == 0x6A1 && value_of(each.frame, "MacroSlipStop") == 1.0;
    });
    ASSERT_NE(stop, run.sent.end());
    EXPECT_EQ(stop->t, result.end);
    for (const auto& each : of_id(run, 0x6A0)) {
      EXPECT_EQ(value_of(each.frame, "MuMaxKind"), 0.0);
    }
  }
}

// Every frame comes, but a primary speed of zero gives no sample: the abort says so.
TEST(Pipeline, AReadingThatGivesNoSampleIsNamedAsTheCause) {
  auto frames = drive_frames({});
  const MonoTime stopped = MonoTime::of_ns(frames.front().t_ns) + 3 * kSecond;
  for (can::StampedFrame& each : frames) {
    if (each.frame.id.value == 0x100U && each.t_ns >= stopped.ns()) {
      each.frame = test::speeds_frame(0.0, 300.0);
    }
  }
  const Played run = run_frames(test::vehicle_config(), frames);
  ASSERT_EQ(run.results.size(), 1U);
  const ExperimentResult& result = run.results[0];
  EXPECT_EQ(result.outcome, Outcome::kAborted);
  EXPECT_EQ(result.stop_reason, StopReason::kInputs);
  EXPECT_EQ(result.cause.role, Role::kPrimarySpeed);
  const std::string text = cause_text(result.stop_reason, result.cause);
  EXPECT_TRUE(text.starts_with("primary_speed: reads what gives no sample for 0.")) << text;
}

TEST(Pipeline, AShortGapDoesNotAbort) {
  auto frames = drive_frames({});
  const MonoTime from = MonoTime::of_ns(frames.front().t_ns) + 3 * kSecond;
  std::erase_if(frames, [&](const can::StampedFrame& each) {
    return each.t_ns >= from.ns() && each.t_ns < (from + 24 * kMillisecond).ns();
  });
  const Played run = run_frames(test::vehicle_config(), frames);
  ASSERT_EQ(run.results.size(), 1U);
  EXPECT_EQ(run.results[0].outcome, Outcome::kCompleted);
}

TEST(Pipeline, LinkDownAbortsWithReasonBus) {
  const Config config = test::vehicle_config();
  Pipeline pipeline(config);
  Outbox outbox;
  MonoTime t{};
  ExperimentResult result;
  for (const can::StampedFrame& each : drive_frames({})) {
    for (; t < MonoTime::of_ns(each.t_ns);
         t = (t == MonoTime{} ? MonoTime::of_ns(each.t_ns) : t + 5 * kMillisecond)) {
      if (t > MonoTime{3 * kSecond}) pipeline.on_bus_state(BusState::kDown, t);
      outbox.size = 0;
      const SampleReport& report = pipeline.on_sample(t, outbox);
      if (report.new_result) result = report.result;
    }
    pipeline.on_frame({.t = MonoTime::of_ns(each.t_ns), .frame = each.frame});
  }
  EXPECT_EQ(result.outcome, Outcome::kAborted);
  EXPECT_EQ(result.stop_reason, StopReason::kBus);
}

TEST(Pipeline, SignalTriggerRunsOneExperimentEachTime) {
  Drive drive;
  drive.active_from_ms = 500;
  drive.active_to_ms = 11'000;
  auto frames = drive_frames(drive);
  drive.start_ns += (12 * kSecond).ns();
  drive.active_from_ms = 1000;
  drive.active_to_ms = 2000;
  const auto second = drive_frames(drive);
  frames.insert(frames.end(), second.begin(), second.end());
  const Played run = run_frames(test::vehicle_config(signal_toml()), frames);
  ASSERT_EQ(run.results.size(), 2U);
  EXPECT_EQ(run.results[0].outcome, Outcome::kCompleted);
  const MonoTime start = MonoTime::of_ns(frames.front().t_ns);
  EXPECT_NEAR(static_cast<double>((run.results[0].start - start).ns()), 0.507e9, 6e6);
  EXPECT_EQ(run.results[1].outcome, Outcome::kInconclusive);
  EXPECT_EQ(run.results[1].stop_reason, StopReason::kNone);
  EXPECT_FALSE(run.results[1].stopped);

  // The flag falls when the first experiment is over, and nothing is one outside.
  for (const SampleReport& report : run.reports) {
    const double ms = static_cast<double>((report.t - start).ns()) / 1e6;
    if (ms < 500 || (ms > 11'070 && ms < 13'000)) {
      EXPECT_FALSE(report.in_experiment) << ms;
      EXPECT_FALSE(report.macro_slip_stop) << ms;
    }
  }
}

TEST(Pipeline, PeriodsAndCountersAndProtection) {
  Drive drive;
  drive.active_from_ms = 2000;
  drive.active_to_ms = 11'000;
  const Played run = run_frames(test::vehicle_config(signal_toml()), drive_frames(drive));
  std::map<std::uint32_t, std::vector<MonoTime>> times;
  std::map<std::uint32_t, std::uint8_t> counters;
  for (const auto& each : run.sent) {
    const std::uint32_t id = each.frame.id.value;
    ASSERT_TRUE(id == 0x6A0 || id == 0x6A1 || id == 0x6A3) << id;
    EXPECT_EQ(
        can::e2e::crc_profile1(static_cast<std::uint16_t>(id), each.frame.payload().subspan(1)),
        each.frame.data[0]);
    const auto counter = static_cast<std::uint8_t>(each.frame.data[1] & 15);
    if (counters.contains(id)) {
      EXPECT_EQ(counter, (counters[id] + 1) % 15);
    }
    counters[id] = counter;
    times[id].push_back(each.t);
  }
  std::map<std::uint32_t, int> longest_ms{{0x6A0, 100}, {0x6A1, 100}, {0x6A3, 1000}};
  for (const auto& [id, at] : times) {
    for (std::size_t i = 1; i < at.size(); ++i) {
      EXPECT_LE(at[i] - at[i - 1], longest_ms[id] * kMillisecond) << id << " " << at[i];
    }
  }
  // Slip every 10 ms in the experiment, every 100 ms outside.
  const MonoTime start = run.results.at(0).start;
  const auto& slip = times[0x6A1];
  for (std::size_t i = 1; i < slip.size(); ++i) {
    if (slip[i - 1] < start - 200 * kMillisecond) {
      EXPECT_EQ(slip[i] - slip[i - 1], 100 * kMillisecond);
    } else if (slip[i - 1] > start + 20 * kMillisecond && slip[i] < start + 8 * kSecond) {
      EXPECT_LE(slip[i] - slip[i - 1], 10 * kMillisecond);
    }
  }
}

TEST(Pipeline, StatusLeavesAtOnceOnAChangeOnly) {
  const Played run = run_frames(test::vehicle_config(), drive_frames({}));
  MonoTime last = MonoTime::of_ns(-1);
  std::uint64_t content = 0;
  const auto content_of = [](const can::CanFrame& frame) {
    std::uint64_t bits = 0;
    for (std::size_t i = 1; i < 8; ++i) bits = bits << 8 | frame.data[i];
    return bits & ~(std::uint64_t{0x0F} << 48);  // without the counter
  };
  for (const auto& each : of_id(run, 0x6A3)) {
    const std::uint64_t now = content_of(each.frame);
    if (last >= MonoTime{} && now == content && each.t != run.sent.back().t) {
      EXPECT_EQ(each.t - last, kSecond);
    }
    last = each.t;
    content = now;
  }
}

TEST(Pipeline, TheSameFramesGiveTheSameBytes) {
  const Config config = test::vehicle_config();
  const Played first = run_frames(config, drive_frames({}));
  const Played second = run_frames(config, drive_frames({}));
  ASSERT_GT(first.sent.size(), 1000U);
  EXPECT_TRUE(first.sent == second.sent);
}

// A loop that wakes late decides what a punctual one would have: the same bytes, if later.
TEST(Pipeline, ALateLoopSendsTheSameBytes) {
  class LatePort final : public Port {
   public:
    explicit LatePort(std::vector<can::StampedFrame> frames) : inner_(std::move(frames)) {}
    MonoTime now() noexcept override { return inner_.now(); }
    Wake wait_until(MonoTime deadline) noexcept override {
      // Every 100th wait is 30 ms late, and finds what came meanwhile.
      late_ = ++waits_ % 100 == 0 ? 30 * kMillisecond : Duration{};
      return inner_.wait_until(deadline + late_);
    }
    std::size_t receive(std::span<RxFrame> out) noexcept override { return inner_.receive(out); }
    SendResult send(const can::CanFrame& frame) noexcept override {
      bytes.push_back(frame);
      return SendResult::kSent;
    }
    BusState bus_state() noexcept override { return BusState::kActive; }
    std::vector<can::CanFrame> bytes;

   private:
    test::FramePlayer inner_;
    int waits_ = 0;
    Duration late_{};
  };
  const Config config = test::vehicle_config();
  const Played punctual = run_frames(config, drive_frames({}));
  LatePort port(drive_frames({}));
  test::ReportKeeper keeper;
  Pipeline pipeline(config);
  const LoopCounters counters = run_loop(port, pipeline, 200.0, StopReason::kTraceEnd, &keeper);
  EXPECT_GT(counters.samples_late, 10U);
  ASSERT_EQ(keeper.results.size(), 1U);
  EXPECT_EQ(keeper.results[0].end, punctual.results[0].end);
  EXPECT_EQ(keeper.results[0].peak.mu_max, punctual.results[0].peak.mu_max);
  // Estimate and slip frames; the status tells of the lateness.
  const auto without_status = [](std::vector<can::CanFrame> frames) {
    std::erase_if(frames, [](const can::CanFrame& frame) { return frame.id.value == 0x6A3; });
    return frames;
  };
  std::vector<can::CanFrame> punctual_bytes;
  for (const auto& each : punctual.sent) punctual_bytes.push_back(each.frame);
  EXPECT_TRUE(without_status(punctual_bytes) == without_status(port.bytes));
}

TEST(Pipeline, SamplesThatAreLostAbortAndTheLoopGoesOn) {
  class SleepyPort final : public Port {
   public:
    MonoTime now() noexcept override { return now_; }
    Wake wait_until(MonoTime deadline) noexcept override {
      if (++waits_ > 100) return Wake::kClosed;
      now_ = deadline + (waits_ == 50 ? 10 * kSecond : Duration{});
      return Wake::kDeadline;
    }
    std::size_t receive(std::span<RxFrame>) noexcept override { return 0; }
    SendResult send(const can::CanFrame&) noexcept override {
      ++sent;
      return SendResult::kSent;
    }
    BusState bus_state() noexcept override { return BusState::kActive; }
    int sent = 0;

   private:
    int waits_ = 0;
    MonoTime now_{};
  };
  SleepyPort port;
  test::ReportKeeper keeper;
  Pipeline pipeline(test::vehicle_config());
  const LoopCounters counters = run_loop(port, pipeline, 200.0, StopReason::kShutdown, &keeper);
  EXPECT_EQ(counters.samples_late, 2000U);  // 10 s of samples
  EXPECT_EQ(keeper.reports.size(), 101U);   // no burst to catch up
  EXPECT_LT(port.sent, 60);
  for (std::size_t i = 1; i + 1 < keeper.reports.size(); ++i) {
    EXPECT_GT(keeper.reports[i].t, keeper.reports[i - 1].t);
  }
}

TEST(Pipeline, APortThatAnnouncesFramesItHasNotDoesNotStopTheSamples) {
  class EmptyPort final : public Port {
   public:
    MonoTime now() noexcept override { return now_; }
    Wake wait_until(MonoTime) noexcept override {
      now_ += kMillisecond;
      return ++waits_ > 1000 ? Wake::kClosed : Wake::kFrames;
    }
    std::size_t receive(std::span<RxFrame>) noexcept override { return 0; }
    SendResult send(const can::CanFrame&) noexcept override { return SendResult::kSent; }
    BusState bus_state() noexcept override { return BusState::kActive; }

   private:
    int waits_ = 0;
    MonoTime now_{};
  };
  EmptyPort port;
  test::ReportKeeper keeper;
  Pipeline pipeline(test::vehicle_config());
  run_loop(port, pipeline, 200.0, StopReason::kShutdown, &keeper);
  EXPECT_NEAR(static_cast<double>(keeper.reports.size()), 202.0, 2.0);
}

TEST(Pipeline, OwnIdentifiersAreNoInputAndAForeignSenderIsAFaultForTenSeconds) {
  const Config config = test::vehicle_config();
  Pipeline pipeline(config);
  Outbox outbox;
  can::CanFrame own;
  own.id = {0x6A1, false};
  own.length = 8;
  pipeline.on_frame({.t = MonoTime::of_ns(1), .frame = own, .own_echo = true});
  EXPECT_EQ(pipeline.on_sample(MonoTime::of_ns(5), outbox).faults, 0U);
  can::CanFrame extended = own;
  extended.id.extended = true;
  pipeline.on_frame({.t = MonoTime::of_ns(6), .frame = extended});
  outbox.size = 0;
  EXPECT_EQ(pipeline.on_sample(MonoTime::of_ns(10), outbox).faults, 0U);
  pipeline.on_frame({.t = MonoTime::of_ns(11), .frame = own});
  outbox.size = 0;
  EXPECT_EQ(pipeline.on_sample(MonoTime::of_ns(15), outbox).faults,
            fault_bit(Fault::kForeignSender));
  for (MonoTime t{kSecond}; t < MonoTime{20 * kSecond}; t += kSecond) {
    outbox.size = 0;
    const SampleReport& report = pipeline.on_sample(t, outbox);
    EXPECT_EQ((report.faults & fault_bit(Fault::kForeignSender)) != 0, t <= MonoTime{10 * kSecond})
        << t;
    EXPECT_EQ(report.foreign_identifier, 0x6A1U);
  }
  EXPECT_EQ(pipeline.counters().frames, 3U);
  EXPECT_EQ(pipeline.counters().frames_decoded, 0U);
}

TEST(Pipeline, NoFrameOfTheWholeStandardSpaceUpsetsIt) {
  Pipeline pipeline(test::vehicle_config());
  Outbox outbox;
  MonoTime t{};
  for (std::uint32_t id = 0; id <= 0x7FF; ++id) {
    for (std::uint8_t length = 0; length <= 8; ++length) {
      can::CanFrame frame;
      frame.id = {id, false};
      frame.length = length;
      frame.data.fill(0xFF);
      pipeline.on_frame({.t = t += kNanosecond, .frame = frame});
    }
  }
  EXPECT_EQ(pipeline.counters().frames, 2048U * 9U);
  EXPECT_EQ(pipeline.counters().frames_decoded, 3U);  // 0x100, 0x101, 0x103 with their lengths
  EXPECT_EQ(pipeline.counters().frames_bad, 3U * 8U);
  EXPECT_FALSE(pipeline.on_sample(t, outbox).sample.usable);
}

}  // namespace
}  // namespace beltgrip::daemon
