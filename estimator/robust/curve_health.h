// Do the points of one experiment lie on one friction curve? Tests on its own residuals. Slip in
// percent. Pure functions, real-time thread; work in proportion to the number of points.
//
// As far as its top a friction curve rises less and less: it is concave. A step of the friction, of
// the ratio or of the torque's reading on the way leaves points below the chord between those
// before and after, whatever form the curve has. Residuals about the fitted form that stay on one
// side for long, or whose means over neighbours are too large, say that no such form is the
// curve's.
#pragma once

#include <cstddef>
#include <span>

namespace beltgrip::estimator {

// By which a clamp force moves the ratio at its end stop, and with it the slip that is read.
inline constexpr double kDeformation_percent_per_N = 2e-4;

// Of all points before one, in the order of time.
struct CurveSums {
  double weight = 0.0;                         // 1 / variance of mu
  double slip = 0.0, mu = 0.0, force_N = 0.0;  // times weight
  double duration_s = 0.0;
};

// By how many deviations a group of `length` points lies below the chord of the groups before and
// after it, at most. Noise of slip (a density) and deformation, which moves the slip with the
// force, count as deviations. sums: one more than points.
double below_chord(std::span<const CurveSums> sums, std::size_t length, double slip_noise) noexcept;

// Normalised residuals in the order of time.
struct ResidualTests {
  double innovation = 0.0;  // largest mean of neighbours, in its deviations
  double runs = 0.0;        // deviations by which there are too few changes of sign
};
ResidualTests test_residuals(std::span<const double> residuals) noexcept;

}  // namespace beltgrip::estimator
