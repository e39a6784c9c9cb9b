// The noise that a channel's course shows, against noise that is drawn here with a known density.
#include "estimator/signal/trend.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>

namespace beltgrip::estimator {
namespace {

constexpr double kRate_hz = 100.0;
constexpr double kNoise = 3.0;                           // of one sample
constexpr double kDensity = kNoise * kNoise / kRate_hz;  // variance of a mean over 1 s
constexpr double kCorner_s = 2.0, kStep_s = 8.0, kEnd_s = 12.0;

// A course that stands, then falls by this, and steps once on the way.
Trend course(std::uint64_t seed, double falls_per_s, double step) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  Trend trend(kRate_hz, 4096);
  for (int i = 0; i < static_cast<int>(kEnd_s * kRate_hz); ++i) {
    const double t_s = i / kRate_hz;
    const double course =
        -falls_per_s * std::max(0.0, t_s - kCorner_s) + (t_s > kStep_s ? step : 0);
    trend.step(t_s, course + kNoise * normal(random), 0.0);
  }
  return trend;
}

struct Densities {
  double by_mean = 0.0, by_median = 0.0;  // in the true one; of 40 courses
};
Densities densities(double falls_per_s, double step) {
  Densities out;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    const Trend trend = course(seed, falls_per_s, step);
    out.by_mean += trend.density(0.4) / kDensity / 40.0;
    out.by_median += trend.quiet_density(0.4) / kDensity / 40.0;
  }
  return out;
}

// The largest of a few scales: somewhat more than the true one.
TEST(Trend, OfAStraightCourseBothDensitiesAreThatOfItsNoise) {
  const Densities both = densities(0.0, 0.0);
  EXPECT_GT(both.by_mean, 0.9);
  EXPECT_LT(both.by_mean, 1.6);
  EXPECT_GT(both.by_median, 0.9);
  EXPECT_LT(both.by_median, 2.0);
}

// Of 30 means over 0.4 s a corner and a step are in five differences.
TEST(Trend, ACornerAndAStepAreInTheMeanAndNotInTheMedian) {
  const Densities straight = densities(0.0, 0.0);
  const Densities both = densities(60.0, 30.0);
  EXPECT_GT(both.by_mean, 2.0 * straight.by_mean);
  EXPECT_LT(both.by_median, 1.3 * straight.by_median);
}

// A force that is lowered by 600 N/s, and more and more slowly from 2 s on: toward 100 N/s with a
// time constant of 1 s. How far its line is off now, root mean square.
double end_error_N(Course kind, double noise_N, double rounded_to_N, bool bent) {
  double squares = 0.0;
  int count = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    Trend trend(kRate_hz, 4096, kind);
    double force_N = 6000.0;
    for (int i = 0; i < 600; ++i) {
      const double t_s = i / kRate_hz;
      const double rate_N_s = bent ? 100.0 + 500.0 * std::exp(-std::max(0.0, t_s - 2.0)) : 400.0;
      force_N -= rate_N_s / kRate_hz;
      double read_N = force_N + noise_N * normal(random);
      if (rounded_to_N > 0.0) read_N = rounded_to_N * std::round(read_N / rounded_to_N);
      if (!trend.step(t_s, read_N, 0.0) || t_s < 3.0) continue;
      const double error_N = trend.line().at(t_s) - force_N;
      squares += error_N * error_N;
      ++count;
    }
  }
  return std::sqrt(squares / count);
}

TEST(Trend, ALineFollowsACourseThatBends) {
  const double straight_N = end_error_N(Course::kStraight, 10.0, 0.0, true);
  EXPECT_LT(end_error_N(Course::kBends, 10.0, 0.0, true), 0.5 * straight_N);
}

// Rounding does not grow from shorter means to longer ones: no bend is seen in it.
TEST(Trend, ACoarseStraightCourseKeepsItsLongLine) {
  const double straight_N = end_error_N(Course::kStraight, 10.0, 80.0, false);
  EXPECT_LT(end_error_N(Course::kBends, 10.0, 80.0, false), 1.3 * straight_N);
}

// With few cells the line is that of the many, as long as it is no longer than they reach back; so
// wherever they stand in their ring.
TEST(Trend, FewCellsTellOfTheNewestWhatManyTell) {
  constexpr std::size_t kFew = 101;
  Trend few(kRate_hz, kFew), many(kRate_hz, 4096);
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  const double cells_s = few.cell_s() * static_cast<double>(kFew);
  int shorter = 0;
  for (int i = 0; i < 16000; ++i) {
    const double t_s = i / kRate_hz;
    // It turns back every 3.2 s.
    const double read = 300.0 * std::abs(std::remainder(t_s, 6.4)) + normal(random);
    many.step(t_s, read, 0.0);
    if (!few.step(t_s, read, 0.0) || t_s < 10.0) continue;
    const Line line = few.line(), whole = many.line();
    ASSERT_GT(line.begin_s, t_s - cells_s - 0.02);
    if (whole.begin_s < t_s - 0.9 * cells_s) continue;
    ++shorter;
    ASSERT_NEAR(line.slope, whole.slope, 1e-6);
    ASSERT_NEAR(line.at(t_s), whole.at(t_s), 1e-6);
  }
  EXPECT_GT(shorter, 500);
}

}  // namespace
}  // namespace beltgrip::estimator
