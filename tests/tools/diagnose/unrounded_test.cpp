// A channel that moves in steps: what is left of its rounding.
#include "tools/diagnose/data/unrounded.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <numbers>

#include "tests/tools/diagnose/noise.h"

namespace beltgrip::diagnose {
namespace {

constexpr double kStep = 20.0;
constexpr double kSample_s = 0.02;

// Rms over the time, in steps, of what a mean over half a second is off by.
struct Errors {
  double as_read = 0.0, unrounded = 0.0;
};

// truth: in steps, over the time; noise: one sigma of it before the rounding, in steps.
Errors errors_of(const std::function<double(double)>& truth, double noise) {
  constexpr int kSamples = 3000, kMean = 25;
  Channel channel;
  Noise next;
  for (int i = 0; i < kSamples; ++i) {
    channel.t_s.push_back(kSample_s * i);
    channel.value.push_back(kStep * std::round(truth(kSample_s * i) + noise * next()));
  }
  const Channel* const alone = &channel;
  const Channel out = unrounded(channel, kStep, noise_before_rounding({&alone, 1}, kStep));
  EXPECT_EQ(out.t_s, channel.t_s);
  Errors errors;
  constexpr int kMeans = kSamples / kMean;
  for (int first = 0; first < kSamples; first += kMean) {
    double read = 0.0, back = 0.0;
    for (int i = first; i < first + kMean; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const double value = truth(channel.t_s[k]);
      read += (channel.value[k] / kStep - value) / kMean;
      back += (out.value[k] / kStep - value) / kMean;
    }
    errors.as_read += read * read / kMeans;
    errors.unrounded += back * back / kMeans;
  }
  return {std::sqrt(errors.as_read), std::sqrt(errors.unrounded)};
}

double ramp(double t_s) { return 30.3 - 0.3 * t_s; }

TEST(Unrounded, ARampThatPassesItsStepsSlowlyHasNoSawTooth) {
  const Errors errors = errors_of(ramp, 0.1);
  EXPECT_GT(errors.as_read, 0.18);  // of 1 / sqrt(12)
  EXPECT_LT(errors.unrounded, 0.04);
}

TEST(Unrounded, AMotionThatTurnsIsFoundBetweenItsSteps) {
  const Errors errors = errors_of([](double t_s) { return 20.2 + 3.0 * std::sin(0.8 * t_s); }, 0.1);
  EXPECT_GT(errors.as_read, 0.08);
  EXPECT_LT(errors.unrounded, 0.5 * errors.as_read);
}

// A swing of the pressure crosses the edge of a step many times while the ramp passes it: it has
// been held on neither side.
TEST(Unrounded, ARampThatSwingsAboutItsEdgesIsNotHeldBetweenThem) {
  constexpr double kSwing_rad_s = 2.0 * std::numbers::pi / 3.0;
  const Errors errors = errors_of(
      [](double t_s) { return 30.3 - 0.1 * t_s + 0.2 * std::sin(kSwing_rad_s * t_s); }, 0.04);
  EXPECT_GT(errors.as_read, 0.2);
  EXPECT_LT(errors.unrounded, 0.2);
}

// A corner costs little: no jump is smeared over its neighbours.
TEST(Unrounded, AJumpStaysWhereItIs) {
  const Errors errors = errors_of([](double t_s) { return t_s < 30.0 ? 30.0 : 22.0; }, 0.1);
  EXPECT_LT(errors.unrounded, 0.06);
}

// Noise as large as the step rounds nothing off that a mean would not take out: it stays.
TEST(Unrounded, NoiseOverSeveralStepsIsLeftAsItIs) {
  const Errors errors = errors_of(ramp, 0.8);
  EXPECT_NEAR(errors.unrounded, errors.as_read, 0.1 * errors.as_read);
}

TEST(Unrounded, TheNoiseBeforeTheRoundingStays) {
  Channel channel;
  Noise next;
  constexpr double kNoise = 0.35;
  for (int i = 0; i < 3000; ++i) {
    channel.t_s.push_back(kSample_s * i);
    channel.value.push_back(std::round(ramp(kSample_s * i) + kNoise * next()));
  }
  const Channel* const alone = &channel;
  const Channel out = unrounded(channel, 1.0, noise_before_rounding({&alone, 1}, 1.0));
  double square = 0.0;
  for (std::size_t i = 0; i < out.value.size(); ++i) {
    square +=
        std::pow(out.value[i] - ramp(out.t_s[i]), 2.0) / static_cast<double>(out.value.size());
  }
  EXPECT_NEAR(std::sqrt(square), kNoise, 0.15 * kNoise);
}

// Noise takes a hold over to the next value by how near that is: told by the noise, which another
// experiment shows, whose ramp crosses the values, and a hold itself does not.
TEST(Unrounded, AHoldIsTowardsTheValueThatNoiseTakesItTo) {
  constexpr double kHold = 17.38, kNoise = 0.1;
  Noise next;
  Channel crosses, holds;
  for (int i = 0; i < 3000; ++i) {
    const double t_s = kSample_s * i;
    crosses.t_s.push_back(t_s);
    crosses.value.push_back(kStep * std::round(ramp(t_s) + kNoise * next()));
    holds.t_s.push_back(t_s);
    holds.value.push_back(kStep * std::round(kHold + kNoise * next()));
  }
  const std::array<const Channel*, 2> both{&crosses, &holds};
  const double noise = noise_before_rounding(both, kStep);
  EXPECT_NEAR(noise, kNoise, 0.2 * kNoise);
  double mean = 0.0;
  for (const double value : unrounded(holds, kStep, noise).value) mean += value / 3000.0;
  EXPECT_NEAR(mean / kStep, kHold, 0.03);
}

// One that jumps from sample to sample says nothing, and takes nothing from the others.
TEST(NoiseBeforeRounding, IsToldBesideAChannelThatJumpsAllTheTime) {
  Noise next;
  Channel crosses, jumps;
  for (int i = 0; i < 3000; ++i) {
    const double t_s = kSample_s * i;
    crosses.t_s.push_back(t_s);
    crosses.value.push_back(kStep * std::round(ramp(t_s) + 0.1 * next()));
    jumps.t_s.push_back(t_s);
    jumps.value.push_back(kStep * (i % 2 == 0 ? 10.0 : 20.0));
  }
  const std::array<const Channel*, 2> both{&crosses, &jumps};
  EXPECT_NEAR(noise_before_rounding(both, kStep), 0.1, 0.02);
  for (const double value : unrounded(jumps, kStep, 0.1).value) {
    ASSERT_GE(value, 9.0 * kStep);
    ASSERT_LE(value, 21.0 * kStep);
  }
}

// What jumps and turns is not followed through its corners; that is no noise.
TEST(NoiseBeforeRounding, IsNoneOfTheCorners) {
  Noise next;
  Channel channel;
  for (int i = 0; i < 3000; ++i) {
    const double t_s = kSample_s * i;
    const double turns_s = std::fmod(t_s, 6.0);
    channel.t_s.push_back(t_s);
    channel.value.push_back(
        kStep * std::round((turns_s < 5.0 ? 30.3 - 1.2 * turns_s : 24.3) + 0.1 * next()));
  }
  const Channel* const alone = &channel;
  EXPECT_NEAR(noise_before_rounding({&alone, 1}, kStep), 0.1, 0.05);
}

// The values of a channel with an offset are no multiples of its step.
TEST(Unrounded, AHeldValueIsNowhereElseWhereTheStepsBeginElsewhere) {
  constexpr double kOffset = 0.4;
  Channel channel;
  for (int i = 0; i < 500; ++i) {
    channel.t_s.push_back(kSample_s * i);
    channel.value.push_back((7.0 + kOffset) * kStep);
  }
  for (const double value : unrounded(channel, kStep, 0.1).value) {
    EXPECT_NEAR(value, (7.0 + kOffset) * kStep, 0.05 * kStep);
  }
}

// Held on one value, nothing says where between its neighbours: it stays within its step.
TEST(Unrounded, AHeldValueIsNowhereElse) {
  Channel channel;
  for (int i = 0; i < 500; ++i) {
    channel.t_s.push_back(kSample_s * i);
    channel.value.push_back(7.0 * kStep);
  }
  for (const double value : unrounded(channel, kStep, 0.1).value)
    EXPECT_NEAR(value, 7.0 * kStep, 1.0);
}

TEST(Unrounded, TooFewSamplesAreLeftAlone) {
  const Channel channel{{0.0, 0.01, 0.02}, {1.0, 1.0, 2.0}};
  EXPECT_EQ(unrounded(channel, 1.0, 0.1).value, channel.value);
}

}  // namespace
}  // namespace beltgrip::diagnose
