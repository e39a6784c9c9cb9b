#include "tools/diagnose/infer/conditions.h"

#include <cmath>

namespace beltgrip::diagnose {

Conditions conditions_of(const ExperimentData& run) {
  Conditions out;
  double oil_C = 0.0;
  for (int k = 0; k < run.size(); ++k) {
    if (!run.valid[static_cast<std::size_t>(k)]) continue;
    out.stop = run.stop[static_cast<std::size_t>(k)];
    out.speed_rad_s += run.omega_p.slow[k];
    out.torque_Nm += run.torque.slow[k];
    out.pressure_Pa += run.pressure.slow[k];
    out.rate_Pa_s += std::abs(run.pressure.slow_slope[k]);
    if (run.temperature.present) oil_C += run.temperature.value[k];
  }
  const double n = run.valid_count;
  for (double* each : {&out.speed_rad_s, &out.torque_Nm, &out.pressure_Pa, &out.rate_Pa_s}) {
    *each /= n;
  }
  if (run.temperature.present) out.oil_C = oil_C / n;
  return out;
}

}  // namespace beltgrip::diagnose
