#include "tools/sim/friction_curve.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace beltgrip::sim {

namespace {

constexpr double kSteepness = 2.2;                  // of the rise: tanh(2.2) = 0.976
constexpr double kShape = 1.3;                      // C of the magic formula
constexpr double kSecondLower = 0.01, kDip = 0.03;  // shares, of two_peaks
constexpr double kDropWithin = 1e-3;                // of slip
constexpr double kFloorOfFall = 0.5;                // share of the peak that stays at any slip

FrictionPoint rise(double mu_scale, double peak_slip, double slip) {
  const double t = std::tanh(kSteepness * slip / peak_slip);
  return {mu_scale * t, mu_scale * (1.0 - t * t) * kSteepness / peak_slip};
}

FrictionPoint broad_rise(const FrictionCurve& curve, double slip) {
  const double peak_slip = curve.peak_slip_percent / 100.0;
  const double knee_slip = curve.knee_slip_percent / 100.0;
  const double along = 100.0 * curve.rise_per_percent;
  const double foot =
      (curve.mu_max - along * peak_slip) / std::tanh(kSteepness * peak_slip / knee_slip);
  const FrictionPoint steep = rise(foot, knee_slip, slip);
  return {steep.mu + along * slip, steep.slope + along};
}

FrictionPoint magnitude(const FrictionCurve& curve, double slip) {
  const double peak_slip = curve.peak_slip_percent / 100.0;
  switch (curve.shape) {
    case CurveShape::kSaturating:
      return rise(curve.mu_max, peak_slip, slip);
    case CurveShape::kMagicFormula: {
      // The peak lies where C atan(B s) = pi / 2.
      const double b = std::tan(std::numbers::pi / (2.0 * kShape)) / peak_slip;
      const double angle = kShape * std::atan(b * slip);
      return {curve.mu_max * std::sin(angle),
              curve.mu_max * std::cos(angle) * kShape * b / (1.0 + b * b * slip * slip)};
    }
    case CurveShape::kTwoPeaks:
      if (slip > peak_slip && slip < 2.0 * peak_slip) {
        const double t = slip / peak_slip - 1.0;
        const double angle = 2.0 * std::numbers::pi * t;
        return {
            curve.mu_max * (1.0 - kSecondLower * t - 0.5 * kDip * (1.0 - std::cos(angle))),
            curve.mu_max / peak_slip * (-kSecondLower - std::numbers::pi * kDip * std::sin(angle))};
      }
      break;
    case CurveShape::kBroadTop:
      if (slip <= peak_slip) return broad_rise(curve, slip);
      break;
    case CurveShape::kTanhFall:
      break;
  }
  if (slip <= peak_slip) return rise(curve.mu_max / std::tanh(kSteepness), peak_slip, slip);
  const double fall = 100.0 * curve.fall_per_percent;
  const bool two = curve.shape == CurveShape::kTwoPeaks;
  const double from = two ? 2.0 * peak_slip : curve.fall_slip();
  if (!two && slip <= from) return {curve.mu_max, 0.0};
  const double top = two ? curve.mu_max * (1.0 - kSecondLower) : curve.mu_max;
  const double drop = curve.mu_max * curve.fall_at_once / kDropWithin;
  const bool drops = slip - from < kDropWithin;
  const double mu = top - fall * (slip - from) - drop * std::min(slip - from, kDropWithin);
  const double floor = kFloorOfFall * curve.mu_max;
  return mu > floor ? FrictionPoint{mu, -fall - (drops ? drop : 0.0)} : FrictionPoint{floor, 0.0};
}

}  // namespace

FrictionPoint friction_at(const FrictionCurve& curve, double slip) {
  const FrictionPoint point = magnitude(curve, std::abs(slip));
  return {std::copysign(point.mu, slip), point.slope};
}

}  // namespace beltgrip::sim
