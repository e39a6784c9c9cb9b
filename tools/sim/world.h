// What a rig and a car have alike: the variator, its sensors, the faults of both, and the run.
// Plain values in SI, as read from a scenario file. Simulation only.
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "estimator/physics/learned_term.h"
#include "estimator/physics/machine_effects.h"
#include "tools/sim/fault_script.h"
#include "tools/sim/friction_curve.h"

namespace beltgrip::sim {

// The scenario files of either, laid on its own base.
enum class Plant { kRig, kVehicle };

struct VariatorParameters {
  double belt_length_m = 0.0;
  double centre_distance_m = 0.0;
  double half_wedge_angle_rad = 0.0;
  double ratio = 0.0;      // of a rig: geometric ratio R_p / R_s of its end stop, no force
  double ratio_low = 0.0;  // of a car: the same at both end stops
  double ratio_overdrive = 0.0;
  double deformation_per_N = 0.0;   // r_g falls by this share per N of secondary force
  double deformation_per_Nm = 0.0;  // and per Nm of belt torque
  double secondary_piston_area_m2 = 0.0;
  double secondary_spring_force_N = 0.0;
  double secondary_centrifugal_N_s2 = 0.0;
  double primary_piston_area_m2 = 0.0;
  double primary_centrifugal_N_s2 = 0.0;
  double primary_inertia_kg_m2 = 0.0;  // pulley and turbine, or all that turns with a rig's pulley
  double secondary_inertia_kg_m2 = 0.0;  // pulley, or pulley and load machine
  double primary_loss_Nm = 0.0;          // bearings, between shaft and belt
  double primary_loss_Nm_per_N = 0.0;    // and in proportion to the clamp
  double secondary_loss_Nm = 0.0;        // bearings and seals, at any speed
  double secondary_loss_Nm_s = 0.0;      // and in proportion to speed
  double secondary_loss_Nm_per_N = 0.0;  // and to the clamp: a rig's, as a model of it says
  double shift_gain = 0.0;               // Delta of variator-facts 3.4
  double force_ratio_slope = 0.0;        // ln(F_p / F_s) in equilibrium per ln(r_g)
  double force_ratio_load = 0.0;         // and per share of the torque capacity in use
};

struct ChannelError {
  double noise = 0.0;  // one standard deviation, SI
  double bias = 0.0;
  double gain = 0.0;
  double delay_s = 0.0;
  double resolution = 0.0;  // SI; 0: that of the DBC
};

struct SensorParameters {
  ChannelError primary_speed, secondary_speed, engine_speed, torque, pressure, temperature;
  double primary_ripple = 0.0;  // amplitude once per turn, share of the speed
  double secondary_ripple = 0.0;
  double lag_s = 0.0;  // of every signal, beside its own delay
  double frame_delay_s = 0.0;
  double frame_jitter_s = 0.0;
  double pressure_period_s = 0.0;  // of the secondary pressure's message; 0: that of the DBC

  // What a model file says of the measuring chain. A channel that leads makes all others lag.
  void add(const estimator::MachineEffects& effects) {
    lag_s += std::max({0.0, -effects.primary_speed_delay_s, -effects.secondary_speed_delay_s,
                       -effects.torque_delay_s, -effects.pressure_delay_s});
    primary_speed.delay_s += effects.primary_speed_delay_s;
    secondary_speed.delay_s += effects.secondary_speed_delay_s;
    torque.delay_s += effects.torque_delay_s;
    pressure.delay_s += effects.pressure_delay_s;
    primary_speed.gain += effects.primary_speed_scale;
    secondary_speed.gain += effects.secondary_speed_scale;
    torque.gain += effects.torque_gain;
    torque.bias += effects.torque_bias_Nm;
    pressure.gain += effects.pressure_gain;
    pressure.bias += effects.pressure_offset_Pa;
    primary_ripple += effects.primary_ripple;
    secondary_ripple += effects.secondary_ripple;
  }
};

struct World {
  std::string name;
  double duration_s = 0.0;
  double step_s = 0.0;
  VariatorParameters variator;
  SensorParameters sensors;
  std::vector<FaultStep> faults;
  // What the machine has beyond the above; a model file says it. No controller knows.
  estimator::MachineEffects effects;
  std::vector<estimator::LearnedTerm> learned;  // the same, what has no name
  int experiment = 0;                           // its place among several, for wear
};

}  // namespace beltgrip::sim
