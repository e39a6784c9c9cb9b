// What a car has around its variator: plain values in SI, as read from a scenario file. The values
// themselves are in tools/scenarios/coast-overdrive.toml, which every other vehicle scenario is
// laid on. Simulation only.
#pragma once

#include <vector>

#include "tools/sim/world.h"

namespace beltgrip::sim {

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

// What BeltGrip's configuration says of the vehicle beside its geometry.
struct KnownOfVehicle {
  bool steady = false;            // trigger "steady" instead of "coast_down"
  double torque_offset_Nm = 0.0;  // added to the torque signal: what it leaves out
  // One standard deviation each.
  double torque_bias_Nm = 0.0;
  double torque_gain = 0.0;
  double pressure_bias_Pa = 0.0;
  double pressure_gain = 0.0;
  double ramp_rate_max_N_per_s = 0.0;  // 0: the daemon's default
  double cooldown_s = 0.0;
  double cooldown_m = 0.0;
};

struct VehicleScenario : World {
  BeltParameters belt;
  EngineParameters engine;
  VehicleBody body;
  HydraulicParameters hydraulics;
  TcuParameters tcu;
  DriverParameters driver;
  KnownOfVehicle known;
};

}  // namespace beltgrip::sim
