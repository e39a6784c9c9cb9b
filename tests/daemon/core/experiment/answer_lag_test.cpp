// The lag of an actuator with dead time and a first-order answer, against what it was made with.
#include "daemon/core/experiment/answer_lag.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace beltgrip::daemon {
namespace {

constexpr Duration kSample = 5 * kMillisecond;
constexpr double kSample_s = 0.005;
constexpr double kConfigured_s = 0.21;

struct Actuator {
  double dead_s = 0.06;
  double lag_s = 0.15;
  double gain = 1.0;  // of the sensor
  double offset_N = 0.0;
  double noise_N = 0.0;
};

// The request falls from 4000 N by 600 N/s, from the bend on by the other rate.
struct Request {
  double bend_s = 1.0;
  double slow_N_per_s = 200.0;
  double end_s = 3.0;
};

double least_s(const Actuator& actuator, const Request& request, unsigned seed = 1) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  AnswerLag lag;
  lag.begin(0, kConfigured_s);
  std::vector<double> asked_N{4000.0};
  const auto dead = static_cast<std::size_t>(std::lround(actuator.dead_s / kSample_s));
  double force_N = asked_N[0], noise_N = 0.0;
  const auto samples = static_cast<std::size_t>(std::lround(request.end_s / kSample_s));
  for (std::size_t i = 1; i <= samples; ++i) {
    const bool fast = static_cast<double>(i) * kSample_s <= request.bend_s;
    const double rate_N_per_s = fast ? 600.0 : request.slow_N_per_s;
    asked_N.push_back(asked_N.back() - rate_N_per_s * kSample_s);
    const double told_N = asked_N[i > dead ? i - dead : 0];
    force_N -= std::expm1(-kSample_s / actuator.lag_s) * (told_N - force_N);
    if (i % 2 == 0) noise_N = actuator.noise_N * normal(random);  // a pressure that comes at 100 Hz
    const double read_N = actuator.gain * force_N + actuator.offset_N + noise_N;
    lag.step(static_cast<MonoTime>(i) * kSample, rate_N_per_s, read_N - asked_N.back());
  }
  return lag.least_s();
}

TEST(AnswerLag, IsFoundFromTheStepOfTheRate) {
  for (const double slow_N_per_s : {0.0, 200.0, 400.0}) {
    EXPECT_NEAR(least_s({}, {.slow_N_per_s = slow_N_per_s}), 0.21, 0.01) << slow_N_per_s;
  }
  // Other actuators than the configured one.
  EXPECT_NEAR(least_s({.dead_s = 0.12}, {}), 0.27, 0.01);
  EXPECT_NEAR(least_s({.dead_s = 0.0}, {}), 0.15, 0.01);
  EXPECT_NEAR(least_s({.dead_s = 0.0, .lag_s = 0.05}, {}), 0.05, 0.01);
}

TEST(AnswerLag, AnOffsetOfTheSensorIsNoLag) {
  for (const double offset_N : {-200.0, 200.0}) {
    EXPECT_NEAR(least_s({.offset_N = offset_N}, {}), least_s({}, {}), 1e-9) << offset_N;
  }
}

TEST(AnswerLag, APlainRampDoesNotTell) {
  for (double end_s = 0.005; end_s < 5.0; end_s += 0.1) {
    for (const double lag_s : {0.05, 0.15, 0.5}) {
      const Actuator actuator{.lag_s = lag_s, .gain = 0.9, .offset_N = 150.0, .noise_N = 20.0};
      ASSERT_EQ(least_s(actuator, {.bend_s = 5.0, .end_s = end_s}), 0.0) << end_s << ' ' << lag_s;
    }
  }
}

// A request stops where the least is above 1.3 of what it was planned for, 0.03 s of which are the
// frame's.
TEST(AnswerLag, TwiceTheConfiguredAnswerStopsARequest) {
  const double most_s = 1.3 * (kConfigured_s + 0.03);
  EXPECT_GT(least_s({.dead_s = 0.12, .lag_s = 0.3}, {.end_s = 2.0}), most_s);
  EXPECT_GT(least_s({.dead_s = 0.06, .lag_s = 0.5}, {}), most_s);
}

// From a second after the step on.
TEST(AnswerLag, IsHardlyAboveTheTruth) {
  for (const double dead_s : {0.0, 0.06, 0.12, 0.2}) {
    for (const double lag_s : {0.05, 0.15, 0.3, 0.5}) {
      for (const double slow_N_per_s : {0.0, 200.0, 400.0}) {
        for (const double end_s : {2.0, 3.0}) {
          const Request request{.slow_N_per_s = slow_N_per_s, .end_s = end_s};
          EXPECT_LT(least_s({.dead_s = dead_s, .lag_s = lag_s}, request), dead_s + lag_s + 0.025)
              << dead_s << ' ' << lag_s << ' ' << slow_N_per_s << ' ' << end_s;
        }
      }
    }
  }
}

// Before that dead time looks longer than it is; the configured actuator never stops a request.
TEST(AnswerLag, WhileTheAnswerIsUnderWayItMayBeAboveTheTruth) {
  for (double end_s = 1.0; end_s < 2.5; end_s += 0.02) {
    EXPECT_LT(least_s({}, {.end_s = end_s}), 1.26 * 0.21) << end_s;
    EXPECT_LT(least_s({.dead_s = 0.0, .lag_s = 0.21}, {.end_s = end_s}), 1.01 * 0.21) << end_s;
    EXPECT_LT(least_s({.dead_s = 0.2, .lag_s = 0.01}, {.end_s = end_s}), 1.6 * 0.21) << end_s;
  }
}

TEST(AnswerLag, NoiseMakesItLess) {
  constexpr unsigned kSeeds = 400;
  unsigned above = 0;
  double mean = 0.0;
  for (unsigned seed = 1; seed <= kSeeds; ++seed) {
    const double least = least_s({.noise_N = 20.0}, {}, seed);
    above += least > 0.21 ? 1 : 0;
    mean += least / kSeeds;
  }
  EXPECT_LT(above, kSeeds / 40);  // 2.3 % lie beyond two deviations
  EXPECT_GT(mean, 0.15);
}

// After three lags three samples are a line, two are none.
TEST(AnswerLag, TakesThreeSamples) {
  AnswerLag lag;
  lag.begin(0, kConfigured_s);
  double filtered = 0.0;
  for (int k = 1; k <= 128; ++k) {  // 126 is at 0.63 s
    EXPECT_EQ(lag.least_s(), 0.0) << k;
    const double rate = k < 126 ? 0.0 : 1e5;
    filtered += (1.0 - std::exp(-kSample_s / kConfigured_s)) * (rate - filtered);
    lag.step(k * kSample, rate, 0.3 * filtered);
  }
  EXPECT_NEAR(lag.least_s(), 0.3, 1e-6);
}

// The least lag as a line of what lies behind over the rate gives it, by sums over all samples from
// three lags on; its slope less two deviations, each reading of the force standing in four samples.
TEST(AnswerLag, IsTheLowerEndOfALine) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> slow(380.0, 560.0), first_s(0.0, 5000.0);
  int told = 0, silent = 0;
  for (int i = 0; i < 200; ++i) {
    const MonoTime begin = std::llround(first_s(random) * 1e9);
    const double slow_N_per_s = slow(random);
    AnswerLag lag;
    lag.begin(begin, kConfigured_s);
    double filtered = 0.0;
    std::vector<double> rates, behind;
    for (int k = 1; k <= 400; ++k) {
      const double rate = k <= 260 ? 600.0 : slow_N_per_s;
      const double lies_N = 0.3 * rate + 3.0 * normal(random);
      lag.step(begin + k * kSample, rate, lies_N);
      filtered += (1.0 - std::exp(-kSample_s / kConfigured_s)) * (rate - filtered);
      if (k * 5 < 630) continue;  // milliseconds
      rates.push_back(filtered);
      behind.push_back(lies_N);
    }
    const auto n = static_cast<double>(rates.size());
    double mean_rate = 0.0, mean_behind = 0.0, xx = 0.0, xy = 0.0, rest = 0.0;
    for (const double each : rates) mean_rate += each / n;
    for (const double each : behind) mean_behind += each / n;
    for (std::size_t k = 0; k < rates.size(); ++k) {
      xx += (rates[k] - mean_rate) * (rates[k] - mean_rate);
      xy += (rates[k] - mean_rate) * (behind[k] - mean_behind);
    }
    for (std::size_t k = 0; k < rates.size(); ++k) {
      const double off = behind[k] - mean_behind - xy / xx * (rates[k] - mean_rate);
      rest += off * off;
    }
    const bool contrast = std::sqrt(xx / n) >= 60.0;  // N/s
    const double wanted = xy / xx - 2.0 * std::sqrt(4.0 * rest / (n - 2.0) / xx);
    EXPECT_NEAR(lag.least_s(), contrast ? wanted : 0.0, 1e-6) << slow_N_per_s;
    ++(contrast ? told : silent);
  }
  EXPECT_GT(told, 30);
  EXPECT_GT(silent, 30);
}

}  // namespace
}  // namespace beltgrip::daemon
