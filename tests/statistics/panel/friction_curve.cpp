#include "friction_curve.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

namespace beltgrip::panel {
namespace {

constexpr double kLeastOfTop = 0.2;    // friction that is left however far it slips
constexpr double kPlateauRound = 0.3;  // points over which a plateau bends down
constexpr double kSlowKnee = 5.0;      // percent: scale of what a rising curve still gains
constexpr int kHalvings = 60;
constexpr double kMissed = 0.1;  // of the fall: beyond it the family has no such curve

double magic_argument(double x, double E) { return x - E * (x - std::atan(x)); }

// Where a function that rises crosses zero, between two places.
template <typename Function>
double root(double low, double high, Function rising) {
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (low + high);
    (rising(middle) < 0.0 ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

double stribeck(double x, double a, double d) {
  return std::tanh(a * x) * (1.0 - d * (1.0 - std::exp(-x)));
}

double stribeck_peak(double a, double d) {
  // Logarithmic slopes of decay and rise.
  return root(1e-3, 30.0, [a, d](double x) {
    return d * std::exp(-x) / (1.0 - d * (1.0 - std::exp(-x))) - 2.0 * a / std::sinh(2.0 * a * x);
  });
}

}  // namespace

const char* family_name(Family family) {
  constexpr const char* kNames[kFamilies] = {"magic",       "stribeck", "rational", "plateau",
                                             "exponential", "power",    "spline",   "rising"};
  return kNames[static_cast<int>(family)];
}

FrictionCurve::FrictionCurve(Family family, double mu_max, double slip_peak_percent,
                             double fall_per_percent, double shape, const Knots& knots)
    : family_(family),
      mu_max_(mu_max),
      slip_peak_percent_(slip_peak_percent),
      fall_(fall_per_percent),
      shape_(shape),
      knots_(knots),
      drop_(fall_per_percent * kFallSpan_percent / mu_max) {
  switch (family_) {
    case Family::kMagic:
      prepare_magic();
      break;
    case Family::kStribeck:
      prepare_stribeck();
      break;
    case Family::kRational:
      prepare_rational();
      break;
    case Family::kSpline:
      prepare_spline();
      break;
    case Family::kRising:
      top_ = unit(kRisingTo_percent);
      break;
    default:
      break;
  }
  if (family_ != Family::kMagic && family_ != Family::kStribeck && family_ != Family::kRational) {
    return;
  }
  const double drop = 1.0 - unit(slip_peak_percent_ + kFallSpan_percent);
  possible_ = possible_ && std::abs(drop - drop_) <= kMissed * drop_;
}

void FrictionCurve::prepare_magic() {
  const double far = 1.0 + kFallSpan_percent / slip_peak_percent_;
  const auto peak = [this](double C) {
    const double wanted = std::tan(0.5 * std::numbers::pi / C);
    return root(0.0, 1e4, [&](double x) { return magic_argument(x, shape_) - wanted; });
  };
  a_ = root(1.001, 2.0, [&](double C) {
    return 1.0 - std::sin(C * std::atan(magic_argument(far * peak(C), shape_))) - drop_;
  });
  x_peak_ = peak(a_);
}

void FrictionCurve::prepare_stribeck() {
  const double far = 1.0 + kFallSpan_percent / slip_peak_percent_;
  a_ = root(1e-3, 0.9, [&](double d) {
    const double peak = stribeck_peak(shape_, d);
    return 1.0 - stribeck(far * peak, shape_, d) / stribeck(peak, shape_, d) - drop_;
  });
  x_peak_ = stribeck_peak(shape_, a_);
  top_ = stribeck(x_peak_, shape_, a_);
}

void FrictionCurve::prepare_rational() {
  constexpr double kLeast = -1.0, kMost = 25.0;  // more of a bend: no friction rises like that
  const double far = 1.0 + kFallSpan_percent / slip_peak_percent_;
  a_ = std::clamp(((far - 1.0) * (far - 1.0) / drop_ - far * far - 1.0) / far, kLeast, kMost);
}

void FrictionCurve::prepare_spline() {
  const double p = slip_peak_percent_;
  const auto left = [this](double share) { return std::max(kLeastOfTop, 1.0 - share * drop_); };
  place_ = {0.0, 0.25 * p, 0.5 * p, 0.75 * p, p, p + 1.0, p + kFallSpan_percent, p + 8.0, p + 60.0};
  height_ = {0.0,
             knots_[0],
             knots_[1],
             knots_[2],
             1.0,
             left(knots_[3]),
             left(1.0),
             left(knots_[4]),
             left(1.5 * knots_[4])};
  // Fritsch and Carlson: the harmonic mean of the chords keeps each stretch monotone.
  std::array<double, kPlaces - 1> chord{};
  for (std::size_t i = 0; i + 1 < kPlaces; ++i) {
    chord[i] = (height_[i + 1] - height_[i]) / (place_[i + 1] - place_[i]);
  }
  slope_.front() = chord.front();
  slope_.back() = 0.0;
  for (std::size_t i = 1; i + 1 < kPlaces; ++i) {
    const double before = chord[i - 1], after = chord[i];
    if (before * after <= 0.0) continue;
    const double long_way = 2.0 * (place_[i + 1] - place_[i]) + (place_[i] - place_[i - 1]);
    const double short_way = (place_[i + 1] - place_[i]) + 2.0 * (place_[i] - place_[i - 1]);
    slope_[i] = (long_way + short_way) / (long_way / before + short_way / after);
  }
}

double FrictionCurve::spline(double slip_percent) const {
  if (slip_percent >= place_.back()) return height_.back();
  std::size_t i = 0;
  while (slip_percent >= place_[i + 1]) ++i;
  const double width = place_[i + 1] - place_[i];
  const double t = (slip_percent - place_[i]) / width;
  const double t2 = t * t, t3 = t2 * t;
  return (2.0 * t3 - 3.0 * t2 + 1.0) * height_[i] + (t3 - 2.0 * t2 + t) * width * slope_[i] +
         (3.0 * t2 - 2.0 * t3) * height_[i + 1] + (t3 - t2) * width * slope_[i + 1];
}

double FrictionCurve::unit(double s) const {
  const double u = s / slip_peak_percent_;
  const double beyond = std::max(0.0, s - slip_peak_percent_);
  switch (family_) {
    case Family::kMagic:
      return std::sin(a_ * std::atan(magic_argument(u * x_peak_, shape_)));
    case Family::kStribeck:
      return stribeck(u * x_peak_, shape_, a_) / top_;
    case Family::kRational:
      return (2.0 + a_) * u / (u * u + a_ * u + 1.0);
    case Family::kPlateau: {
      const double over = std::max(0.0, beyond - shape_);
      const double round = std::sqrt(over * over + kPlateauRound * kPlateauRound) - kPlateauRound;
      return 1.0 - std::pow(1.0 - std::min(1.0, u), 3) - drop_ / kFallSpan_percent * round;
    }
    case Family::kExponential:
      return (1.0 - std::exp(-shape_ * std::min(1.0, u))) / (1.0 - std::exp(-shape_)) -
             drop_ / kFallSpan_percent * beyond;
    case Family::kPower: {  // the fall goes on straight behind the span
      const double part = std::min(1.0, beyond / kFallSpan_percent);
      const double further = std::max(0.0, beyond - kFallSpan_percent);
      constexpr double kFallPower = 1.5;
      return 1.0 - std::pow(1.0 - std::min(1.0, u), shape_) -
             drop_ * (std::pow(part, kFallPower) + kFallPower * further / kFallSpan_percent);
    }
    case Family::kSpline:
      return spline(s);
    case Family::kRising:
      return ((1.0 - shape_) * (1.0 - std::exp(-3.0 * u)) + shape_ * s / (s + kSlowKnee)) / top_;
  }
  return 0.0;
}

double FrictionCurve::value(double slip_percent) const {
  const double s = std::abs(slip_percent);
  const double mu =
      mu_max_ * std::max(unit(s), kLeastOfTop * std::min(1.0, s / slip_peak_percent_));
  return slip_percent < 0.0 ? -mu : mu;
}

double FrictionCurve::slip_reached_percent(double relative) const {
  return root(0.0, slip_peak_percent_, [&](double slip_percent) {
    return value(slip_percent) - (1.0 - relative) * mu_max_;
  });
}

double FrictionCurve::slip_left_percent(double relative) const {
  return root(slip_peak_percent_, slip_peak_percent_ + 60.0, [&](double slip_percent) {
    return (1.0 - relative) * mu_max_ - value(slip_percent);
  });
}

FrictionCurve FrictionCurve::with_mu_max(double mu_max) const {
  return {family_, mu_max, slip_peak_percent_, fall_ * mu_max / mu_max_, shape_, knots_};
}

namespace {

// The fall says nothing about a curve that rises on, so its shape comes third.
bool shape_before_fall(Family family) { return family == Family::kRising; }

}  // namespace

std::array<double, kCurveParameters> parameters(const FrictionCurve& curve) {
  std::array<double, kCurveParameters> p = {curve.mu_max(), curve.slip_peak_percent(),
                                            curve.fall_per_percent(), curve.shape()};
  if (shape_before_fall(curve.family())) std::swap(p[2], p[3]);
  return p;
}

FrictionCurve with_parameters(const FrictionCurve& curve,
                              const std::array<double, kCurveParameters>& p) {
  const bool swapped = shape_before_fall(curve.family());
  return {curve.family(), p[0], p[1], p[swapped ? 3 : 2], p[swapped ? 2 : 3], curve.knots()};
}

int parameter_count(Family family) {
  switch (family) {
    case Family::kRational:
    case Family::kSpline:
    case Family::kRising:
      return 3;
    default:
      return 4;
  }
}

}  // namespace beltgrip::panel
