// Method "paper": van Berkel, Fujii, Hofman, Steinbuch, "Belt-Pulley Friction Estimation for the
// Continuously Variable Transmission", CDC-ECC 2011, equations (3), (5), (10) to (21) and Table I.
// Slip in percent. Real-time thread; allocates in the constructor only.
//
// What the text leaves open, and what is taken here:
// - Slip is in percent in v, k and the thresholds: with fractions the gate would need slip with a
//   standard deviation of 22 %.
// - The window of v, the filter and the peak samples see the low-passed channels (input_filter.h).
// - The filter starts anew at each rising edge of the gate with x(0) = [0, mu*(t)] and
//   P(0) = kInitialVariance I. From x(0) = 0 with a small P(0) it never turns negative; a much
//   larger P(0) lets the noise of the first samples set the slope.
// - While the gate is closed k is held, and decides nothing.
// - Q is per step at 200 Hz; at another rate the walk keeps its variance per second.
// - mu_max is the mean of mu* over the samples with the gate open and |k| < c_m, its uncertainty
//   their standard deviation.
// - The experiment stops when k < c_k with the gate open. There is no other stop for slip.
#pragma once

#include <memory>

#include "estimator/method/slip_curve_estimator.h"

namespace beltgrip::estimator {

std::unique_ptr<SlipCurveEstimator> make_paper_estimator(const EstimatorSettings& settings,
                                                         const VariatorParameters& variator,
                                                         const SensorAccuracies& accuracies);

}  // namespace beltgrip::estimator
