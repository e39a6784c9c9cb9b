// The panel: virtual variators, drawn at random, and the traces that their sensors would give.
// Independent of the estimator and of the simulator of tools/: only the geometry's numbers are the
// same. SI, slip in percent.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "estimator/physics/parameters.h"
#include "estimator/physics/variator_sample.h"
#include "friction_curve.h"

namespace beltgrip::panel {

enum class NoiseClass { kLab, kProduction, kHarsh };
inline constexpr int kNoiseClasses = 3;
const char* noise_name(NoiseClass noise);

enum class PlantKind { kRig, kRigHeavy, kCarSensor, kCarEngine };
const char* plant_name(PlantKind plant);

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
  double sample_rate_hz = 200.0;
  ChannelNoise omega_p, omega_s, pressure, torque;
  Disturbance disturbance = Disturbance::kNone;
  double disturbed_from = 0.0;  // of mu_max
  double disturbed_by = 0.0;    // relative: fall of friction, of the ratio, rise of the torque's
                                // reading; amplitude of the speeds' readings (rattle)
  // Constant errors of the sensors, as drawn: measured = (1 + gain) true + bias.
  estimator::SensorAccuracies planted;
  // The widths they were drawn with: what the user configures.
  estimator::SensorAccuracies accuracies;
};

struct Trace {
  std::vector<estimator::VariatorSample> samples;
  // Truth at each sample; slip in terms of sigma* (deformation included), in the torque's
  // direction.
  std::vector<double> slip_star, slip, mu, clamp_N, torque_belt_Nm;
  bool peak_reached = false;  // true slip went past the peak
  double t_reached_s = 1e9;   // mu* first within 0.5 % of its peak
  double t_peak_s = 1e9;
  double slip_star_peak = 0.0;   // sigma* at the peak
  double slip_star_leave = 0.0;  // sigma* where mu* has left the top by 0.5 % (end of trace: last)
  double mu_largest = 0.0;       // largest mu that was reached
};

// A trace of the panel; the seed says all. force_noise < 0: drawn as well.
Scenario draw_scenario(std::uint64_t seed);
// The paper's experiment: 105 rad/s, 50 Nm, -26 N/s, overdrive; a tanh rise to 0.105 or 0.100 at
// about 2 % and a linear fall, lab noise.
Scenario paper_scenario(std::uint64_t seed, double mu_max);
void set_noise(Scenario& scenario, NoiseClass noise);
// Draws constant sensor errors with the widths that a careful user would configure.
void plant_sensor_errors(Scenario& scenario);
// Draws when and how much.
void plant_disturbance(Scenario& scenario, Disturbance disturbance);
// mu_max at the end: after a step of the friction.
double mu_max_of(const Scenario& scenario);
Trace simulate(const Scenario& scenario);
std::string describe(const Scenario& scenario);

}  // namespace beltgrip::panel
