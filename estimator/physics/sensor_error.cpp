#include "estimator/physics/sensor_error.h"

#include <cmath>

namespace beltgrip::estimator {

double relative_sensor_deviation(const VariatorParameters& variator,
                                 const SensorAccuracies& accuracies, double torque_magnitude_Nm,
                                 double clamp_force_N, double omega_s_rad_s) {
  const double centrifugal_N = variator.secondary_centrifugal_N_s2 * omega_s_rad_s * omega_s_rad_s;
  const double hydraulic_N = clamp_force_N - variator.secondary_spring_force_N - centrifugal_N;
  const double parts[] = {
      accuracies.torque.bias / torque_magnitude_Nm, accuracies.torque.gain,
      variator.secondary_piston_area_m2 * accuracies.secondary_pressure.bias / clamp_force_N,
      accuracies.secondary_pressure.gain * hydraulic_N / clamp_force_N,
      2.0 * centrifugal_N / clamp_force_N *
          (accuracies.omega_s.gain + accuracies.omega_s.bias / std::fmax(omega_s_rad_s, 1.0))};
  double sum = 0.0;
  for (const double part : parts) sum += part * part;
  return std::sqrt(sum);
}

}  // namespace beltgrip::estimator
