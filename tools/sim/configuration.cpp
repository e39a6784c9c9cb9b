#include "tools/sim/configuration.h"

#include <algorithm>
#include <cstdio>
#include <numbers>
#include <string_view>

#include "can_dbc/dbc/parser.h"
#include "estimator/physics/variator_geometry.h"
#include "tools/sim/resources.h"

namespace beltgrip::sim {

namespace {

constexpr std::string_view kSlowSpeed = "(0.0625,0) [0|4095.875]",
                           kFastSpeed = "(0.125,0) [0|8191.75]";
constexpr double kSlowMost_rpm = 4095.875;
// Chosen: what ripple, noise, a wrong scale and the way to the set speed add to it.
constexpr double kReserve = 1.1;

bool is_fast(const RigScenario& scenario) {
  const double fastest_rad_s =
      scenario.primary_speed_rad_s * std::max(1.0, scenario.variator.ratio);
  return kReserve * fastest_rad_s * 30.0 / std::numbers::pi > kSlowMost_rpm;
}

std::string fast_dbc() {
  std::string text(shipped("paper-rig.dbc"));
  for (std::size_t at = text.find(kSlowSpeed); at != std::string::npos;
       at = text.find(kSlowSpeed, at)) {
    text.replace(at, kSlowSpeed.size(), kFastSpeed);
  }
  return text;
}

}  // namespace

std::string rig_dbc(const RigScenario& scenario) {
  return is_fast(scenario) ? fast_dbc() : std::string(shipped("paper-rig.dbc"));
}

const can::Database& rig_database() {
  static const can::Database database =
      can::parse_dbc(std::string(shipped("paper-rig.dbc"))).database;
  return database;
}

const can::Database& rig_database(const RigScenario& scenario) {
  if (!is_fast(scenario)) return rig_database();
  static const can::Database fast = can::parse_dbc(fast_dbc()).database;
  return fast;
}

std::string rig_configuration(const RigScenario& scenario, const std::string& interface,
                              const std::string& dbc_file) {
  const auto& v = scenario.variator;
  const auto radii = estimator::running_radii(v.ratio, v.belt_length_m, v.centre_distance_m);
  const char* const stop = v.ratio < 1.0 ? "low" : "overdrive";
  char text[2200];
  std::snprintf(
      text, sizeof text,
      "# BeltGrip on the simulated rig (scenario %s).\n"
      "\n"
      "[bus]\n"
      "interface = \"%s\"\n"
      "dbc       = [\"%s\"]\n"
      "\n"
      "[signals]\n"
      "primary_speed      = \"RIG_Speed.PrimarySpeed\"\n"
      "secondary_speed    = \"RIG_Speed.SecondarySpeed\"\n"
      "secondary_pressure = \"RIG_Pressure.SecondaryPressure\"\n"
      "primary_torque     = \"RIG_Torque.PrimaryTorque\"      # a torque flange: measured\n"
      "secondary_torque   = \"RIG_Torque.SecondaryTorque\"\n"
      "oil_temperature    = \"RIG_State.OilTemperature\"\n"
      "experiment_active  = \"RIG_State.ExperimentActive\"\n"
      "\n"
      "[variator]\n"
      "half_wedge_angle_deg       = %.6g\n"
      "ratio_%s = %.6g\n"
      "primary_radius_%s_m = %.4f\n"
      "secondary_piston_area_m2   = %.6g\n"
      "secondary_spring_force_N   = %.6g\n"
      "secondary_centrifugal_N_s2 = 0\n"
      "\n"
      "[sensors]   # those of a test bench, calibrated against each other\n"
      "primary_speed      = { bias_rad_s = 0, gain = 0 }\n"
      "secondary_speed    = { bias_rad_s = 0, gain = 0 }\n"
      "secondary_pressure = { bias_Pa = 0, gain = 0 }\n"
      "primary_torque     = { bias_Nm = 0, gain = 0 }\n"
      "\n"
      "[estimator]\n"
      "method = \"robust\"\n"
      "\n"
      "[experiment]\n"
      "trigger = \"%s\"\n"
      "control = \"observe\"\n"
      "ratio   = \"%s\"\n",
      scenario.name.c_str(), interface.c_str(), dbc_file.c_str(),
      v.half_wedge_angle_rad * 180.0 / std::numbers::pi, stop, v.ratio, stop, radii.primary_m,
      v.secondary_piston_area_m2, v.secondary_spring_force_N,
      scenario.cycles > 1.5 ? "signal" : "always", stop);
  return text;
}

const can::Database& vehicle_database() {
  static const can::Database database =
      can::parse_dbc(std::string(shipped("vehicle.dbc"))).database;
  return database;
}

std::string vehicle_configuration(const VehicleScenario& scenario, const std::string& interface,
                                  const std::string& dbc_file) {
  const VariatorParameters& v = scenario.variator;
  const KnownOfVehicle& known = scenario.known;
  const auto radius = [&v](double ratio) {
    return estimator::running_radii(ratio, v.belt_length_m, v.centre_distance_m).primary_m;
  };
  const double period_s = scenario.sensors.pressure_period_s;
  char pressure[80];
  std::snprintf(pressure, sizeof pressure,
                period_s > 0.0 ? "{ signal = \"TCU_Pressure.SecondaryPressure\", period_ms = %.6g }"
                               : "\"TCU_Pressure.SecondaryPressure\"",
                1e3 * period_s);
  char ramp[60] = "";
  if (known.ramp_rate_max_N_per_s > 0.0) {
    std::snprintf(ramp, sizeof ramp, "ramp_rate_max_N_per_s       = %.6g\n",
                  known.ramp_rate_max_N_per_s);
  }
  char text[4096];
  std::snprintf(text, sizeof text,
                "# BeltGrip in the simulated vehicle (scenario %s).\n"
                "\n"
                "[bus]\n"
                "interface = \"%s\"\n"
                "dbc       = [\"%s\"]\n"
                "\n"
                "[signals]\n"
                "primary_speed        = \"TCU_Speed.PrimarySpeed\"\n"
                "secondary_speed      = \"TCU_Speed.SecondarySpeed\"\n"
                "secondary_pressure   = %s\n"
                "engine_torque        = { signal = \"ECU_Engine.EngineTorque\", offset = %.6g }\n"
                "engine_speed         = \"ECU_Engine.EngineSpeed\"\n"
                "accelerator_pedal    = \"ECU_Engine.AcceleratorPedal\"\n"
                "oil_temperature      = \"TCU_State.OilTemperature\"\n"
                "lockup_closed        = \"TCU_State.LockupClosed\"\n"
                "experiment_permitted = \"TCU_State.ExperimentPermitted\"\n"
                "vehicle_speed        = \"ESP_Vehicle.VehicleSpeed\"\n"
                "brake_pressed        = \"ESP_Vehicle.BrakePressed\"\n"
                "\n"
                "[protection]\n"
                "ECU_Engine   = { counter = \"EngineCounter\", crc = \"EngineCrc\", data_id = "
                "0x110 }\n"
                "TCU_Speed    = { counter = \"SpeedCounter\", crc = \"SpeedCrc\", data_id = 0x120 "
                "}\n"
                "TCU_Pressure = { counter = \"PressureCounter\", crc = \"PressureCrc\", data_id = "
                "0x130 }\n"
                "TCU_State    = { counter = \"StateCounter\", crc = \"StateCrc\", data_id = 0x140 "
                "}\n"
                "ESP_Vehicle  = { counter = \"VehicleCounter\", crc = \"VehicleCrc\", data_id = "
                "0x210 }\n"
                "\n"
                "[sensors]\n"
                "primary_speed      = { bias_rad_s = 0, gain = 0 }\n"
                "secondary_speed    = { bias_rad_s = 0, gain = 0 }\n"
                "engine_torque      = { bias_Nm = %.6g, gain = %.6g }\n"
                "secondary_pressure = { bias_Pa = %.6g, gain = %.6g }\n"
                "\n"
                "[variator]\n"
                "half_wedge_angle_deg       = %.6g\n"
                "ratio_low                  = %.6g\n"
                "ratio_overdrive            = %.6g\n"
                "primary_radius_overdrive_m = %.5f\n"
                "primary_radius_low_m       = %.5f\n"
                "secondary_piston_area_m2   = %.6g\n"
                "secondary_spring_force_N   = %.6g\n"
                "secondary_centrifugal_N_s2 = %.6g\n"
                "primary_inertia_kg_m2      = %.6g\n"
                "\n"
                "[experiment]\n"
                "trigger = \"%s\"\n"
                "control = \"command\"\n"
                "ratio   = \"either\"\n"
                "secondary_pressure_floor_Pa = %.6g\n"
                "actuator_dead_time_s        = %.6g\n"
                "actuator_lag_s              = %.6g\n"
                "cooldown_s                  = %.6g\n"
                "cooldown_m                  = %.6g\n"
                "%s",
                scenario.name.c_str(), interface.c_str(), dbc_file.c_str(), pressure,
                known.torque_offset_Nm, known.torque_bias_Nm, known.torque_gain,
                known.pressure_bias_Pa, known.pressure_gain,
                v.half_wedge_angle_rad * 180.0 / std::numbers::pi, v.ratio_low, v.ratio_overdrive,
                radius(v.ratio_overdrive), radius(v.ratio_low), v.secondary_piston_area_m2,
                v.secondary_spring_force_N, v.secondary_centrifugal_N_s2,
                scenario.engine.inertia_kg_m2 + v.primary_inertia_kg_m2,
                known.steady ? "steady" : "coast_down", scenario.hydraulics.pressure_floor_Pa,
                1.2 * scenario.hydraulics.dead_time_s, 1.2 * scenario.hydraulics.lag_s,
                known.cooldown_s, known.cooldown_m, ramp);
  return text;
}

}  // namespace beltgrip::sim
