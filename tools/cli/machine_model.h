// A model file laid on a scenario: the simulated machine becomes what the file says it is. What the
// file leaves out stays the scenario's. Tools only.
#pragma once

#include <string>

#include "tools/sim/rig_scenario.h"
#include "tools/sim/vehicle_parameters.h"

namespace beltgrip::cli {

// Throw Failure: 66 no such file, 78 its content.
void apply_model(const std::string& path, sim::RigScenario& scenario);
void apply_model(const std::string& path, sim::VehicleScenario& scenario);

}  // namespace beltgrip::cli
