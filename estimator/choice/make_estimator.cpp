#include "estimator/choice/make_estimator.h"

#include <cmath>

#include "estimator/paper/paper_estimator.h"
#include "estimator/robust/robust_estimator.h"

namespace beltgrip::estimator {

std::unique_ptr<SlipCurveEstimator> make_slip_curve_estimator(const EstimatorSettings& settings,
                                                              const VariatorParameters& variator,
                                                              const SensorAccuracies& accuracies) {
  // A signal that is rounded more coarsely than its noise is off by the same for long.
  SensorAccuracies with_rounding = accuracies;
  with_rounding.secondary_pressure.bias =
      std::hypot(accuracies.secondary_pressure.bias, settings.pressure_step_Pa / std::sqrt(12.0));
  return settings.method == Method::kPaper
             ? make_paper_estimator(settings, variator, with_rounding)
             : make_robust_estimator(settings, variator, with_rounding);
}

}  // namespace beltgrip::estimator
