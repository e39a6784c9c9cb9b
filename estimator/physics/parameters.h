// What the estimator is told: the variator's physics, sensor accuracy and the method. Plain values
// with the defaults of the configuration file (its sections [variator], [sensors], [estimator],
// [experiment]).
#pragma once

#include <numbers>

namespace beltgrip::estimator {

enum class EndStop { kOverdrive, kLow };
enum class RatioChoice { kOverdrive, kLow, kEither };  // kEither: the stop nearest at the start
enum class Method { kRobust, kPaper };
enum class StopRule { kPeak, kConfidence };
// What the paper's text leaves open, see paper/paper_estimator.h.
enum class Reopening { kHeldSlope, kInitialSlope, kPaused };
enum class PeakSamples { kAll, kLast };
enum class Direction { kDrive, kOverrun };  // sign of the primary torque: +, -

struct VariatorParameters {
  double half_wedge_angle_rad = 11.0 * std::numbers::pi / 180.0;  // theta
  double ratio_low = 0.405;  // r_g0 at the end stops, secondary speed / primary speed
  double ratio_overdrive = 2.25;
  double primary_radius_overdrive_m = 0.0784;  // R_p at the end stops
  double primary_radius_low_m = 0.0324;
  double secondary_piston_area_m2 = 0.0113;
  double secondary_spring_force_N = 500.0;
  double secondary_centrifugal_N_s2 = 0.0;  // F_s = A p_s + spring + this * omega_s^2
  double primary_inertia_kg_m2 = 0.0;       // T_p = T_engine - J d(omega_p)/dt, engine torque only
  // MinClampForce = safety_factor (|T_p| + torque_reserve_Nm) cos(theta) / (2 R_p mu_max)
  double safety_factor = 1.3;
  double torque_reserve_Nm = 0.0;
};

// 1 sigma of a constant error of a channel, in SI; 0 = exact.
struct ChannelAccuracy {
  double bias = 0.0;  // rad/s, Pa, N m
  double gain = 0.0;  // relative
};

struct SensorAccuracies {
  ChannelAccuracy omega_p;
  ChannelAccuracy omega_s;
  ChannelAccuracy secondary_pressure;
  ChannelAccuracy torque;  // of the torque role in use
};

struct EstimatorSettings {
  Method method = Method::kRobust;
  RatioChoice ratio = RatioChoice::kOverdrive;
  StopRule stop_rule = StopRule::kPeak;
  bool torque_is_engine = true;  // role engine_torque (inertia compensated) or primary_torque
  double sample_rate_hz = 200.0;
  double pressure_step_Pa = 0.0;  // least change that the secondary pressure's signal can show
  // Where constants or accuracies are assumed (assumed_constants.h), what is read may be off by
  // this factor, and is weighed afterwards; else 1.
  double reading_reach = 1.0;
  double ramp_rate_max_N_per_s = 600.0;
  // kConfidence: the 95 % interval of mu_max, as a share of it, at which the experiment ends.
  double confidence_width = 0.15;
  // method "robust": share of mu_max that half of its 95 % interval by noise may be for a value.
  double value_width = 0.05;
  // method "paper" only
  double lowpass_hz = 5.0;
  double window_s = 1.0;               // T
  double slope_variance = 5e-3;        // q_k per sample at 200 Hz, scaled by 200 / sample_rate_hz
  double offset_variance = 0.5;        // q_mu0, likewise
  double excitation_threshold = 0.05;  // c_v, (percent slip)^2
  double stop_slope = -1e-3;           // c_k, 1 / percent slip
  double peak_slope = 1e-3;            // c_m, 1 / percent slip
  double initial_slope = 0.015;        // k(0), 1 / percent slip
  double initial_variance = 1e4;       // P(0), in units of R
  Reopening reopening = Reopening::kHeldSlope;
  PeakSamples peak_samples = PeakSamples::kAll;
};

}  // namespace beltgrip::estimator
