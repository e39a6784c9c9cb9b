// One trace of the panel as drawn: belt, machine, sensors and what goes wrong. SI, slip in percent.
#pragma once

#include <cstdint>
#include <string>

#include "estimator/physics/parameters.h"
#include "friction_curve.h"

namespace beltgrip::panel {

enum class NoiseClass { kLab, kProduction, kHarsh };
inline constexpr int kNoiseClasses = 3;
const char* noise_name(NoiseClass noise);

enum class PlantKind { kRig, kRigHeavy, kCarSensor, kCarEngine };
const char* plant_name(PlantKind plant);
inline bool is_car(PlantKind plant) {
  return plant == PlantKind::kCarSensor || plant == PlantKind::kCarEngine;
}

// What goes wrong for good in the middle of an experiment, once mu* has come to a share of its top.
enum class Disturbance { kNone, kFriction, kRatio, kTorque, kRattle };
inline constexpr int kDisturbances = 5;
const char* disturbance_name(Disturbance disturbance);

struct ChannelNoise {
  double white = 0.0;    // standard deviation of each frame's value
  double quantum = 0.0;  // then rounded to this
  double frame_rate_hz = 0.0;
  double ripple = 0.0;  // relative, once per turn of the shaft (speeds)
};

struct Scenario {
  std::uint64_t seed = 0;
  FrictionCurve curve;
  estimator::VariatorParameters variator;  // as configured
  bool overrun = false;
  bool low = false;
  PlantKind plant = PlantKind::kRig;
  NoiseClass noise = NoiseClass::kLab;
  double torque_Nm = 50.0;  // magnitude at the primary
  double omega_p_rad_s = 105.0;
  double ramp_N_per_s = 26.0;
  double deformation_per_N = 0.0;  // relative fall of r_g per N
  double secondary_inertia = 0.5;  // kg m^2 (rig: that of the load machine; car: the vehicle)
  double mu_start = 0.06;
  double mu_floor = 1e9;        // the ramp ends where this would be reached
  double hold_s = 2.0;          // before the ramp
  double take_up_s = 0.0;       // torque rises from 0 over this time at the start
  double load_variation = 0.0;  // relative, slow
  double hydraulic_lag_s = 0.08;
  double torque_lag_s = 0.0;        // of the reading
  double primary_loss_share = 0.0;  // of the torque, at the speed of the start; grows with speed
  double secondary_loss_share = 0.0;
  double sample_rate_hz = 200.0;
  ChannelNoise omega_p, omega_s, pressure, torque;
  Disturbance disturbance = Disturbance::kNone;
  double disturbed_from = 0.0;  // of its top
  double disturbed_by = 0.0;    // relative: fall of friction, of the ratio, rise of the torque's
                                // reading; amplitude of the speeds' readings (rattle)
  // Constant errors of the sensors, as drawn: measured = (1 + gain) true + bias.
  estimator::SensorAccuracies planted;
  // The widths they were drawn with: what the user configures.
  estimator::SensorAccuracies accuracies;
};

// The end stop in use.
struct Point {
  double radius, ratio, sign, cosine;
};
Point point_of(const Scenario& scenario);
std::string describe(const Scenario& scenario);

}  // namespace beltgrip::panel
