// What a rig has around its variator: plain values in SI, as read from a scenario file. The values
// themselves are in tools/scenarios/paper-rig.toml, which every other rig's scenario is laid on.
// Simulation only.
#pragma once

#include <map>
#include <string>

#include "tools/sim/world.h"

namespace beltgrip::sim {

enum class OperatorAction { kRestore, kHold, kNone };

struct RigScenario : World {
  std::string belt;
  std::map<std::string, FrictionCurve> belts;

  double primary_speed_rad_s = 0.0;
  double primary_torque_Nm = 0.0;
  double speed_controller_Nm_s = 0.0;  // proportional gain
  double speed_controller_Nm = 0.0;    // integral gain

  double start_force_N = 0.0;
  double hold_s = 0.0;
  double ramp_N_per_s = 0.0;
  double actuator_lag_s = 0.0;

  OperatorAction action = OperatorAction::kRestore;
  double operator_slip_percent = 0.0;
  double reaction_s = 0.0;
  double grip_step_N = 0.0;  // at once, before the force returns by its rate
  double restore_N_per_s = 0.0;
  double rest_s = 0.0;

  double cycles = 0.0;
  double oil_degC = 0.0;

  const FrictionCurve& friction() const { return belts.at(belt); }
};

}  // namespace beltgrip::sim
