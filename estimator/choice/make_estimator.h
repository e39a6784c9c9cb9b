// The estimator that a configuration asks for.
#pragma once

#include <memory>

#include "estimator/method/slip_curve_estimator.h"
#include "estimator/physics/parameters.h"

namespace beltgrip::estimator {

// All memory is taken here.
std::unique_ptr<SlipCurveEstimator> make_slip_curve_estimator(const EstimatorSettings& settings,
                                                              const VariatorParameters& variator,
                                                              const SensorAccuracies& accuracies);

}  // namespace beltgrip::estimator
