// Method "robust": the slope of the friction curve over windows of many lengths, with the noise of
// each channel learned from its own scatter; a stop once the curve has levelled off or turned down
// beyond doubt, with backups by slip and slip rate; mu_max as the average over many forms of the
// curve near its peak. Slip in percent. Real-time thread; allocates in the constructor only.
#pragma once

#include <memory>

#include "estimator/slip_curve_estimator.h"

namespace beltgrip::estimator {

std::unique_ptr<SlipCurveEstimator> make_robust_estimator(const EstimatorSettings& settings,
                                                          const VariatorParameters& variator,
                                                          const SensorAccuracies& accuracies);

}  // namespace beltgrip::estimator
