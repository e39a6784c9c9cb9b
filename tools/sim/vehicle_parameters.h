// What a virtual vehicle is made of: plain values in SI, as read from a scenario file. The values
// themselves are in tools/scenarios/coast-overdrive.toml, which every other vehicle scenario is
// laid on. Simulation only.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "estimator/physics/machine_effects.h"
#include "tools/sim/fault_script.h"
#include "tools/sim/friction_curve.h"

namespace beltgrip::sim {

struct VariatorParameters {
  double belt_length_m = 0.0;
  double centre_distance_m = 0.0;
  double half_wedge_angle_rad = 0.0;
  double ratio_low = 0.0;  // geometric ratio R_p / R_s at the end stops, no force
  double ratio_overdrive = 0.0;
  double deformation_per_N = 0.0;   // r_g falls by this share per N of secondary force
  double deformation_per_Nm = 0.0;  // and per Nm of belt torque
  double secondary_piston_area_m2 = 0.0;
  double secondary_spring_force_N = 0.0;
  double secondary_centrifugal_N_s2 = 0.0;
  double primary_piston_area_m2 = 0.0;
  double primary_centrifugal_N_s2 = 0.0;
  double primary_inertia_kg_m2 = 0.0;  // pulley and turbine, without the engine
  double secondary_inertia_kg_m2 = 0.0;
  double primary_loss_Nm = 0.0;        // bearings, between shaft and belt
  double primary_loss_Nm_per_N = 0.0;  // and in proportion to the clamp
  double secondary_loss_Nm = 0.0;
  double secondary_loss_Nm_s = 0.0;
  double shift_gain = 0.0;         // Delta of variator-facts 3.4
  double force_ratio_slope = 0.0;  // ln(F_p / F_s) in equilibrium per ln(r_g)
  double force_ratio_load = 0.0;   // and per share of the torque capacity in use
};

struct BeltParameters {
  FrictionCurve overdrive;     // curve at 80 degC, 3 kN, 105 rad/s
  double low_mu_factor = 1.0;  // peak in LOW over peak in overdrive
  double low_peak_slip_percent = 0.0;
  double temperature_per_K = 0.0;
  double speed_per_ln = 0.0;
  double load_exponent = 0.0;  // mu ~ (F / 3 kN)^-n
  double wear_step = 0.0;      // share of mu lost at
  double wear_at_s = 0.0;
};

struct EngineParameters {
  double inertia_kg_m2 = 0.0;
  double torque_max_Nm = 0.0;
  double overrun_torque_Nm = 0.0;  // drag of the fuel-cut engine at 150 rad/s, positive number
  double overrun_slope_Nm_s = 0.0;
  double idle_rad_s = 0.0;
  double fuel_cut_above_rad_s = 0.0;
  double stall_rad_s = 0.0;
  double torque_lag_s = 0.0;
  double torque_rise_Nm_s = 0.0;  // pedal steps are shaped to this
  double accessories_Nm = 0.0;    // pump and alternator, not in the torque signal
};

struct VehicleBody {
  double mass_kg = 0.0;
  double wheel_radius_m = 0.0;
  double final_drive = 0.0;
  double rolling_resistance = 0.0;
  double drag_area_m2 = 0.0;
  double grade_percent = 0.0;
};

struct HydraulicParameters {
  double lag_s = 0.0;
  double dead_time_s = 0.0;
  double cold_factor = 0.0;        // lag and dead time at 0 degC over those at 60 degC and above
  double pressure_floor_Pa = 0.0;  // what the valve cannot go below
  double pressure_max_Pa = 0.0;
  double friction_force_N = 0.0;  // Coulomb friction of cylinder and spline
  double oil_start_degC = 0.0;
  double oil_end_degC = 0.0;
  double oil_warming_s = 0.0;
};

struct TcuParameters {
  double cycle_s = 0.0;
  double torque_reserve_Nm = 0.0;
  double design_friction = 0.0;
  double force_floor_N = 0.0;  // for requests
  double force_fall_max_N_per_s = 0.0;
  double own_fall_max_N_per_s = 0.0;      // of its own force
  double coast_engine_speed_rad_s = 0.0;  // ratio schedule: primary speed at zero pedal
  double full_engine_speed_rad_s = 0.0;   // and at full pedal
  double lockup_above_m_s = 0.0;
  double oil_permit_degC = 0.0;
};

struct DriverStep {
  double at_s = 0.0;
  double hold_speed_m_s = 0.0;  // > 0: holds this speed with the pedal; else the pedal below
  double accelerator = 0.0;     // 0 to 1
  double brake_m_s2 = 0.0;
};

enum class DriverPattern { kSteps, kCity };

struct DriverParameters {
  DriverPattern pattern = DriverPattern::kSteps;
  double start_speed_m_s = 0.0;
  std::vector<DriverStep> steps;  // in order of time
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
  double frame_delay_s = 0.0;
  double frame_jitter_s = 0.0;
};

// What BeltGrip's configuration says of the vehicle beside its geometry.
struct KnownOfVehicle {
  bool steady = false;            // trigger "steady" instead of "coast_down"
  double torque_offset_Nm = 0.0;  // added to the torque signal: what it leaves out
  // One standard deviation each.
  double torque_bias_Nm = 0.0;
  double torque_gain = 0.0;
  double pressure_bias_Pa = 0.0;
  double pressure_gain = 0.0;
  double cooldown_s = 0.0;
  double cooldown_m = 0.0;
};

struct VehicleScenario {
  std::string name;
  double duration_s = 0.0;
  double step_s = 0.0;
  VariatorParameters variator;
  BeltParameters belt;
  EngineParameters engine;
  VehicleBody body;
  HydraulicParameters hydraulics;
  TcuParameters tcu;
  DriverParameters driver;
  SensorParameters sensors;
  KnownOfVehicle known;
  std::vector<FaultStep> faults;
  // What the machine has beyond the above; a model file says it. The controller does not know.
  estimator::MachineEffects effects;
  int experiment = 0;  // its place among several, for wear
};

}  // namespace beltgrip::sim
