// Method "robust". Slip in percent. Real-time thread; allocates in the constructor only.
//
// Samples go unfiltered into a record (experiment_record.h), which keeps them in bounded memory and
// reads the noise of each channel off the data themselves. The decision to stop is that of
// stop_detector.h, the estimate that of peak_fit.h. The user tells physics, no filter and no
// threshold: what is large or small follows from the noise. The common low-pass (signal_chain.h)
// serves the published course of mu* and slip and the checks of the operating point.
//
// A value is given where the curve has been seen to turn down, with an interval that includes
// noise, form of the curve and the configured sensor accuracies; else what mu* has reached for
// sure.
#pragma once

#include <memory>

#include "estimator/method/slip_curve_estimator.h"
#include "estimator/physics/parameters.h"

namespace beltgrip::estimator {

std::unique_ptr<SlipCurveEstimator> make_robust_estimator(const EstimatorSettings& settings,
                                                          const VariatorParameters& variator,
                                                          const SensorAccuracies& accuracies);

}  // namespace beltgrip::estimator
