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
  double weight = 0.0;                                 // 1 / variance of mu
  double slip_percent = 0.0, mu = 0.0, force_N = 0.0;  // times weight
  double t_s = 0.0;                                    // times duration
  double duration_s = 0.0;
};

// What is known of the errors, beside the points' own variance.
struct SharedErrors {
  double slip_noise_percent2_s = 0.0;  // of slip, a density
  double slow_relative = 0.0;          // variance of the slow error of mu*, relative (slow_noise.h)
};

// By how many deviations a group of `length` points lies below the chord of the groups before and
// after it, at most. Deformation, which moves the slip with the force, counts as deviation. sums:
// one more than points.
double below_chord(std::span<const CurveSums> sums, std::size_t length,
                   const SharedErrors& errors) noexcept;

struct Residual {
  double t_s = 0.0;
  double value = 0.0, variance = 0.0;  // of mu, without what the slow error adds
  double slow_variance = 0.0;
};
// In the order of time, made free of the slow error that neighbours share: each becomes what a
// Kalman filter did not expect, divided by its deviation.
void whiten(std::span<Residual> residuals) noexcept;
// Whitened residuals in the order of time.
struct ResidualTests {
  double innovation = 0.0;  // largest mean of neighbours, in its deviations
  double runs = 0.0;        // deviations by which there are too few changes of sign
};
ResidualTests test_residuals(std::span<const Residual> residuals) noexcept;

}  // namespace beltgrip::estimator
