// Method "robust": the slope of the friction curve over the last stretch of slip, by least squares
// that minds the noise in slip; a stop once the curve has turned down beyond doubt, with backups by
// slip and slip rate; the peak by a local fit. Slip in percent. Real-time thread; allocates in the
// constructor only.
#pragma once

#include <memory>

#include "estimator/slip_curve_estimator.h"

namespace beltgrip::estimator {

std::unique_ptr<SlipCurveEstimator> make_robust_estimator(const EstimatorSettings& settings,
                                                          const VariatorParameters& variator,
                                                          const SensorAccuracies& accuracies);

}  // namespace beltgrip::estimator
