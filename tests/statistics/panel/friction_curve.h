// Friction curves of the panel's virtual variators: families with a sharp peak, a round one, a flat
// top or none. Slip in percent, true slip (without deformation). Tests only; shares nothing with
// the estimator.
#pragma once

#include <array>

namespace beltgrip::panel {

enum class Family {
  kKink,        // tanh rise, then a linear fall: a corner at the peak
  kMagic,       // magic formula D sin(C atan(B s - E (B s - atan B s)))
  kStribeck,    // saturating rise times a Stribeck decay
  kFlatTop,     // rise, a plateau, then a smooth fall
  kBrush,       // cubic rise of the brush model, then a linear fall
  kBurckhardt,  // c1 (1 - exp(-c2 s)) - c3 s
  kMonotone     // saturates or keeps rising: no peak
};
inline constexpr int kFamilies = 7;
const char* family_name(Family family);

// mu(s), odd in s. Shape parameters are scaled such that the largest value is mu_max, at slip_peak.
struct FrictionCurve {
  Family family = Family::kKink;
  double mu_max = 0.1;     // kMonotone: the value it tends to (or has at 10 %)
  double slip_peak = 2.0;  // percent; kFlatTop: middle of the plateau
  double fall_per_percent = 1.5e-3;
  double shape = 0.0;  // family's own: see friction_curve.cpp
  double value(double slip) const;
  // Ends of the stretch in which mu >= (1 - relative) mu_max.
  double slip_reached(double relative) const;
  double slip_left(double relative) const;
};

// Parameters by name for the bound: mu_max, slip_peak, fall, shape.
inline constexpr int kCurveParameters = 4;
std::array<double, kCurveParameters> parameters(const FrictionCurve& curve);
FrictionCurve with_parameters(FrictionCurve curve, const std::array<double, kCurveParameters>& p);
// How many of them the family has (a prefix).
int parameter_count(Family family);

}  // namespace beltgrip::panel
