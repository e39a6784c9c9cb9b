// Periods and at-once rules over sample rates that divide them and that do not.
#include "daemon/core/publish/publisher.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace beltgrip::daemon {
namespace {

constexpr Duration kFive = 5 * kMillisecond;

std::size_t count_of(const Outbox& outbox, std::uint32_t id) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < outbox.size; ++i) count += outbox.frames[i].id.value == id ? 1 : 0;
  return count;
}

struct Bench {
  explicit Bench(Duration period = kFive) : publisher(FrameIdentifiers{}, period) {}
  Outbox at(MonoTime t) {
    Outbox outbox;
    publisher.collect(t, now, outbox);
    now.new_result = false;
    return outbox;
  }
  Publisher publisher;
  Publication now;
};

TEST(Publisher, TheFirstSampleSendsEverythingButClamp) {
  Bench bench;
  const Outbox outbox = bench.at(MonoTime{});
  EXPECT_EQ(outbox.size, 3U);
  EXPECT_EQ(count_of(outbox, 0x6A0), 1U);
  EXPECT_EQ(count_of(outbox, 0x6A1), 1U);
  EXPECT_EQ(count_of(outbox, 0x6A3), 1U);
}

TEST(Publisher, PeriodsAtManySampleRates) {
  for (const double rate_hz : {100.0, 125.0, 143.0, 200.0, 300.0, 333.0, 500.0, 1000.0}) {
    for (const bool experiment : {false, true}) {
      const auto period = period_of(rate_hz);
      Bench bench(period);
      bench.now.in_experiment = experiment;
      std::size_t slip = 0, status = 0, estimate = 0;
      MonoTime last_slip = MonoTime::of_ns(-1);
      const Duration wanted = (experiment ? 10 : 100) * kMillisecond;
      for (MonoTime t{}; t < MonoTime{10 * kSecond}; t += period) {
        const Outbox outbox = bench.at(t);
        estimate += count_of(outbox, 0x6A0);
        status += count_of(outbox, 0x6A3);
        if (count_of(outbox, 0x6A1) == 0) continue;
        if (last_slip >= MonoTime{}) {
          EXPECT_LE(std::abs((t - last_slip - wanted).ns()), period.ns()) << rate_hz;
        }
        last_slip = t;
        ++slip;
      }
      EXPECT_NEAR(static_cast<double>(slip), experiment ? 1000.0 : 100.0, experiment ? 2.0 : 1.0)
          << rate_hz;
      EXPECT_NEAR(static_cast<double>(estimate), 100.0, 1.0) << rate_hz;
      EXPECT_NEAR(static_cast<double>(status), 10.0, 1.0) << rate_hz;
    }
  }
}

TEST(Publisher, SlipLeavesAtOnceWhenTheStopFlagChanges) {
  Bench bench;
  for (MonoTime t{}; t <= MonoTime{100 * kMillisecond}; t += kFive) bench.at(t);
  bench.now.slip.macro_slip_stop = true;
  EXPECT_EQ(count_of(bench.at(MonoTime{105 * kMillisecond}), 0x6A1), 1U);
  EXPECT_EQ(count_of(bench.at(MonoTime{110 * kMillisecond}), 0x6A1), 0U);
  bench.now.slip.macro_slip_stop = false;
  EXPECT_EQ(count_of(bench.at(MonoTime{115 * kMillisecond}), 0x6A1), 1U);
}

TEST(Publisher, EstimateLeavesAtOnceOnANewResultAndRestartsItsPeriod) {
  Bench bench;
  for (MonoTime t{}; t <= MonoTime{100 * kMillisecond}; t += kFive) bench.at(t);
  bench.now.new_result = true;
  EXPECT_EQ(count_of(bench.at(MonoTime{135 * kMillisecond}), 0x6A0), 1U);
  for (MonoTime t{140 * kMillisecond}; t < MonoTime{235 * kMillisecond}; t += kFive) {
    EXPECT_EQ(count_of(bench.at(t), 0x6A0), 0U) << t;
  }
  EXPECT_EQ(count_of(bench.at(MonoTime{235 * kMillisecond}), 0x6A0), 1U);
}

TEST(Publisher, StatusLeavesAtOnceOnEachKindOfChange) {
  Bench bench;
  MonoTime t{};
  bench.at(t);
  const auto changed = [&] { return count_of(bench.at(t += kFive), 0x6A3) == 1; };
  EXPECT_FALSE(changed());
  bench.now.status.state = State::kRamping;
  EXPECT_TRUE(changed());
  EXPECT_FALSE(changed());
  bench.now.status.outcome = Outcome::kAborted;
  EXPECT_TRUE(changed());
  bench.now.status.stop_reason = estimator::StopReason::kBus;
  EXPECT_TRUE(changed());
  bench.now.status.faults = 1;
  EXPECT_TRUE(changed());
  EXPECT_FALSE(changed());
}

TEST(Publisher, TheShortPeriodBeginsWithTheExperiment) {
  Bench bench;
  for (MonoTime t{}; t <= MonoTime{120 * kMillisecond}; t += kFive) bench.at(t);
  bench.now.in_experiment = true;
  MonoTime last{};
  for (MonoTime t{125 * kMillisecond}; t <= MonoTime{165 * kMillisecond}; t += kFive) {
    if (count_of(bench.at(t), 0x6A1) == 0) continue;
    if (last == MonoTime{}) {
      EXPECT_LE(t, MonoTime{135 * kMillisecond});
    } else {
      EXPECT_EQ(t - last, 10 * kMillisecond);
    }
    last = t;
  }
  EXPECT_GE(last, MonoTime{155 * kMillisecond});
}

TEST(Publisher, MissedSamplesAreNotCaughtUp) {
  Bench bench;
  bench.at(MonoTime{});
  EXPECT_EQ(bench.at(MonoTime{10 * kSecond}).size, 3U);
  EXPECT_EQ(bench.at(MonoTime{10 * kSecond + kFive}).size, 0U);
}

TEST(Publisher, CountersRunFromZeroToFourteenEachForItself) {
  Bench bench;
  std::vector<std::uint8_t> counters;
  for (MonoTime t{}; counters.size() < 40; t += 100 * kMillisecond) {
    const Outbox outbox = bench.at(t);
    for (std::size_t i = 0; i < outbox.size; ++i) {
      if (outbox.frames[i].id.value != 0x6A1) continue;
      counters.push_back(static_cast<std::uint8_t>(outbox.frames[i].data[1] & 15));
    }
  }
  for (std::size_t i = 0; i < counters.size(); ++i) EXPECT_EQ(counters[i], i % 15);
}

TEST(Publisher, TheEndSendsEverythingOnceMore) {
  Bench bench;
  bench.at(MonoTime{});
  Outbox outbox;
  bench.publisher.collect_all(MonoTime{kFive}, bench.now, outbox);
  EXPECT_EQ(outbox.size, 3U);
}

TEST(Publisher, ClampFramesWithControlCommandOnly) {
  Bench bench;
  bench.now.command = true;
  const auto run = [&](MonoTime& t, Duration duration) {
    std::size_t count = 0;
    for (const MonoTime end = t + duration; t < end; t += kFive) {
      count += count_of(bench.at(t), 0x6A2);
    }
    return count;
  };
  MonoTime t{};
  EXPECT_EQ(run(t, kSecond), 5U);  // at start
  bench.now.clamp = {true, 3000.0};
  EXPECT_EQ(count_of(bench.at(t), 0x6A2), 1U);  // at once
  t += kFive;
  EXPECT_EQ(run(t, kSecond), 100U);
  bench.now.clamp = {};
  EXPECT_EQ(count_of(bench.at(t), 0x6A2), 1U);
  t += kFive;
  EXPECT_EQ(run(t, kSecond), 4U);
  Outbox last;
  bench.publisher.collect_all(t, bench.now, last);
  EXPECT_EQ(count_of(last, 0x6A2), 5U);
  EXPECT_EQ(last.frames[0].id.value, 0x6A2U);  // before everything else
  EXPECT_EQ(last.size, 8U);
}

TEST(Publisher, AnotherGoesOnWhereOneEnded) {
  Bench bench(4 * kMillisecond);
  bench.now.command = bench.now.in_experiment = true;
  bench.now.clamp = {true, 3000.0};
  bench.now.slip.macro_slip_stop = true;
  bench.now.status.outcome = Outcome::kAborted;
  std::uint8_t counter = 0;
  for (MonoTime t{}; t <= MonoTime{20 * kMillisecond}; t += 4 * kMillisecond) {
    const Outbox outbox = bench.at(t);
    if (count_of(outbox, 0x6A2) > 0) counter = outbox.frames[0].data[1] & 15;
  }
  Bench next(4 * kMillisecond);
  next.now = bench.now;
  next.publisher.go_on_from(bench.publisher);
  // Nothing is due, nothing has changed, nothing begins.
  EXPECT_EQ(next.at(MonoTime{24 * kMillisecond}).size, 0U);
  const Outbox outbox = next.at(MonoTime{28 * kMillisecond});
  EXPECT_EQ(outbox.size, 2U);  // clamp and slip
  EXPECT_EQ(outbox.frames[0].id.value, 0x6A2U);
  EXPECT_EQ(outbox.frames[0].data[1] & 15, counter + 1);
}

TEST(Publisher, HalfASampleBeforeItsInstantIsTheNearestSample) {
  Bench bench(4 * kMillisecond);
  bench.now.in_experiment = true;
  bench.at(MonoTime{});
  EXPECT_EQ(count_of(bench.at(MonoTime{4 * kMillisecond}), 0x6A1), 0U);
  EXPECT_EQ(count_of(bench.at(MonoTime{8 * kMillisecond}), 0x6A1), 1U);
}

TEST(Publisher, ASampleAtTheNextInstantButOneIsNotCaughtUpEither) {
  Bench bench;
  bench.now.in_experiment = true;
  bench.at(MonoTime{});
  EXPECT_EQ(count_of(bench.at(MonoTime{20 * kMillisecond}), 0x6A1), 1U);
  EXPECT_EQ(count_of(bench.at(MonoTime{25 * kMillisecond}), 0x6A1), 0U);
}

TEST(Publisher, WhileARequestStandsTheInactiveFramesAreNotTold) {
  Bench bench;
  bench.now.command = true;
  for (MonoTime t{}; t < MonoTime{kSecond}; t += kFive) bench.at(t);
  EXPECT_TRUE(bench.publisher.inactive_sent());
  bench.now.clamp = {true, 3000.0};
  for (MonoTime t{kSecond}; t < MonoTime{2 * kSecond}; t += kFive) {
    bench.at(t);
    ASSERT_FALSE(bench.publisher.inactive_sent()) << t;
  }
}

TEST(Publisher, TheEndTakesBackARequestThatStands) {
  Bench bench;
  bench.now.command = true;
  bench.now.clamp = {true, 3000.0};
  bench.at(MonoTime{});
  Outbox last;
  bench.publisher.collect_all(MonoTime{kFive}, bench.now, last);
  EXPECT_EQ(count_of(last, 0x6A2), 5U);
  const OwnFrames frames{FrameIdentifiers{}};
  for (std::size_t i = 0; i < 5; ++i) {
    const auto counter = static_cast<std::uint8_t>(last.frames[i].data[1] & 15);
    EXPECT_EQ(last.frames[i].data, frames.pack(ClampValues{}, counter).data) << i;
  }
  // All are told: no more leave.
  bench.now.clamp = {};
  EXPECT_EQ(count_of(bench.at(MonoTime{kSecond}), 0x6A2), 0U);
}

}  // namespace
}  // namespace beltgrip::daemon
