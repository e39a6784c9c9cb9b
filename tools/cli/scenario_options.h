// The options that choose and change a scenario, shared by simulate and run-demo. Tools only.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "daemon/command_line/command_line.h"
#include "tools/sim/rig_scenario.h"
#include "tools/sim/vehicle_parameters.h"

namespace beltgrip::cli {

struct ScenarioOptions {
  std::string scenario = "paper-rig";
  std::string belt;
  std::uint64_t seed = 1;
  double start_s = 0.0;
  double duration_s = 0.0;  // 0: to the end
  std::vector<std::string> settings;

  void add_to(command_line::Command command);
  // Throws Failure: 66 no such scenario, 78 its content.
  sim::RigScenario load() const;
  // True for a scenario of the virtual vehicle, which load_vehicle takes instead.
  bool is_vehicle() const;
  sim::VehicleScenario load_vehicle() const;
  double end_s() const;
};

}  // namespace beltgrip::cli
