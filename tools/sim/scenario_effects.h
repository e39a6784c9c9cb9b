// [effects.ID] of a scenario: what the machine has beyond the nominal one, by the names of the
// table of effects, as in a model file. Tools only.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "estimator/physics/machine_effects.h"
#include "tools/sim/scenario_reader.h"

namespace beltgrip::sim {

class ScenarioEffects {
 public:
  void name(ScenarioReader& reader);
  // Once all layers are read. An effect that needs a role and has none is an error.
  void put(ScenarioReader& reader, estimator::MachineEffects& machine) const;

 private:
  std::vector<double> values_;                // of each row of the table
  std::map<std::string, std::string> roles_;  // of each effect that has any
};

}  // namespace beltgrip::sim
