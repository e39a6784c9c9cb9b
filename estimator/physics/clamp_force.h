// Clamp force of the secondary pulley from pressure and speed. Pure function, SI, any thread.
#pragma once

#include "estimator/physics/parameters.h"

namespace beltgrip::estimator {

// F_s = A p_s + spring + c_s omega_s^2.
double secondary_clamp_force_N(const VariatorParameters& variator, double secondary_pressure_Pa,
                               double omega_s_rad_s);

}  // namespace beltgrip::estimator
