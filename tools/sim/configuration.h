// The DBC of the simulated rig and of the car, and the configuration of BeltGrip that fits a
// scenario. Simulation only.
#pragma once

#include <string>

#include "can_dbc/dbc/model.h"
#include "tools/sim/rig_parameters.h"
#include "tools/sim/vehicle_parameters.h"

namespace beltgrip::sim {

// The names and identifiers are the same whatever the scenario; of fast shafts the speeds have a
// step twice as large, for their frames would not reach so far.
std::string rig_dbc(const RigScenario& scenario);
const can::Database& rig_database(const RigScenario& scenario);
const can::Database& rig_database();  // as of slow shafts
std::string rig_configuration(const RigScenario& scenario, const std::string& interface,
                              const std::string& dbc_file);

const can::Database& vehicle_database();
std::string vehicle_configuration(const VehicleScenario& scenario, const std::string& interface,
                                  const std::string& dbc_file);

}  // namespace beltgrip::sim
