// The flight recorder: what it keeps is decided again byte by byte, however rough the run was; it
// keeps the seconds around what matters, stays within its folder's size, and a disk that is full,
// slow or not there is one line in the log.
#include "daemon/io/flight_recorder.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <random>
#include <tuple>

#include "daemon/core/loop/loop.h"
#include "tests/daemon/frame_player.h"
#include "tests/daemon/test_vehicle.h"
#include "tools/ports/record_port.h"

namespace beltgrip::daemon {
namespace {

namespace fs = std::filesystem;

// A machine and a bus that do whatever they can: samples come late or are lost, frames come after
// the sample that they belong to, the kernel drops some, sends fail, the links go down, own frames
// are confirmed or not. The same for a seed.
class RoughPort final : public Port {
 public:
  RoughPort(std::vector<can::StampedFrame> frames, std::uint32_t seed) : random_(seed) {
    now_ = MonoTime::of_ns(frames.front().t_ns);
    for (const can::StampedFrame& each : frames)
      queue_.emplace(MonoTime::of_ns(each.t_ns), RxFrame{});
    auto place = queue_.begin();
    for (const can::StampedFrame& each : frames) {
      place->second.t = MonoTime::of_ns(each.t_ns);
      place->second.frame = each.frame;
      place->second.bus = each.bus;
      buses_ = std::max(buses_, std::size_t{each.bus} + 1);
      ++place;
    }
    // What comes to the program later than its stamp says.
    for (auto each = queue_.begin(); each != queue_.end();) {
      auto node = queue_.extract(each++);
      if (chance(0.01)) node.key() += 3 * kMillisecond + kNanosecond;
      if (chance(0.002)) node.mapped().dropped_before = 3;
      later_.insert(std::move(node));
    }
    queue_.swap(later_);
  }

  MonoTime now() noexcept override { return now_; }
  Wake wait_until(MonoTime deadline) noexcept override {
    if (queue_.empty()) return Wake::kClosed;
    if (queue_.begin()->first <= std::max(deadline, now_)) {
      now_ = std::max(now_, queue_.begin()->first);
      return Wake::kFrames;
    }
    now_ = std::max(now_, deadline + 50 * kMicrosecond);
    if (chance(0.01)) now_ += random_() % 20 * kMillisecond;
    if (chance(0.001)) now_ += 80 * kMillisecond;
    for (std::size_t i = 0; i < buses_; ++i) {
      if (!chance(0.003)) continue;
      states_[i] = states_[i] == BusState::kActive ? BusState::kDown : BusState::kActive;
    }
    return Wake::kDeadline;
  }
  std::size_t receive(std::span<RxFrame> out) noexcept override {
    std::size_t count = 0;
    while (count < out.size() && !queue_.empty() && queue_.begin()->first <= now_) {
      out[count++] = queue_.begin()->second;
      queue_.erase(queue_.begin());
    }
    return count;
  }
  SendResult send(const can::CanFrame& frame) noexcept override { return send_on(0, frame); }
  SendResult send_on(std::uint8_t bus, const can::CanFrame& frame) noexcept override {
    if (chance(0.01)) return chance(0.5) ? SendResult::kFull : SendResult::kDown;
    sent.push_back({now_, frame, bus});
    if (!chance(0.05))
      queue_.emplace(now_ + 100 * kMicrosecond,
                     RxFrame{now_ + 90 * kMicrosecond, frame, true, 0, bus});
    return SendResult::kSent;
  }
  BusState bus_state() noexcept override { return states_[0]; }
  BusState bus_state_of(std::uint8_t bus) noexcept override { return states_[bus]; }

  std::vector<test::SentFrame> sent;

 private:
  bool chance(double share) { return std::uniform_real_distribution<double>()(random_) < share; }

  std::mt19937 random_;
  std::multimap<MonoTime, RxFrame> queue_, later_;  // by when it comes
  MonoTime now_{};
  std::size_t buses_ = 1;
  std::array<BusState, kBusMax> states_{};  // kActive
};

class Recorded : public testing::Test {
 protected:
  std::vector<fs::path> files() const {
    std::vector<fs::path> found;
    for (const auto& each : fs::directory_iterator(folder())) found.push_back(each.path());
    std::sort(found.begin(), found.end());
    return found;
  }
  std::string folder() const { return directory_.path() + "/record"; }

  test::TemporaryDirectory directory_;
};

// All that a sample decided, without padding.
std::string bytes(const SampleReport& report) {
  std::string text;
  const auto add = [&](const auto& value) {
    text.append(reinterpret_cast<const char*>(&value), sizeof value);
  };
  add(report.state);
  add(report.in_experiment);
  add(report.macro_slip_stop);
  add(report.stop_reason);
  add(report.faults);
  add(report.inhibits);
  add(report.sample.omega_p_rad_s);
  add(report.sample.omega_s_rad_s);
  add(report.curve.mu_star);
  add(report.curve.sigma_star_percent);
  add(report.curve.friction_slope);
  add(report.result.outcome);
  add(report.result.peak.mu_max);
  add(report.result.peak.mu_max_std);
  return text;
}

class Rough : public Recorded,
              public testing::WithParamInterface<std::tuple<std::uint32_t, bool>> {};

TEST_P(Rough, RunIsDecidedAgainByteByByte) {
  const auto [seed, two_buses] = GetParam();
  const Config config =
      test::vehicle_config(two_buses ? test::two_bus_toml() : test::signalled_toml());
  const std::vector<std::string> interfaces =
      two_buses ? std::vector<std::string>{"can0", "can1"} : std::vector<std::string>{"can0"};
  test::Drive drive;
  drive.active_from_ms = 1000;
  drive.active_to_ms = 9500;
  constexpr std::int64_t kWallOffset_ns = 1'700'000'000'123'456'789;
  RoughPort live(two_buses ? test::two_bus_frames(drive) : test::drive_frames(drive), seed);
  test::ReportKeeper reports;
  estimator::LearnedFriction learned;
  learned.groups[0].known = true;
  learned.groups[0].mu_max = 0.1 + 1e-17;
  learned.groups[0].ci95_low = 0.09 + 1e-17;
  learned.groups[0].repeatability_percent = 1.0 / 3.0;
  LoopCounters counters;
  {
    RecordRings rings;
    RecordTap tap(rings);
    Pipeline pipeline(config);
    tap.learned(live.now(), learned);
    pipeline.learn(learned);
    RecordLimits limits;
    limits.before = 60 * kSecond;
    limits.after = 60 * kSecond;
    FlightRecorder recorder(folder(), interfaces, rings, kWallOffset_ns, limits);
    counters = run_loop(live, pipeline, config.estimator.sample_rate_hz,
                        estimator::StopReason::kShutdown, &reports, nullptr, &tap);
    recorder.stop();
    EXPECT_EQ(rings.items.dropped(), 0U);
    const auto messages = recorder.take_messages();
    ASSERT_EQ(messages.size(), 1U);
    EXPECT_FALSE(messages[0].warning) << messages[0].line;
  }
  EXPECT_GT(counters.samples_late, 5U) << "it was not rough";
  EXPECT_GT(counters.sends_failed, 2U);
  ASSERT_EQ(files().size(), 1U);
  const std::string path = files()[0].string();
  ASSERT_EQ(ports::RecordPort::version_of(path), ports::RecordPort::kVersion);

  std::vector<test::SentFrame> sent;
  Pipeline again(config);
  ports::RecordPort port(
      path,
      [&](MonoTime t, const can::CanFrame& frame, std::uint8_t bus) {
        sent.push_back({t, frame, bus});
      },
      [&](const ports::RecordedKnowledge& known) {
        estimator::LearnedFriction told;
        told.groups[0].known = true;
        told.groups[0].mu_max = known.groups[0].mu_max;
        told.groups[0].ci95_low = known.groups[0].low;
        told.groups[0].repeatability_percent = known.groups[0].scatter_percent;
        EXPECT_EQ(known.groups[0].low, learned.groups[0].ci95_low);
        EXPECT_EQ(known.groups[0].scatter_percent, learned.groups[0].repeatability_percent);
        EXPECT_EQ(known.groups[1].mu_max, 0.0);
        again.learn(told);
      });
  EXPECT_TRUE(port.ends_with_the_daemon());
  test::ReportKeeper replayed;
  run_loop(port, again, config.estimator.sample_rate_hz, estimator::StopReason::kShutdown,
           &replayed);
  EXPECT_EQ(port.stats().lines_bad, 0U);
  ASSERT_EQ(replayed.reports.size(), reports.reports.size());
  for (std::size_t i = 0; i < reports.reports.size(); ++i) {
    ASSERT_EQ(replayed.reports[i].t - Duration::of_ns(kWallOffset_ns), reports.reports[i].t) << i;
    ASSERT_EQ(bytes(replayed.reports[i]), bytes(reports.reports[i])) << i;
  }
  ASSERT_EQ(sent.size(), live.sent.size());
  for (std::size_t i = 0; i < sent.size(); ++i) {
    ASSERT_EQ(sent[i].frame, live.sent[i].frame) << i;
    ASSERT_EQ(sent[i].bus, live.sent[i].bus) << i;
  }
  EXPECT_EQ(std::any_of(sent.begin(), sent.end(), [](const auto& each) { return each.bus == 1; }),
            two_buses);
}

INSTANTIATE_TEST_SUITE_P(, Rough, testing::Combine(testing::Range(1U, 9U), testing::Bool()));

// Seconds of frames, and a fault from `fault_s` on, through the rings.
void feed(RecordRings& rings, double seconds, double fault_s, double experiment_s = -1.0,
          MonoTime start = MonoTime{kSecond}) {
  RecordTap tap(rings);
  tap.start(start);
  SampleReport report;
  std::mt19937 random(1);
  for (int i = 0; i < static_cast<int>(seconds * 200); ++i) {
    const double t_s = i / 200.0;
    report.t = start + i * 5 * kMillisecond;
    report.faults = fault_s >= 0 && t_s >= fault_s ? fault_bit(Fault::kInputStale) : 0;
    report.in_experiment = experiment_s >= 0 && t_s >= experiment_s && t_s < experiment_s + 1;
    RxFrame frame;
    frame.t = report.t;
    frame.frame.id = {0x100, false};
    frame.frame.length = 8;
    for (std::uint8_t& each : frame.frame.data) each = static_cast<std::uint8_t>(random());
    tap.frame(frame);
    tap.sampled(report);
  }
}

// First and last stamp of a record's frames in s after its beginning of time here.
std::pair<double, double> span_of(const fs::path& path) {
  const auto log = can::LogReader::open(path.string());
  can::LogRecord record;
  std::pair<double, double> span{-1, -1};
  while (log->next(record)) {
    const double t_s = static_cast<double>(record.t_ns - kSecond.ns()) * 1e-9;
    if (span.first < 0) span.first = t_s;
    span.second = t_s;
  }
  EXPECT_EQ(log->stats().lines_bad, 0U);
  return span;
}

TEST_F(Recorded, TheSecondsAroundAnExperimentAndAFault) {
  RecordLimits limits;
  limits.before = 2 * kSecond;
  limits.after = 3 * kSecond;
  RecordRings rings;
  feed(rings, 20, 15, 5);
  FlightRecorder recorder(folder(), {"can0"}, rings, 0, limits);
  recorder.stop();
  ASSERT_EQ(files().size(), 2U);
  const auto first = span_of(files()[0]);
  EXPECT_NEAR(first.first, 3.0, 0.6);  // from a mark on, which come every half second
  EXPECT_LE(first.first, 3.5);
  EXPECT_NEAR(first.second, 9.0, 0.1);
  const auto second = span_of(files()[1]);
  EXPECT_NEAR(second.first, 13.0, 0.6);
  EXPECT_NEAR(second.second, 18.0, 0.1);
}

TEST_F(Recorded, NothingWhileNothingHappens) {
  RecordRings rings;
  feed(rings, 20, -1);
  FlightRecorder recorder(folder(), {"can0"}, rings, 0);
  recorder.stop();
  EXPECT_FALSE(fs::exists(folder()));
  EXPECT_TRUE(recorder.take_messages().empty());
}

TEST_F(Recorded, TheFolderStaysWithinItsSizeAndTheOldestGo) {
  RecordLimits limits;
  limits.file_bytes = 2000;
  limits.folder_bytes = 24000;
  limits.after = 3600 * kSecond;
  fs::create_directories(folder());
  const std::string foreign = folder() + "/beltgrip-can1-20200101T000000.000Z.log.zst";
  std::ofstream(foreign) << std::string(50000, 'x');
  RecordRings rings;
  FlightRecorder recorder(folder(), {"can0"}, rings, 0, limits);
  std::size_t named = 0;
  std::string oldest;
  for (int round = 0; round < 3; ++round) {
    // All three fit into the ring, however late the recorder's thread comes to it.
    feed(rings, 13, 0, -1, MonoTime{(1 + 40 * round) * kSecond});
    while (named < static_cast<std::size_t>(round + 1) * 2) {
      for (const auto& message : recorder.take_messages()) {
        EXPECT_FALSE(message.warning) << message.line;
        if (oldest.empty()) oldest = message.line.substr(message.line.find('/'));
        ++named;
      }
    }
  }
  recorder.stop();
  std::uintmax_t sum = 0;
  for (const fs::path& each : files()) {
    if (each != foreign) sum += fs::file_size(each);
  }
  EXPECT_GT(sum, 20000U);
  EXPECT_LE(sum, limits.folder_bytes + 20000) << "what is packed together counts late";
  EXPECT_FALSE(fs::exists(oldest)) << oldest;
  EXPECT_TRUE(fs::exists(foreign)) << "another daemon's";
}

TEST_F(Recorded, AFolderThatCannotBeMadeIsOneWarning) {
  std::ofstream(directory_.path() + "/record") << "a file";
  RecordRings rings;
  feed(rings, 20, 2);
  FlightRecorder recorder(folder(), {"can0"}, rings, 0);
  recorder.stop();
  const auto messages = recorder.take_messages();
  ASSERT_EQ(messages.size(), 1U);
  EXPECT_TRUE(messages[0].warning);
  EXPECT_NE(messages[0].line.find("next attempt in a minute"), std::string::npos)
      << messages[0].line;
}

// The system's limit on the size of a file stands for a disk that is full.
TEST_F(Recorded, ADiskThatIsFullIsOneWarningUntilItIsNot) {
  std::signal(SIGXFSZ, SIG_IGN);
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  rlimit small = before;
  small.rlim_cur = 2000;
  RecordRings rings;
  std::vector<FlightRecorder::Message> messages;
  FlightRecorder recorder(folder(), {"can0"}, rings, 0);
  const auto wait_for = [&](std::size_t count) {
    while (messages.size() < count) {
      for (auto& each : recorder.take_messages()) messages.push_back(std::move(each));
    }
  };
  setrlimit(RLIMIT_FSIZE, &small);
  feed(rings, 20, 2);
  wait_for(2);  // where to, and that it cannot be
  setrlimit(RLIMIT_FSIZE, &before);
  EXPECT_FALSE(messages[0].warning);
  EXPECT_TRUE(messages[1].warning);
  EXPECT_NE(messages[1].line.find("cannot be written ("), std::string::npos) << messages[1].line;
  // A minute later on the loop's clock.
  RecordTap tap(rings);
  SampleReport report;
  report.t = MonoTime{100 * kSecond};
  report.in_experiment = true;
  tap.sampled(report);
  report.t += kSecond;
  report.in_experiment = false;
  tap.sampled(report);
  report.t += 20 * kSecond;
  report.faults = 1;
  tap.sampled(report);
  wait_for(3);
  recorder.stop();
  for (auto& each : recorder.take_messages()) messages.push_back(std::move(each));
  EXPECT_TRUE(std::any_of(messages.begin(), messages.end(), [](const auto& each) {
    return each.line.find("recorded again") != std::string::npos;
  }));
  EXPECT_EQ(std::count_if(messages.begin(), messages.end(), [](auto& m) { return m.warning; }), 1);
}

TEST_F(Recorded, WhatDoesNotFitIntoTheRingIsCountedAndNothingWaits) {
  RecordRings rings;
  feed(rings, 60, 0);  // 12,000 frames, and nobody takes them
  EXPECT_GT(rings.items.dropped(), 3000U);
  FlightRecorder recorder(folder(), {"can0"}, rings, 0);
  recorder.stop();
  const auto messages = recorder.take_messages();
  EXPECT_TRUE(std::any_of(messages.begin(), messages.end(), [&](const auto& each) {
    return each.warning && each.line.find(std::to_string(rings.items.dropped()) +
                                          " frames not recorded") != std::string::npos;
  }));
}

}  // namespace
}  // namespace beltgrip::daemon
