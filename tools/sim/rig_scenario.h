// Scenario files of the rig: TOML with physical names, checked key by key and then as a whole.
// Every message names file, line, key and the physical reason. Tools only.
#pragma once

#include <vector>

#include "tools/sim/rig_parameters.h"
#include "tools/sim/scenario_keys.h"

namespace beltgrip::sim {

using RigScenarioResult = ScenarioResult<RigScenario>;

// Layers in order, later ones on top of paper-rig, which is always the first.
RigScenarioResult parse_rig_scenario(const std::vector<ScenarioLayer>& layers);

}  // namespace beltgrip::sim
