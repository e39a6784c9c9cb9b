// The floor of the clamp force: no request goes below it. The pressure below which the
// configuration lets none go (experiment.secondary_pressure_floor_Pa), the spring, and the oil that
// rotates with the pulley. The guards make theirs of the same numbers on their own
// (publish/output_stage, loop/pipeline_setup, guard/safety_monitor). Pure.
#pragma once

#include "estimator/physics/parameters.h"

namespace beltgrip::daemon {

double force_floor_N(const estimator::VariatorParameters& variator, double pressure_floor_Pa,
                     double omega_s_rad_s) noexcept;

}  // namespace beltgrip::daemon
