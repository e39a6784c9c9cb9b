// Points on one curve and points that are not, against curves written down here; and a reading that
// steps.
#include "estimator/curve_health.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "estimator/step_watch.h"

namespace beltgrip::estimator {
namespace {

constexpr double kNoise = 2e-4;

std::vector<CurveSums> sums_of(double (*curve)(double), std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<CurveSums> sums(1);
  for (int i = 0; i < 100; ++i) {
    const double slip = 0.02 * i;
    const double mu = curve(slip) + kNoise * normal(random);
    const double weight = 1.0 / (kNoise * kNoise);
    const CurveSums& before = sums.back();
    sums.push_back({before.weight + weight, before.slip + weight * slip, before.mu + weight * mu,
                    before.force_N + weight * 3000.0, before.duration_s + 0.05});
  }
  return sums;
}

double largest(double (*curve)(double), std::uint64_t seed) {
  double out = 0.0;
  const std::vector<CurveSums> sums = sums_of(curve, seed);
  for (std::size_t length = 1; length <= 16; length *= 2) {
    out = std::max(out, below_chord(sums, length, 1e-8));
  }
  return out;
}

TEST(CurveHealth, ConcaveCurvesAreWhole) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    EXPECT_LT(largest([](double slip) { return 0.1 * std::tanh(slip); }, seed), 5.5);
    EXPECT_LT(largest([](double slip) { return 0.05 * std::min(slip, 1.5); }, seed), 5.5);
  }
}

TEST(CurveHealth, AStepOfTorqueOrSlipIsNot) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    EXPECT_GT(largest([](double slip) { return 0.1 * std::tanh(slip) * (slip < 1.0 ? 1.0 : 1.05); },
                      seed),
              5.5);
    EXPECT_GT(
        largest([](double slip) { return 0.1 * std::tanh(slip < 1.0 ? slip : slip - 0.3); }, seed),
        5.5);
  }
}

TEST(CurveHealth, ResidualsOfNoiseAreNoneOfACurve) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  int rejected = 0;
  for (int i = 0; i < 1000; ++i) {
    std::vector<double> residuals(64);
    for (double& each : residuals) each = normal(random);
    const ResidualTests tests = test_residuals(residuals);
    rejected += tests.innovation > 5.0 || tests.runs > 4.5;
    for (std::size_t k = 0; k < residuals.size(); ++k) residuals[k] += k < 32 ? 1.5 : -1.5;
    EXPECT_GT(test_residuals(residuals).innovation, 5.0);
    EXPECT_GT(test_residuals(residuals).runs, 1.0);
  }
  EXPECT_LE(rejected, 3);
}

TEST(StepWatch, SeesAStepAndNoDriftAndNoneWhereSlipMoves) {
  const auto steps = [](double (*torque)(double), double slip_rate) {
    std::mt19937_64 random(1);
    std::normal_distribution<double> normal;
    StepWatch watch(200.0);
    bool seen = false;
    for (int i = 0; i < 4000; ++i) {
      const double t = i / 200.0;
      seen |= watch.step(torque(t) + 0.3 * normal(random), slip_rate * t, 3000.0, 0.09 / 200.0);
    }
    return seen;
  };
  EXPECT_TRUE(steps([](double t) { return t < 10.0 ? 50.0 : 53.0; }, 0.0));
  EXPECT_TRUE(steps([](double t) { return t < 10.0 ? -50.0 : -47.0; }, 0.0));
  EXPECT_FALSE(steps([](double t) { return t < 10.0 ? 50.0 : 51.0; }, 0.0));
  EXPECT_FALSE(steps([](double t) { return 50.0 - 2.0 * t; }, 0.0));
  EXPECT_FALSE(steps([](double t) { return 50.0 + 0.5 * std::sin(4.0 * t); }, 0.0));
  EXPECT_FALSE(steps([](double t) { return t < 10.0 ? 50.0 : 53.0; }, 2.0));
}

}  // namespace
}  // namespace beltgrip::estimator
