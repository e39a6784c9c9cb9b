#include "estimator/physics/clamp_force.h"

namespace beltgrip::estimator {

double secondary_clamp_force_N(const VariatorParameters& variator, double secondary_pressure_Pa,
                               double omega_s_rad_s) {
  return variator.secondary_piston_area_m2 * secondary_pressure_Pa +
         variator.secondary_spring_force_N +
         variator.secondary_centrifugal_N_s2 * omega_s_rad_s * omega_s_rad_s;
}

}  // namespace beltgrip::estimator
