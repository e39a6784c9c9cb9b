// Rate, counter and CRC of an input message: rows E6, E7, E8, E11 and E12 of the fault catalogue,
// and every sequence of six kinds of frames against a model written anew.
#include "daemon/core/input/frame_guard.h"

#include <gtest/gtest.h>

#include <vector>

#include "daemon/core/input/input_monitor.h"

namespace beltgrip::daemon {
namespace {

constexpr std::uint16_t kDataId = 0x120;

can::SignalDef counter_def() {
  can::SignalDef signal;
  signal.start_bit = 8;
  signal.length = 4;
  return signal;
}

MessageProtection protection() {
  return {{0x120, false},
          CounterProtection{can::SignalCodec(counter_def()), 15},
          CrcProtection{0, kDataId}};
}

// CRC-8 bit by bit, over data id and all bytes but the first.
can::CanFrame frame_of(unsigned counter, std::uint8_t data = 0, std::uint16_t data_id = kDataId) {
  can::CanFrame frame;
  frame.id = {0x120, false};
  frame.length = 8;
  frame.data[1] = static_cast<std::uint8_t>(counter & 15U);
  frame.data[4] = data;
  unsigned crc = 0;
  const auto add = [&crc](unsigned byte) {
    crc ^= byte;
    for (int bit = 0; bit < 8; ++bit) crc = (crc & 0x80U) != 0 ? crc << 1 ^ 0x11DU : crc << 1;
  };
  add(data_id & 0xFFU);
  add(data_id >> 8U);
  for (std::size_t i = 1; i < 8; ++i) add(frame.data[i]);
  frame.data[0] = static_cast<std::uint8_t>(crc);
  return frame;
}

struct Bench {
  MessageProtection given = protection();
  FrameGuard guard{std::nullopt, &given};
  unsigned counter = 0;
  bool good() { return guard.admit(frame_of(++counter)); }
};

TEST(FrameGuard, WithoutProtectionEverythingPasses) {
  FrameGuard guard;
  for (int i = 0; i < 20; ++i) EXPECT_TRUE(guard.admit(frame_of(7)));
  EXPECT_FALSE(guard.invalid());
}

TEST(FrameGuard, RunsOverTheEndOfTheCounterAndBearsTwoLostFrames) {
  Bench bench;
  for (int i = 0; i < 40; ++i) {
    EXPECT_TRUE(bench.good());
    if (i % 3 == 0) bench.counter += 2;
  }
  EXPECT_FALSE(bench.guard.invalid());
}

TEST(FrameGuard, E6AFrozenCounterIsInvalidWithinFiveFrames) {
  Bench bench;
  for (int i = 0; i < 10; ++i) bench.good();
  int frames = 0;
  while (!bench.guard.invalid() && frames < 10) {
    EXPECT_FALSE(bench.guard.admit(frame_of(bench.counter, static_cast<std::uint8_t>(frames))));
    ++frames;
  }
  EXPECT_LE(frames, 5);
}

TEST(FrameGuard, E7ARepeatedBurstIsAWrongSequence) {
  Bench bench;
  for (int i = 0; i < 10; ++i) bench.good();
  // The last six again: the first of them jumps back.
  for (unsigned i = 5; i <= 9; ++i) EXPECT_FALSE(bench.guard.admit(frame_of(i))) << i;
  EXPECT_TRUE(bench.guard.invalid());
}

TEST(FrameGuard, E8AFrameOfAnotherDataIdIsRefused) {
  Bench bench;
  for (int i = 0; i < 10; ++i) bench.good();
  EXPECT_FALSE(bench.guard.admit(frame_of(bench.counter + 1, 0, 0x121)));
  EXPECT_FALSE(bench.guard.invalid());  // one alone is dropped
  EXPECT_TRUE(bench.good());
  for (int i = 0; i < 3; ++i) bench.guard.admit(frame_of(bench.counter + 1, 0, 0x121));
  EXPECT_TRUE(bench.guard.invalid());
}

TEST(FrameGuard, E12ValidAgainWithExactlyTheFifthGoodFrame) {
  Bench bench;
  for (int i = 0; i < 10; ++i) bench.good();
  bench.counter += 7;
  EXPECT_FALSE(bench.good());
  EXPECT_TRUE(bench.guard.invalid());
  for (int i = 1; i < FrameGuard::kGood; ++i) EXPECT_FALSE(bench.good()) << i;
  EXPECT_TRUE(bench.good());
  EXPECT_FALSE(bench.guard.invalid());
}

TEST(FrameGuard, EveryPairOfCounters) {
  for (unsigned last = 0; last < 16; ++last) {
    for (unsigned now = 0; now < 16; ++now) {
      Bench bench;
      EXPECT_TRUE(bench.guard.admit(frame_of(last)));
      const unsigned step = (now + 16 - last) % 16;
      EXPECT_EQ(bench.guard.admit(frame_of(now)), step >= 1 && step <= 3) << last << ' ' << now;
      EXPECT_EQ(bench.guard.invalid(), step > 3) << last << ' ' << now;
    }
  }
}

// Good, repeated, one lost, the most lost, too many lost, wrong CRC: all sequences of six, after
// eight good frames.
TEST(FrameGuard, E5EverySequenceOfSixAgainstAModel) {
  constexpr unsigned kSteps[] = {1, 0, 2, 3, 4};
  for (int sequence = 0; sequence < 46656; ++sequence) {
    Bench bench;
    for (int i = 0; i < 8; ++i) bench.good();
    std::vector<bool> good(8, true);
    bool invalid = false;
    int rest = sequence;
    for (int i = 0; i < 6; ++i, rest /= 6) {
      const int kind = rest % 6;
      can::CanFrame frame = frame_of(bench.counter + 1);
      bool is_good = false;
      if (kind == 5) {
        frame.data[0] ^= 0x01U;
      } else {
        bench.counter += kSteps[kind];
        frame = frame_of(bench.counter);
        is_good = kind != 1 && kind != 4;
        invalid = invalid || kind == 4;
      }
      good.push_back(is_good);
      int bad = 0, in_a_row = 0;
      for (std::size_t k = good.size() - 8; k < good.size(); ++k) bad += good[k] ? 0 : 1;
      for (std::size_t k = good.size(); k > 0 && good[k - 1]; --k) ++in_a_row;
      invalid = invalid || bad >= 3;
      if (invalid && in_a_row >= 5) invalid = false;
      ASSERT_EQ(bench.guard.admit(frame), is_good && !invalid) << sequence << ' ' << i;
      ASSERT_EQ(bench.guard.invalid(), invalid) << sequence << ' ' << i;
    }
  }
}

// Frames so far apart, with up to so much jitter; true when the rate was ever found wrong.
bool wrong(double period_ms, double jitter_ms, int frames, Duration expected = 10 * kMillisecond) {
  FrameGuard guard(expected, nullptr);
  bool found = false;
  for (int i = 0; i < frames; ++i) {
    const double late_ms = i % 5 == 0 ? jitter_ms : 0.0;
    guard.count(MonoTime{Duration::of_ms(1000.0 + i * period_ms + late_ms)});
    found = found || guard.wrong_rate();
  }
  return found;
}

TEST(FrameGuard, E11TwiceAsOftenIsFoundWithin150Milliseconds) {
  EXPECT_TRUE(wrong(5.0, 0.0, 30));
  EXPECT_TRUE(wrong(5.0, 2.0, 30));
  EXPECT_FALSE(wrong(10.0, 0.0, 200));
  EXPECT_FALSE(wrong(10.0, 9.0, 200));
  EXPECT_FALSE(wrong(8.0, 0.0, 200));
  EXPECT_FALSE(wrong(13.0, 0.0, 200));
}

TEST(FrameGuard, HalfAsOftenIsFound) {
  EXPECT_TRUE(wrong(20.0, 0.0, 17));
  EXPECT_TRUE(wrong(200.0, 0.0, 17, 100 * kMillisecond));
}

TEST(FrameGuard, APauseIsNoWrongRate) {
  FrameGuard guard(10 * kMillisecond, nullptr);
  MonoTime t{};
  for (int i = 0; i < 100; ++i) {
    t += i == 50 ? kSecond : 10 * kMillisecond;
    guard.count(t);
    EXPECT_FALSE(guard.wrong_rate()) << i;
  }
}

// Ten times as often until the pause: does the wrong rate outlive it?
bool outlives(Duration period, Duration pause) {
  FrameGuard guard(period, nullptr);
  MonoTime t{};
  for (int i = 0; i < 40; ++i) guard.count(t += period / 10);
  EXPECT_TRUE(guard.wrong_rate());
  guard.count(t + pause);
  return guard.wrong_rate();
}

TEST(FrameGuard, WhenAPauseBeginsTheCountAnew) {
  // 50 ms, or 2.5 periods where that is longer.
  EXPECT_TRUE(outlives(10 * kMillisecond, 50 * kMillisecond));
  EXPECT_FALSE(outlives(10 * kMillisecond, 50 * kMillisecond + kNanosecond));
  EXPECT_TRUE(outlives(40 * kMillisecond, 100 * kMillisecond));
  EXPECT_FALSE(outlives(40 * kMillisecond, 100 * kMillisecond + kNanosecond));
}

TEST(FrameGuard, WithoutAPeriodNoRateIsWrong) {
  FrameGuard guard;
  for (int i = 1; i < 100; ++i) guard.count(MonoTime::of_ns(i));
  EXPECT_FALSE(guard.wrong_rate());
}

TEST(FrameGuard, WithoutACounterTheCrcAloneCounts) {
  MessageProtection given = protection();
  given.counter.reset();
  FrameGuard guard(std::nullopt, &given);
  for (const unsigned any : {3U, 3U, 12U, 0U}) EXPECT_TRUE(guard.admit(frame_of(any)));
  EXPECT_FALSE(guard.admit(frame_of(1, 0, 0x121)));
}

TEST(FrameGuard, ACounterThatEndsAtFourteen) {
  MessageProtection given = protection();
  given.counter->maximum = 14;
  FrameGuard guard(std::nullopt, &given);
  for (unsigned i = 0; i < 60; ++i) EXPECT_TRUE(guard.admit(frame_of(i % 15))) << i;
  EXPECT_FALSE(guard.admit(frame_of(15)));  // no number of this counter, and no step from it
  EXPECT_TRUE(guard.admit(frame_of(0)));
  EXPECT_FALSE(guard.admit(frame_of(0)));
  EXPECT_FALSE(guard.invalid());
}

TEST(FrameGuard, OfACounterOfTwoBitsHalfTheWayRoundIsTheMost) {
  MessageProtection given = protection();
  given.counter->maximum = 3;
  for (const unsigned step : {1U, 2U}) {
    FrameGuard guard(std::nullopt, &given);
    EXPECT_TRUE(guard.admit(frame_of(1)));
    EXPECT_TRUE(guard.admit(frame_of((1 + step) % 4))) << step;
  }
  FrameGuard guard(std::nullopt, &given);
  EXPECT_TRUE(guard.admit(frame_of(1)));
  EXPECT_FALSE(guard.admit(frame_of(0)));
  EXPECT_TRUE(guard.invalid());
  for (unsigned i = 1; i < FrameGuard::kGood; ++i) EXPECT_FALSE(guard.admit(frame_of(i % 4))) << i;
  EXPECT_TRUE(guard.admit(frame_of(FrameGuard::kGood % 4)));
}

TEST(FrameGuard, WhatWasBadBeforeItWasValidAgainIsForgotten) {
  Bench bench;
  bench.good();
  for (int i = 0; i < FrameGuard::kBad; ++i) bench.guard.admit(frame_of(bench.counter));
  EXPECT_TRUE(bench.guard.invalid());
  for (int i = 0; i < FrameGuard::kGood; ++i) bench.good();
  EXPECT_FALSE(bench.guard.invalid());
  bench.guard.admit(frame_of(bench.counter));
  EXPECT_FALSE(bench.guard.invalid());
}

TEST(FrameGuard, NothingIsTakenFromABadFrame) {
  Config config;
  config.trigger = Trigger::kAlways;
  RoleBinding binding;
  binding.role = Role::kEngineSpeed;
  binding.id = {0x120, false};
  binding.message_length = 8;
  can::SignalDef value;
  value.start_bit = 32;
  value.length = 8;
  binding.codec = can::SignalCodec(value);
  binding.period_ms = 10.0;
  config.roles.push_back(binding);
  config.protections.push_back(protection());
  InputMonitor monitor(config);
  FaultSet faults;
  const auto take = [&](MonoTime t, const can::CanFrame& frame) {
    return monitor.on_frame({.t = t, .frame = frame}, faults);
  };
  EXPECT_EQ(take(MonoTime::of_ns(10), frame_of(1, 50)), FrameUse::kTaken);
  EXPECT_EQ(monitor.history(Role::kEngineSpeed).newest_value(), 50.0);
  EXPECT_EQ(take(MonoTime::of_ns(20), frame_of(1, 60)), FrameUse::kBad);
  EXPECT_EQ(take(MonoTime::of_ns(30), frame_of(2, 60, 0x121)), FrameUse::kBad);
  EXPECT_EQ(monitor.history(Role::kEngineSpeed).newest_value(), 50.0);
  EXPECT_TRUE(faults.has(Fault::kInputProtection));
  EXPECT_FALSE(monitor.suspect());
  EXPECT_EQ(take(MonoTime::of_ns(40), frame_of(9, 60)), FrameUse::kBad);
  EXPECT_TRUE(monitor.suspect());
}

}  // namespace
}  // namespace beltgrip::daemon
