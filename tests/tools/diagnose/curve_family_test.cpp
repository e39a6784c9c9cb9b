// What is taken for a friction curve: forms that are not among those the family was made of cost
// little, and a foot that an error of the ratio bends costs much.
#include "tools/diagnose/model/curve_family.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

namespace beltgrip::diagnose {
namespace {

using Knots = Eigen::Matrix<double, kShapeKnots, 1>;
using Curve = std::function<double(double x)>;

// Slip over slip at the peak, friction over mu_max.
double nominal(double x) { return std::sin(1.3 * std::atan(std::tan(M_PI / 2.6) * x)); }
double burckhardt(double x) { return (1.1 * -std::expm1(-4.0 * x) - 0.08 * x) / 1.0; }
double parabola(double x) { return x < 1.0 ? x * (2.0 - x) : 1.0 - 0.05 * (x - 1.0); }

Knots departures(const Curve& curve) {
  Knots out;
  for (int i = 0; i < kShapeKnots; ++i) {
    const double x = kShapeKnot[static_cast<std::size_t>(i)];
    out[i] = curve(x) - nominal(x);
  }
  return out;
}

double squared_sigmas(const Knots& departure) {
  return (curve_modes_inverse() * (departure - usual_departure())).squaredNorm();
}

double faults_of(const Knots& departure) {
  double sum = 0.0;
  for (const CurveFault& each :
       curve_faults(std::span<const double, kShapeKnots>(departure.data(), kShapeKnots))) {
    sum += each.slope;
  }
  return sum;
}

// The slip reads a fifth of that at the peak too much.
double shifted(double x) { return nominal(std::max(0.0, x - 0.2) / 0.8); }

TEST(CurveFamily, FormsOfFrictionAreInIt) {
  for (const Curve& curve : {Curve(nominal), Curve(burckhardt), Curve(parabola)}) {
    EXPECT_LT(squared_sigmas(departures(curve)), 2.0 * kShapeKnots);
    EXPECT_LT(faults_of(departures(curve)), 0.05);
  }
}

TEST(CurveFamily, AFootThatIsShiftedIsNot) {
  EXPECT_GT(squared_sigmas(departures(shifted)), 10.0 * kShapeKnots);
  EXPECT_GT(faults_of(departures(shifted)), 1.0);
}

TEST(CurveFamily, ModesAndTheirInverseAreOne) {
  EXPECT_LT((curve_modes() * curve_modes_inverse() - KnotMatrix::Identity()).cwiseAbs().maxCoeff(),
            1e-9);
  for (int mode = 0; mode < kShapeKnots; ++mode) {
    for (int i = 0; i < kShapeKnots; ++i) {
      EXPECT_NEAR(
          mode_shape(mode).departure(spline_position(kShapeKnot[static_cast<std::size_t>(i)])),
          curve_modes()(i, mode), 1e-12);
    }
  }
}

TEST(CurveFamily, DerivativesOfTheFaultsAreThoseOfDifferences) {
  constexpr double kStep = 1e-6;
  const Knots at = departures(shifted);
  const auto sums = [](const Knots& departure) {
    double slope = 0.0;
    Knots by_mode = Knots::Zero();
    for (const CurveFault& each :
         curve_faults(std::span<const double, kShapeKnots>(departure.data(), kShapeKnots))) {
      slope += each.slope;
      by_mode += each.by_mode;
    }
    return std::pair{slope, by_mode};
  };
  const auto [slope, by_mode] = sums(at);
  for (int mode = 0; mode < kShapeKnots; ++mode) {
    const auto [moved, unused] = sums(at + kStep * curve_modes().col(mode));
    EXPECT_NEAR((moved - slope) / kStep, by_mode[mode], 1e-4) << mode;
  }
}

}  // namespace
}  // namespace beltgrip::diagnose
