#include "daemon/core/experiment/force_floor.h"

namespace beltgrip::daemon {

double force_floor_N(const estimator::VariatorParameters& variator, double pressure_floor_Pa,
                     double omega_s_rad_s) noexcept {
  return variator.secondary_spring_force_N + variator.secondary_piston_area_m2 * pressure_floor_Pa +
         variator.secondary_centrifugal_N_s2 * omega_s_rad_s * omega_s_rad_s;
}

}  // namespace beltgrip::daemon
