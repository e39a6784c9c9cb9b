// What learned functions depend on, as it is in the simulated machine. Simulation only.
#pragma once

#include "estimator/physics/learned_effects.h"
#include "tools/sim/simulation.h"

namespace beltgrip::sim {

inline estimator::LearnedConditions conditions(const Signals& now) {
  const double torque_Nm = now.torque_p_Nm != 0.0 ? now.torque_p_Nm : now.torque_e_Nm;
  return {.oil_temperature_degC = now.oil_degC,
          .primary_speed_rad_s = now.omega_p_rad_s,
          .primary_pressure_Pa = now.primary_pressure_Pa,
          .secondary_pressure_Pa = now.secondary_pressure_Pa,
          .torque_Nm = torque_Nm};
}

}  // namespace beltgrip::sim
