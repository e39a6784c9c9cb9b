#include "tools/sim/friction_curve.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tools/sim/tanh.h"

namespace beltgrip::sim {

namespace {

constexpr double kSteepness = 2.2;                  // of the rise: tanh(2.2) = 0.976
constexpr double kShape = 1.3;                      // C of the magic formula
constexpr double kSecondLower = 0.01, kDip = 0.03;  // shares, of two_peaks
constexpr double kDropWithin = 1e-3;                // of slip
constexpr double kFloorOfFall = 0.5;                // share of the peak that stays at any slip

FrictionPoint rise(double mu_scale, double peak_slip_share, double slip_share) {
  const double t = tanh_of(kSteepness * slip_share / peak_slip_share);
  return {mu_scale * t, mu_scale * (1.0 - t * t) * kSteepness / peak_slip_share};
}

FrictionPoint broad_rise(const FrictionCurve& curve, double slip_share) {
  const double peak_slip_share = curve.peak_slip_percent / 100.0;
  const double knee_slip_share = curve.knee_slip_percent / 100.0;
  const double along = 100.0 * curve.rise_per_percent;
  const double foot = (curve.mu_max - along * peak_slip_share) /
                      tanh_of(kSteepness * peak_slip_share / knee_slip_share);
  const FrictionPoint steep = rise(foot, knee_slip_share, slip_share);
  return {steep.mu + along * slip_share, steep.slope + along};
}

FrictionPoint magnitude(const FrictionCurve& curve, double slip_share) {
  const double peak_slip_share = curve.peak_slip_percent / 100.0;
  switch (curve.shape) {
    case CurveShape::kSaturating:
      return rise(curve.mu_max, peak_slip_share, slip_share);
    case CurveShape::kMagicFormula: {
      // The peak lies where C atan(B s) = pi / 2.
      const double b = std::tan(std::numbers::pi / (2.0 * kShape)) / peak_slip_share;
      const double angle = kShape * std::atan(b * slip_share);
      return {curve.mu_max * std::sin(angle), curve.mu_max * std::cos(angle) * kShape * b /
                                                  (1.0 + b * b * slip_share * slip_share)};
    }
    case CurveShape::kTwoPeaks:
      if (slip_share > peak_slip_share && slip_share < 2.0 * peak_slip_share) {
        const double t = slip_share / peak_slip_share - 1.0;
        const double angle = 2.0 * std::numbers::pi * t;
        return {curve.mu_max * (1.0 - kSecondLower * t - 0.5 * kDip * (1.0 - std::cos(angle))),
                curve.mu_max / peak_slip_share *
                    (-kSecondLower - std::numbers::pi * kDip * std::sin(angle))};
      }
      break;
    case CurveShape::kBroadTop:
      if (slip_share <= peak_slip_share) return broad_rise(curve, slip_share);
      break;
    case CurveShape::kTanhFall:
      break;
  }
  if (slip_share <= peak_slip_share)
    return rise(curve.mu_max / tanh_of(kSteepness), peak_slip_share, slip_share);
  const double fall = 100.0 * curve.fall_per_percent;
  const bool two = curve.shape == CurveShape::kTwoPeaks;
  const double from = two ? 2.0 * peak_slip_share : curve.fall_slip_share();
  if (!two && slip_share <= from) return {curve.mu_max, 0.0};
  const double top = two ? curve.mu_max * (1.0 - kSecondLower) : curve.mu_max;
  const double drop = curve.mu_max * curve.fall_at_once / kDropWithin;
  const bool drops = slip_share - from < kDropWithin;
  const double mu =
      top - fall * (slip_share - from) - drop * std::min(slip_share - from, kDropWithin);
  const double floor = kFloorOfFall * curve.mu_max;
  return mu > floor ? FrictionPoint{mu, -fall - (drops ? drop : 0.0)} : FrictionPoint{floor, 0.0};
}

}  // namespace

FrictionPoint friction_at(const FrictionCurve& curve, double slip_share) {
  const FrictionPoint point = magnitude(curve, std::abs(slip_share));
  return {std::copysign(point.mu, slip_share), point.slope};
}

}  // namespace beltgrip::sim
