// The slope at the end of curves that are written down here, and how it scatters when the errors
// are drawn that its variance counts.
#include "estimator/robust/end_slope.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace beltgrip::estimator {
namespace {

constexpr double kForce_N = 3000.0, kPerNm = 1e-3;
constexpr Line kLine = {.t_s = 5.0, .value = kForce_N, .valid = true};

// From 1 % to 4 % of slip in 6 s.
std::vector<EndPoint> points_of(double (*curve)(double)) {
  std::vector<EndPoint> points;
  for (int i = 0; i <= 60; ++i) {
    const double slip = 1.0 + 0.05 * i;
    points.push_back({.t_s = 0.1 * i,
                      .slip_percent = slip,
                      .mu = curve(slip),
                      .weight = 1e6,
                      .own_variance = 1e-6,
                      .mu_per_Nm = kPerNm,
                      .slow_share = 1.0,
                      .speed_gain = 0.01,
                      .begin_speed_variance = 0.0,
                      .end_speed_variance = 0.0});
  }
  return points;
}

EndSlope slope_of(const std::vector<EndPoint>& points, double slow_variance = 0.0) {
  EndSlope slope;
  slope.begin(points.back().slip_percent, slow_variance, {}, kLine);
  for (const EndPoint& point : points) slope.collect(point);
  slope.solve();
  for (const EndPoint& point : points) slope.spread(point);
  return slope;
}

double straight(double slip) { return 0.08 + 0.002 * slip; }
double bent(double slip) {
  const double before = std::max(0.0, 2.8 - slip);  // 0.3 of 4 % before the end
  return 0.1 - 0.001 * (slip - 4.0) - 0.004 * before * before;
}

TEST(EndSlope, IsThatOfTheLastStretch) {
  const EndSlope rising = slope_of(points_of(straight));
  ASSERT_TRUE(rising.valid());
  EXPECT_NEAR(rising.slope(), 0.002, 1e-9);
  const EndSlope falling = slope_of(points_of(bent));
  ASSERT_TRUE(falling.valid());
  EXPECT_NEAR(falling.slope(), -0.001, 1e-9);
}

TEST(EndSlope, CannotBeToldFromThreePoints) {
  std::vector<EndPoint> points = points_of(straight);
  points.resize(3);
  EXPECT_FALSE(slope_of(points).valid());
}

// Errors of each kind are drawn; the slopes scatter as the variance says.
TEST(EndSlope, ScattersAsItSays) {
  constexpr int kDraws = 4000;
  constexpr double kSlow_Nm = 0.8, kSpeed = 0.05, kOwn = 1e-3, kTime_s = 1.2;
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  std::vector<EndPoint> exact = points_of(straight);
  for (EndPoint& each : exact) {
    each.begin_speed_variance = each.end_speed_variance = kSpeed * kSpeed;
  }
  const double variance = slope_of(exact, kSlow_Nm * kSlow_Nm).variance();
  double squares = 0.0;
  const double keeps = std::exp(-0.1 / kTime_s);
  for (int draw = 0; draw < kDraws; ++draw) {
    std::vector<EndPoint> points = exact;
    double slow = kSlow_Nm * normal(random), edge = kSpeed * normal(random);
    for (EndPoint& each : points) {
      const double next_edge = kSpeed * normal(random);
      each.mu += kOwn * normal(random) + kPerNm * slow + 0.01 * (edge - next_edge);
      slow = keeps * slow + kSlow_Nm * std::sqrt(1.0 - keeps * keeps) * normal(random);
      edge = next_edge;
    }
    const double error = slope_of(points).slope() - 0.002;
    squares += error * error / kDraws;
  }
  EXPECT_NEAR(squares / variance, 1.0, 0.1);
}

}  // namespace
}  // namespace beltgrip::estimator
