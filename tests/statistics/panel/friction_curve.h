// Friction curves of the panel's virtual variators: six families and splines with a top, and curves
// that rise on. Slip in percent, true slip (without deformation). Tests only; shares nothing with
// the estimator.
#pragma once

#include <array>

namespace beltgrip::panel {

enum class Family {
  kMagic,        // magic formula sin(C atan(x - E (x - atan x)))
  kStribeck,     // saturating rise times a Stribeck decay
  kRational,     // (2 + k) u / (u^2 + k u + 1)
  kPlateau,      // cubic rise, a level stretch, then a rounded linear fall
  kExponential,  // exponential rise, then a linear fall: a corner at the peak
  kPower,        // power laws on both sides of the peak
  kSpline,       // monotone on either side, through drawn knots
  kRising        // keeps rising: no peak
};
inline constexpr int kFamilies = 8;
const char* family_name(Family family);

// Points of slip behind the top over which the fall is meant.
inline constexpr double kFallSpan_percent = 3.0;
// Where a curve rises on, mu_max is its value at this slip.
inline constexpr double kRisingTo_percent = 10.0;

// A spline's knots: three on the rise at a quarter, half and three quarters of the peak's slip, in
// units of the top; the shares of the fall at 1 and at 8 points behind the top.
using Knots = std::array<double, 5>;
inline constexpr Knots kPlainKnots = {0.6, 0.85, 0.96, 0.3, 1.8};

class FrictionCurve {
 public:
  FrictionCurve() : FrictionCurve(Family::kExponential, 0.1, 2.0, 1.5e-3, 4.0) {}
  // slip_peak_percent: percent; of a plateau its beginning; of a rising curve that of its knee.
  // shape is the family's own: E; the steepness of a rise; a plateau's width in points; the
  // exponent of a rise; what still comes slowly.
  FrictionCurve(Family family, double mu_max, double slip_peak_percent, double fall_per_percent,
                double shape, const Knots& knots = kPlainKnots);

  double value(double slip_percent) const;  // odd
  // The family has a curve of that peak and fall.
  bool possible() const { return possible_; }
  // Ends of the stretch in which mu >= (1 - relative) mu_max.
  double slip_reached_percent(double relative) const;
  double slip_left_percent(double relative) const;
  // The same form with another top.
  FrictionCurve with_mu_max(double mu_max) const;

  Family family() const { return family_; }
  bool has_peak() const { return family_ != Family::kRising; }
  double mu_max() const { return mu_max_; }
  double slip_peak_percent() const { return slip_peak_percent_; }
  double fall_per_percent() const { return fall_; }
  double shape() const { return shape_; }
  const Knots& knots() const { return knots_; }

 private:
  double unit(double slip_percent) const;  // of mu_max
  double spline(double slip_percent) const;
  void prepare_magic();
  void prepare_stribeck();
  void prepare_rational();
  void prepare_spline();

  Family family_;
  double mu_max_, slip_peak_percent_, fall_, shape_;
  Knots knots_;
  bool possible_ = true;
  double drop_;                    // of mu_max over the span, relative
  double a_ = 0.0, x_peak_ = 1.0;  // what the fall asks of the family; the peak in its own slip
  double top_ = 1.0;               // of the unscaled form
  static constexpr int kPlaces = 9;
  std::array<double, kPlaces> place_{}, height_{}, slope_{};
};

// Parameters by name for the bound, those that the family has: mu_max, slip_peak_percent, fall,
// shape.
inline constexpr int kCurveParameters = 4;
std::array<double, kCurveParameters> parameters(const FrictionCurve& curve);
FrictionCurve with_parameters(const FrictionCurve& curve,
                              const std::array<double, kCurveParameters>& p);
int parameter_count(Family family);

}  // namespace beltgrip::panel
