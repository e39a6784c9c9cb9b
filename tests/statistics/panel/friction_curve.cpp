#include "friction_curve.h"

#include <algorithm>
#include <cmath>

namespace beltgrip::panel {
namespace {

double magic(double x, double C) { return std::sin(C * std::atan(x)); }

// Normalised so that the peak is 1 at s = 1.
double magic_unit(double u, double C) {
  const double B = std::tan(0.5 * 3.141592653589793 / C);
  return magic(B * u, C);
}

}  // namespace

const char* family_name(Family family) {
  constexpr const char* kNames[kFamilies] = {"kink",  "magic",      "stribeck", "flat-top",
                                             "brush", "burckhardt", "monotone"};
  return kNames[static_cast<int>(family)];
}

double FrictionCurve::value(double slip) const {
  const double s = std::abs(slip);
  const double sign = slip < 0.0 ? -1.0 : 1.0;
  const double u = s / slip_peak;
  const double beyond = std::max(0.0, s - slip_peak);
  double mu = 0.0;
  switch (family) {
    case Family::kKink:  // shape: steepness of the rise, 1.6 .. 3
      mu = s <= slip_peak ? mu_max * std::tanh(shape * u) / std::tanh(shape)
                          : mu_max - fall_per_percent * beyond;
      break;
    case Family::kMagic:  // shape: C, 1.05 .. 1.6: sets the fall by itself
      mu = mu_max * magic_unit(u, shape);
      break;
    case Family::kStribeck: {  // rise over slip_peak / shape; the decay puts the peak at slip_peak
      // f = tanh(a u) (1 - d (1 - exp(-u b))) with b such that f' = 0 at u = 1
      const double a = shape;
      const double d = std::min(0.6, fall_per_percent * slip_peak / mu_max * 4.0);
      const double rise = a * (1.0 - std::pow(std::tanh(a), 2)) / std::tanh(a);
      // d b exp(-b) / (1 - d (1 - exp(-b))) = rise; small b branch
      double low = 0.0, high = 1.0;
      const auto decay = [d](double b) {
        return d * b * std::exp(-b) / (1.0 - d * (1.0 - std::exp(-b)));
      };
      for (int i = 0; i < 40; ++i) {
        const double middle = 0.5 * (low + high);
        (decay(middle) < rise ? low : high) = middle;
      }
      const double b = 0.5 * (low + high);
      const auto f = [a, b, d](double x) {
        return std::tanh(a * x) * (1.0 - d * (1.0 - std::exp(-b * x)));
      };
      mu = mu_max * f(u) / f(1.0);
      break;
    }
    case Family::kFlatTop: {  // shape: half width of the plateau, percent
      const double start = std::max(0.3 * slip_peak, slip_peak - shape);
      const double end = slip_peak + shape;
      const double v = std::min(1.0, s / start);
      const double over = std::max(0.0, s - end);
      mu = mu_max * (1.0 - std::pow(1.0 - v, 3)) -
           fall_per_percent * (std::sqrt(over * over + 0.09) - 0.3);
      break;
    }
    case Family::kBrush: {
      const double v = std::min(1.0, u);
      mu = mu_max * (1.0 - std::pow(1.0 - v, 3)) - fall_per_percent * beyond;
      break;
    }
    case Family::kBurckhardt: {  // peak where c1 c2 exp(-c2 s) = c3
      const double c2 = shape / slip_peak;
      const double c3_by_c1 = c2 * std::exp(-shape);
      const double top = 1.0 - std::exp(-shape) - c3_by_c1 * slip_peak;
      mu = mu_max / top * (1.0 - std::exp(-c2 * s) - c3_by_c1 * s);
      break;
    }
    case Family::kMonotone:  // shape: share that still comes slowly
      mu = mu_max * ((1.0 - shape) * (1.0 - std::exp(-3.0 * u)) + shape * s / (s + 5.0));
      break;
  }
  return sign * std::max(mu, 0.2 * mu_max * std::min(1.0, u));
}

double FrictionCurve::slip_reached(double relative) const {
  double low = 0.0, high = slip_peak;
  for (int i = 0; i < 50; ++i) {
    const double middle = 0.5 * (low + high);
    (value(middle) < (1.0 - relative) * mu_max ? low : high) = middle;
  }
  return high;
}

double FrictionCurve::slip_left(double relative) const {
  double low = slip_peak, high = slip_peak + 60.0;
  for (int i = 0; i < 50; ++i) {
    const double middle = 0.5 * (low + high);
    (value(middle) < (1.0 - relative) * mu_max ? high : low) = middle;
  }
  return high;
}

std::array<double, kCurveParameters> parameters(const FrictionCurve& curve) {
  const bool shape_before_fall =
      curve.family == Family::kMagic || curve.family == Family::kBurckhardt;
  return {curve.mu_max, curve.slip_peak, shape_before_fall ? curve.shape : curve.fall_per_percent,
          shape_before_fall ? curve.fall_per_percent : curve.shape};
}

FrictionCurve with_parameters(FrictionCurve curve, const std::array<double, kCurveParameters>& p) {
  const bool shape_before_fall =
      curve.family == Family::kMagic || curve.family == Family::kBurckhardt;
  curve.mu_max = p[0];
  curve.slip_peak = p[1];
  (shape_before_fall ? curve.shape : curve.fall_per_percent) = p[2];
  (shape_before_fall ? curve.fall_per_percent : curve.shape) = p[3];
  return curve;
}

int parameter_count(Family family) {
  switch (family) {
    case Family::kMagic:
    case Family::kBurckhardt:
    case Family::kBrush:
      return 3;
    default:
      return 4;
  }
}

}  // namespace beltgrip::panel
