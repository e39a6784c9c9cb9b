// Method "paper": van Berkel, Fujii, Hofman, Steinbuch, "Belt-Pulley Friction Estimation for the
// Continuously Variable Transmission", CDC-ECC 2011, equations (3), (5), (10) to (21) and Table I.
// Slip in percent. Real-time thread; allocates in the constructor only.
//
// What the text leaves open, and what is taken here:
// - Slip is in percent in v, k and the thresholds: with fractions the gate would need slip with a
//   standard deviation of 22 %.
// - The window of v, the filter and the peak samples see the low-passed channels (input_filter.h).
// - The filter starts at k(0) = initial_slope on the line through the first sample, with P(0) =
//   initial_variance I. From x(0) = 0 with a small P(0) it never turns negative; with k(0) = 0
//   there is no set (2) before set (3); a much larger P(0) lets the noise of the first samples set
//   the slope.
// - While the gate is closed k is held, and decides nothing. When it opens again: reopening
//   kHeldSlope: mu_0 has followed the measurement, k is the held one, P is P(0) again.
//   kInitialSlope: as at the first time. kPaused: k, mu_0 and P are those of the closing.
// - Q is per step at 200 Hz; at another rate the walk keeps its variance per second.
// - mu_max is the mean of mu* over the samples with the gate open and |k| < c_m, its uncertainty
//   their standard deviation. peak_samples kAll: all of them; kLast: the last unbroken run of them.
// The defaults are those that come closest to what the paper reports: estimator/PAPER.md.
// - The experiment stops when k < c_k with the gate open. There is no other stop for slip.
#pragma once

#include <memory>

#include "estimator/method/slip_curve_estimator.h"

namespace beltgrip::estimator {

std::unique_ptr<SlipCurveEstimator> make_paper_estimator(const EstimatorSettings& settings,
                                                         const VariatorParameters& variator,
                                                         const SensorAccuracies& accuracies);

}  // namespace beltgrip::estimator
