// A scenario of the simulation: TOML with physical names, checked key by key against a table and
// then as a whole. Every message names file, line, key and the physical reason. Tools only.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "estimator/physics/machine_effects.h"
#include "tools/sim/friction_curve.h"
#include "tools/sim/variator_plant.h"

namespace beltgrip::sim {

enum class OperatorAction { kRestore, kHold, kNone };

// Values come from the scenario files alone: what a file leaves out is the paper rig's.
struct Scenario {
  std::string name;
  std::string belt;
  std::map<std::string, FrictionCurve> belts;

  VariatorModel variator;
  double secondary_piston_area_m2 = 0.0;
  double secondary_spring_force_N = 0.0;

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
  double restore_N_per_s = 0.0;
  double rest_s = 0.0;

  double duration_s = 0.0;
  double step_s = 0.0;
  double cycles = 0.0;
  double oil_degC = 0.0;

  double primary_speed_noise_rad_s = 0.0;
  double secondary_speed_noise_rad_s = 0.0;
  double torque_noise_Nm = 0.0;
  double torque_bias_Nm = 0.0;
  double pressure_noise_Pa = 0.0;
  double pressure_bias_Pa = 0.0;
  double frame_delay_s = 0.0;
  double frame_jitter_s = 0.0;

  // What the machine and its sensors have beyond the above; a model file says it.
  estimator::MachineEffects effects;
  int experiment = 0;  // its place among several, for wear

  const FrictionCurve& friction() const { return belts.at(belt); }
};

struct ScenarioResult {
  Scenario scenario;
  std::vector<std::string> errors;  // empty: the scenario can run
};

struct ScenarioLayer {
  std::string source;  // name for messages
  std::string text;    // TOML
};

// Layers in order, later ones on top: the paper rig, a file, the command line's settings.
ScenarioResult parse_scenario(const std::vector<ScenarioLayer>& layers);

// "key=value" of the command line as a layer; text needs no quotes there.
ScenarioLayer setting_layer(const std::string& key_and_value);

}  // namespace beltgrip::sim
