// An error that wanders, against sums over its correlation exp(-|t| / 1.2 s) that are done here,
// and against one that is drawn.
#include "estimator/signal/slow_noise.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>

#include "estimator/signal/trend.h"

namespace beltgrip::estimator {
namespace {

constexpr double kTime_s = 1.2;

// Mean of the correlation between the instants of two stretches of this length, so far apart.
double covariance(double length_s, double apart_s) {
  constexpr int kSteps = 400;
  double sum = 0.0;
  for (int i = 0; i < kSteps; ++i) {
    for (int k = 0; k < kSteps; ++k) {
      sum += std::exp(-std::abs(apart_s + (i - k) * length_s / kSteps) / kTime_s);
    }
  }
  return sum / (kSteps * kSteps);
}

TEST(SlowNoise, OfAMeanAndOfAStep) {
  for (const double length_s : {0.05, 0.4, 1.6, 12.8}) {
    EXPECT_NEAR(slow_variance_of_mean(length_s), covariance(length_s, 0.0), 1e-3) << length_s;
    for (const double gap_s : {0.0, 0.1, 2.0}) {
      const double apart_s = length_s + gap_s;
      EXPECT_NEAR(slow_variance_of_step(length_s, apart_s),
                  2.0 * (covariance(length_s, 0.0) - covariance(length_s, apart_s)), 2e-3)
          << length_s << ' ' << gap_s;
    }
  }
  EXPECT_NEAR(slow_variance_of_mean(0.0), 1.0, 1e-3);
  EXPECT_NEAR(slow_covariance_of_means(0.8, 0.8, 1.3), covariance(0.8, 1.3), 1e-3);
  // A mean over 1.6 s is that of its two halves.
  EXPECT_NEAR(slow_covariance_of_means(1.6, 0.8, 2.0),
              0.5 * (covariance(0.8, 1.6) + covariance(0.8, 2.4)), 1e-3);
}

// Second differences by the same sums: 6 V - 8 C_1 + 2 C_2.
TEST(SlowNoise, IsReadOffTheScatterOfMeans) {
  constexpr double kWhite = 0.02, kSlow = 0.3;
  std::array<Scatter, 3> scatter;
  std::size_t i = 0;
  for (const double length_s : {0.4, 0.8, 1.6}) {
    const double slow = (6.0 * covariance(length_s, 0.0) - 8.0 * covariance(length_s, length_s) +
                         2.0 * covariance(length_s, 2.0 * length_s)) /
                        6.0;
    scatter[i++] = {length_s, kWhite / length_s + kSlow * slow, 20.0};
  }
  EXPECT_NEAR(slow_variance(scatter, kWhite), kSlow, 0.01 * kSlow);
  EXPECT_EQ(slow_variance(scatter, 1.0), 0.0);  // all of it is white
  EXPECT_EQ(slow_variance({}, kWhite), 0.0);
}

double drawn(double slow, double take_up_s, std::uint64_t seed) {
  constexpr double kRate_hz = 200.0;
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  Trend trend(kRate_hz, 4096);
  const double keeps = std::exp(-1.0 / (kRate_hz * kTime_s));
  double error = slow * normal(random);
  for (int i = 0; i < 40 * 200; ++i) {
    const double t_s = i / kRate_hz;
    const double load = take_up_s > 0.0 ? std::min(1.0, t_s / take_up_s) : 1.0;
    trend.step(t_s, 50.0 * load + error + 0.5 * normal(random), 0.0);
    error = keeps * error + slow * std::sqrt(1.0 - keeps * keeps) * normal(random);
  }
  return std::sqrt(trend.slow_variance());
}

TEST(SlowNoise, IsFoundInADrawnErrorAndNotInWhiteNoiseNorInTheTakingUpOfTheLoad) {
  double sum = 0.0;
  constexpr int kSeeds = 20;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    sum += drawn(0.4, 0.0, seed) / kSeeds;
    EXPECT_LT(drawn(0.0, 0.0, seed), 0.1) << seed;
    EXPECT_LT(drawn(0.0, 0.8, seed), 0.15) << seed;
  }
  EXPECT_NEAR(sum, 0.4, 0.12);
}

// What wanders is the load, 0.4 Nm, and slip follows it; or it is the reading alone.
double wandering(bool slip_follows, std::uint64_t seed) {
  constexpr double kRate_hz = 200.0;
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  Trend trend(kRate_hz, 4096);
  const double keeps = std::exp(-1.0 / (kRate_hz * kTime_s));
  double load_Nm = 0.4 * normal(random);
  for (int i = 0; i < 40 * 200; ++i) {
    const double t_s = i / kRate_hz;
    load_Nm = keeps * load_Nm + 0.4 * std::sqrt(1.0 - keeps * keeps) * normal(random);
    const double slip_percent = 1.0 + 0.02 * t_s + (slip_follows ? 0.03 * load_Nm : 0.0);
    trend.step(t_s, 50.0 + load_Nm + 0.1 * normal(random), slip_percent + 0.002 * normal(random));
  }
  return std::sqrt(trend.slow_variance());
}

TEST(SlowNoise, IsNoLoadThatSlipFollows) {
  double sum = 0.0;
  constexpr int kSeeds = 10;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    EXPECT_LT(wandering(true, seed), 0.12) << seed;
    sum += wandering(false, seed) / kSeeds;
  }
  EXPECT_GT(sum, 0.25);
}

}  // namespace
}  // namespace beltgrip::estimator
