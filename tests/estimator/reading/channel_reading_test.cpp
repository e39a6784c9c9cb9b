// One verdict on each reading: what moves is trusted, what stops is frozen, what steps keeps its
// time.
#include "estimator/reading/channel_reading.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <random>

namespace beltgrip::estimator {
namespace {

constexpr double kRate_hz = 100.0;

// No two values are equal.
double live(int i) { return 100.0 + std::sin(0.7 * i); }

void follow_live(ChannelReading& channel, int samples) {
  for (int i = 0; i < samples; ++i) channel.follow(live(i));
}
void follow_level(ChannelReading& channel, int samples) {
  for (int i = 0; i < samples; ++i) channel.follow(100.0);
}

TEST(ChannelReading, WhatMovesIsTrusted) {
  ChannelReading channel(kRate_hz);
  follow_live(channel, 200);
  EXPECT_EQ(channel.verdict(), ReadingVerdict::kValid);
  EXPECT_TRUE(channel.moves());
  EXPECT_TRUE(std::isinf(channel.stepped_s()));
}

TEST(ChannelReading, WhatMovedAndStandsStillIsFrozenUntilItMovesAgain) {
  ChannelReading channel(kRate_hz);
  follow_live(channel, 200);
  follow_level(channel, 15);  // the first of them is a change
  EXPECT_EQ(channel.verdict(), ReadingVerdict::kValid);
  follow_level(channel, 1);
  EXPECT_EQ(channel.verdict(), ReadingVerdict::kFrozen);
  channel.follow(100.5);
  EXPECT_EQ(channel.verdict(), ReadingVerdict::kValid);
}

TEST(ChannelReading, WhatNeverMovedIsSaidSoAfterFiveSeconds) {
  ChannelReading channel(kRate_hz);
  follow_level(channel, 500);
  EXPECT_EQ(channel.verdict(), ReadingVerdict::kValid);
  follow_level(channel, 1);
  EXPECT_EQ(channel.verdict(), ReadingVerdict::kNeverMoved);
}

TEST(ChannelReading, WhatIsComputedMayRest) {
  ChannelReading channel(kRate_hz, true);
  follow_live(channel, 200);
  follow_level(channel, 1000);
  EXPECT_EQ(channel.verdict(), ReadingVerdict::kValid);
}

TEST(ChannelReading, AStepKeepsItsFirstTimeAlsoWhereItStandsStillThen) {
  ChannelReading channel(kRate_hz);
  follow_live(channel, 200);
  channel.take_step(3.0);
  channel.take_step(5.0);
  EXPECT_EQ(channel.verdict(), ReadingVerdict::kStepped);
  EXPECT_EQ(channel.stepped_s(), 3.0);
  follow_level(channel, 100);
  EXPECT_EQ(channel.verdict(), ReadingVerdict::kFrozen);
  EXPECT_TRUE(channel.has_stepped());
  channel.reset();
  EXPECT_EQ(channel.verdict(), ReadingVerdict::kValid);
  EXPECT_FALSE(channel.has_stepped());
}

TEST(ChannelReading, TheStatusSaysSinceWhen) {
  ChannelReading channel(kRate_hz);
  constexpr std::int64_t kBegin_ns = 7'000'000'000;
  const auto since_s = [&](double now_s) {
    return static_cast<double>(channel.status(kBegin_ns, now_s).since_ns - kBegin_ns) / 1e9;
  };
  follow_live(channel, 200);
  EXPECT_EQ(channel.status(kBegin_ns, 2.0).verdict, ReadingVerdict::kValid);
  EXPECT_EQ(channel.status(kBegin_ns, 2.0).value, live(199));
  EXPECT_EQ(since_s(2.0), 0.0);
  channel.take_step(1.25);
  EXPECT_EQ(channel.status(kBegin_ns, 2.0).verdict, ReadingVerdict::kStepped);
  EXPECT_EQ(since_s(2.0), 1.25);
  follow_level(channel, 51);  // the first of them is a change
  EXPECT_EQ(channel.status(kBegin_ns, 2.5).verdict, ReadingVerdict::kFrozen);
  EXPECT_EQ(since_s(2.5), 2.0);
}

TEST(ChannelReading, TheStatusSaysWhatWasExpected) {
  ChannelReading channel(kRate_hz);
  const auto status_after = [&](double value) {
    channel.follow(value);
    channel.without_glitch(value, 0.01, 0.0);
    return channel.status(0, 1.0);
  };
  EXPECT_TRUE(std::isnan(status_after(100.0).test_ratio)) << "no line yet";
  for (int i = 0; i < 99; ++i) status_after(100.0);
  const ReadingStatus glitch = status_after(104.0);
  EXPECT_EQ(glitch.value, 104.0);
  EXPECT_NEAR(glitch.expected, 100.0, 1e-9);
  EXPECT_NEAR(glitch.test_ratio, 4.0, 1e-9);  // 4 of 1 % of 100
  EXPECT_NEAR(status_after(100.5).test_ratio, 0.5, 1e-9);
}

// It is held for 50 ms; what stays where it went is true, and the channel has jumped.
TEST(ChannelReading, AGlitchIsLeftOutAndAJumpIsNot) {
  ChannelReading channel(kRate_hz);
  const auto value_of = [&](double value) { return channel.without_glitch(value, 0.005, 0.0); };
  for (int i = 0; i < 100; ++i) EXPECT_EQ(value_of(100.0), 100.0);
  EXPECT_NEAR(value_of(150.0), 100.0, 1e-9);
  EXPECT_EQ(value_of(100.0), 100.0);
  for (int i = 0; i < 100; ++i) value_of(100.0);
  for (int i = 0; i < 5; ++i) {
    EXPECT_NEAR(value_of(150.0), 100.0, 1e-9);
    EXPECT_FALSE(channel.jumped());
  }
  EXPECT_EQ(value_of(150.0), 150.0);
  EXPECT_TRUE(channel.jumped());
}

// 1 rpm a step, and a speed whose noise is a fifth of that: at an edge of two steps it changes all
// the time, then it moves on to the middle of one. With noise of three steps it never rests.
TEST(ChannelReading, ARoundedReadingMayRestInTheMiddleOfAStep) {
  const auto frozen = [](double noise_rpm, bool stands) {
    std::mt19937_64 random(1);
    std::normal_distribution<double> normal;
    ChannelReading channel(200.0);
    double read_rpm = 0.0;
    for (int i = 0; i < 4000; ++i) {
      if (i % 4 == 0 && !(stands && i > 3000)) {
        const double speed_rpm = i < 2000 ? 1000.5 : 1001.0;
        read_rpm = std::round(speed_rpm + noise_rpm * normal(random));
      }
      channel.follow(read_rpm);
    }
    return channel.verdict() == ReadingVerdict::kFrozen;
  };
  EXPECT_FALSE(frozen(0.2, false));
  EXPECT_FALSE(frozen(3.0, false));
  EXPECT_TRUE(frozen(3.0, true));
}

// 10 kPa a step, read with noise of half of that: on a slow ramp it goes to and fro between two
// steps for a while, and is none the less a signal that has left two steps before it stops.
TEST(ChannelReading, ARoundedReadingOfASlowRampThatStopsIsFrozen) {
  const auto frozen = [](std::uint64_t seed, bool stands) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    ChannelReading channel(100.0);
    double read_kPa = 0.0;
    for (int i = 0; i < 2000; ++i) {
      const double pressure_kPa = 800.0 - 0.12 * i;
      if (!(stands && i > 1700)) {
        read_kPa = 10.0 * std::round(0.1 * (pressure_kPa + 5.0 * normal(random)));
      }
      channel.follow(read_kPa);
    }
    return channel.verdict() == ReadingVerdict::kFrozen;
  };
  int of_those_that_stop = 0, of_those_that_fall = 0;
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    of_those_that_stop += frozen(seed, true);
    of_those_that_fall += frozen(seed, false);
  }
  EXPECT_GE(of_those_that_stop, 98);
  EXPECT_EQ(of_those_that_fall, 0);
}

}  // namespace
}  // namespace beltgrip::estimator
