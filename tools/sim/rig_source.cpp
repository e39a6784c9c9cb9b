#include "tools/sim/rig_source.h"

#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>

#include "can_dbc/dbc/parser.h"
#include "estimator/physics/variator_geometry.h"
#include "tools/sim/resources.h"

namespace beltgrip::sim {

RigSource::RigSource(const Scenario& scenario, std::uint64_t seed, double start_s, double end_s)
    : seed_(seed),
      simulation_(scenario),
      bus_(rig_database(), scenario, seed),
      start_ns_(std::llround(start_s * 1e9)),
      end_ns_(end_s < 9e9 ? std::llround(end_s * 1e9) : std::numeric_limits<std::int64_t>::max()) {}

bool RigSource::next(can::StampedFrame& frame) {
  for (;;) {
    while (taken_ == waiting_.size()) {
      if (simulation_.finished() || simulation_.now_ns() >= end_ns_) return false;
      waiting_.clear();
      taken_ = 0;
      bus_.sample(simulation_.now_ns(), simulation_.step_ns(), simulation_.signals(), waiting_);
      simulation_.step();
      if (!simulation_.finite()) {
        throw NonFiniteState{seed_, static_cast<double>(simulation_.now_ns()) * 1e-9};
      }
    }
    frame = waiting_[taken_++];
    if (frame.t_ns >= start_ns_) return true;
  }
}

const can::Database& rig_database() {
  static const can::Database database = can::parse_dbc(shipped("paper-rig.dbc")).database;
  return database;
}

std::string rig_configuration(const Scenario& scenario, const std::string& interface,
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
      scenario.secondary_piston_area_m2, scenario.secondary_spring_force_N,
      scenario.cycles > 1.5 ? "signal" : "always", stop);
  return text;
}

}  // namespace beltgrip::sim
