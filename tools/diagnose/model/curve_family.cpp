#include "tools/diagnose/model/curve_family.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

namespace beltgrip::diagnose {
namespace {

using Knots = Eigen::Matrix<double, kShapeKnots, 1>;

// Wider than the forms below: they are some of those that nature has. One sigma of what no form
// has, at each knot for itself.
constexpr double kWider = 1.2, kRough = 0.01;

double magic(double x, double c) {
  return std::sin(c * std::atan(std::tan(std::numbers::pi / (2.0 * c)) * x));
}
double hyperbolic(double x, double a) { return std::tanh(a * x) / std::tanh(a); }
double exponential(double x, double a) { return std::expm1(-a * x) / std::expm1(-a); }
double rational(double x, double k) { return x * (2.0 + k) / (1.0 + k * x + x * x); }
double straight(double x, double n) {
  return x * std::pow(2.0, 1.0 / n) / std::pow(1.0 + std::pow(x, n), 1.0 / n);
}
// Adhesion that decays, about its own peak.
double decaying(double x, double ab) {
  constexpr double kAdhesion = 3.0;
  const double peak = std::log1p(kAdhesion / ab) / kAdhesion;
  const auto at = [&](double s) { return -std::expm1(-kAdhesion * s) * std::exp(-ab * s); };
  return at(x * peak) / at(peak);
}

struct Form {
  double (*rise)(double x, double parameter);
  std::vector<double> parameters;
  bool falls;  // straight beyond the peak, at kFalls, instead of by the form itself
};
constexpr std::array kFalls{0.0, 0.03, 0.1, 0.25};  // of mu_max, per slip at the peak

// Departures from the nominal curve of forms that the literature fits to friction over slip.
std::vector<Knots> departures() {
  const std::vector<Form> forms{{magic, {1.05, 1.15, 1.3, 1.45, 1.6, 1.8}, false},
                                {rational, {0.0, 1.0, 2.0, 4.0, 7.0}, false},
                                {decaying, {0.03, 0.1, 0.2}, false},
                                {hyperbolic, {1.2, 1.7, 2.2, 2.8, 3.5}, true},
                                {exponential, {1.0, 2.0, 3.0, 4.5, 6.0}, true},
                                {straight, {2.0, 3.0, 5.0}, true}};
  const CurveShape nominal(std::array<double, kShapeKnots>{}, 0.0);
  std::vector<Knots> out;
  for (const Form& form : forms) {
    for (const double parameter : form.parameters) {
      for (const double fall : kFalls) {
        if (!form.falls && fall > 0.0) break;
        Knots each;
        for (int i = 0; i < kShapeKnots; ++i) {
          const double x = kShapeKnot[static_cast<std::size_t>(i)];
          const double beyond = form.falls ? std::max(0.0, x - 1.0) : 0.0;
          each[i] = form.rise(x - beyond, parameter) - fall * beyond - nominal.evaluate(x).value;
        }
        out.push_back(each);
      }
    }
  }
  return out;
}

struct Modes {
  Knots usual;
  KnotMatrix forward, inverse;
};

const Modes& modes() {
  static const Modes kModes = [] {
    const std::vector<Knots> all = departures();
    Knots usual = Knots::Zero();
    for (const Knots& each : all) usual += each / static_cast<double>(all.size());
    KnotMatrix moment = KnotMatrix::Zero();
    for (const Knots& each : all) moment += (each - usual) * (each - usual).transpose();
    moment *= kWider * kWider / static_cast<double>(all.size());
    moment.diagonal().array() += kRough * kRough;
    const Eigen::SelfAdjointEigenSolver<KnotMatrix> solver(moment);
    const Knots sigma = solver.eigenvalues().cwiseSqrt().reverse();
    const KnotMatrix direction = solver.eigenvectors().rowwise().reverse();
    return Modes{usual, direction * sigma.asDiagonal(),
                 sigma.cwiseInverse().asDiagonal() * direction.transpose()};
  }();
  return kModes;
}

}  // namespace

const Eigen::Matrix<double, kShapeKnots, 1>& usual_departure() { return modes().usual; }
const KnotMatrix& curve_modes() { return modes().forward; }
const KnotMatrix& curve_modes_inverse() { return modes().inverse; }

std::vector<CurveFault> curve_faults(std::span<const double, kShapeKnots> departure) {
  // The origin, the knots below the peak, the peak.
  constexpr std::size_t kPoints = kKnotsBelowPeak + 2;
  static const std::array<double, kPoints> kX = [] {
    std::array<double, kPoints> x{};
    std::copy_n(kShapeKnot.begin(), kKnotsBelowPeak, x.begin() + 1);
    x.back() = 1.0;
    return x;
  }();
  static const std::array<double, kPoints> kNominal = [] {
    const CurveShape nominal(std::array<double, kShapeKnots>{}, 0.0);
    std::array<double, kPoints> y{};
    std::transform(kX.begin(), kX.end(), y.begin(),
                   [&](double x) { return nominal.evaluate(x).value; });
    return y;
  }();
  const auto value = [&](std::size_t i) {
    return kNominal[i] + (i > 0 && i + 1 < kPoints ? departure[i - 1] : 0.0);
  };
  const auto by_mode = [](std::size_t i) -> Knots {
    if (i == 0 || i + 1 == kPoints) return Knots::Zero();
    return curve_modes().row(static_cast<Eigen::Index>(i) - 1).transpose();
  };
  std::vector<CurveFault> out;
  for (std::size_t i = 1; i + 1 < kPoints; ++i) {
    const double before = kX[i] - kX[i - 1], behind = kX[i + 1] - kX[i];
    const double slope = (value(i + 1) - value(i)) / behind - (value(i) - value(i - 1)) / before;
    if (!(slope > 0.0)) continue;
    out.push_back(
        {slope, (by_mode(i + 1) - by_mode(i)) / behind - (by_mode(i) - by_mode(i - 1)) / before});
  }
  return out;
}

int first_knot(int parameter) {
  if (parameter < kShapeOverdrive || parameter > kEndOfShapes) return -1;
  return parameter < kShapeLow ? kShapeOverdrive : kShapeLow;
}

const CurveShape& mode_shape(int mode) {
  static const std::array<CurveShape, kShapeKnots> kModes = [] {
    std::array<CurveShape, kShapeKnots> out;
    for (int i = 0; i < kShapeKnots; ++i) {
      out[static_cast<std::size_t>(i)] = CurveShape(
          std::span<const double, kShapeKnots>(curve_modes().col(i).data(), kShapeKnots), 0.0);
    }
    return out;
  }();
  return kModes[static_cast<std::size_t>(mode)];
}

const ModeCubics& mode_cubics() {
  static const ModeCubics kCubics = [] {
    ModeCubics out{};
    for (std::size_t interval = 0; interval < out.size(); ++interval) {
      for (std::size_t mode = 0; mode < kShapeKnots; ++mode) {
        const std::array<double, 4>& cubic = mode_shape(static_cast<int>(mode)).cubic(interval);
        for (std::size_t power = 0; power < cubic.size(); ++power) {
          out[interval][power][mode] = cubic[power];
        }
      }
    }
    return out;
  }();
  return kCubics;
}

}  // namespace beltgrip::diagnose
