// Scenario files of the virtual vehicle: TOML with physical names, checked key by key and then as a
// whole. Every message names file, line, key and the physical reason. Tools only.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "tools/sim/scenario_keys.h"
#include "tools/sim/vehicle_parameters.h"

namespace beltgrip::sim {

using VehicleScenarioResult = ScenarioResult<VehicleScenario>;

// True for a file that says plant = "vehicle".
bool is_vehicle_scenario(std::string_view toml);

// Layers in order, later ones on top of coast-overdrive, which is always the first.
VehicleScenarioResult parse_vehicle_scenario(const std::vector<ScenarioLayer>& layers);
// A shipped scenario by name with settings on top.
VehicleScenarioResult shipped_vehicle_scenario(std::string_view name,
                                               const std::vector<ScenarioLayer>& layers = {});

}  // namespace beltgrip::sim
