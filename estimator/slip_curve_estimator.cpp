#include "estimator/slip_curve_estimator.h"

#include "estimator/paper_estimator.h"
#include "estimator/robust_estimator.h"

namespace beltgrip::estimator {

std::unique_ptr<SlipCurveEstimator> make_slip_curve_estimator(const EstimatorSettings& settings,
                                                              const VariatorParameters& variator,
                                                              const SensorAccuracies& accuracies) {
  return settings.method == Method::kPaper ? make_paper_estimator(settings, variator, accuracies)
                                           : make_robust_estimator(settings, variator, accuracies);
}

}  // namespace beltgrip::estimator
