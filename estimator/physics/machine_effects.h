// THE table of effects: what a machine and its measuring chain can have beyond the nominal ones.
// Model files, scenarios, the daemon and diagnose read names, bounds and words from here. A further
// effect is a field, a row, its equation in tools/sim and its equation for diagnose
// (tools/diagnose/model/effects) or for the daemon (estimator/signal): the two are compared by a
// test. Any thread.
#pragma once

#include <array>
#include <span>
#include <string_view>

namespace beltgrip::estimator {

// Plain values, SI unless the name says otherwise, zero is off. `true` is what the machine has,
// `measured` what the bus says.
struct MachineEffects {
  // The measuring chain.
  double torque_bias_Nm = 0.0;       // T_measured = T_true + bias
  double torque_gain = 0.0;          // T_measured = (1 + gain) T_true
  double torque_delay_s = 0.0;       // T_measured(t) = T_true(t - delay)
  double pressure_offset_Pa = 0.0;   // p_measured = p_true + offset
  double pressure_gain = 0.0;        // p_measured = (1 + gain) p_true
  double primary_speed_scale = 0.0;  // omega_measured = (1 + x) omega_true
  double secondary_speed_scale = 0.0;
  double primary_ripple = 0.0;  // omega_measured = omega_true (1 + a sin(phi))
  double secondary_ripple = 0.0;
  double primary_speed_delay_s = 0.0;  // x_measured(t) = x_true(t - delay)
  double secondary_speed_delay_s = 0.0;
  double pressure_delay_s = 0.0;
  // Between the measured pressure and the force on the belt.
  double lag_time_constant_s = 0.0;  // tau dp/dt + p = p_measured(t - delay)
  double lag_delay_s = 0.0;
  double centrifugal_N_s2 = 0.0;  // F_true = F_model + c omega_s^2
  double spring_N = 0.0;          // F_true = F_model + force
  double hysteresis_N = 0.0;      // F_true = F_model - force sgn(dF/dt), with play
  // Between the driving shaft and the belt: T_belt = T - constant - per_kN F - per_rad_s omega_p.
  double inertia_kg_m2 = 0.0;  // T_belt = T - J d(omega_p)/dt
  double loss_constant_Nm = 0.0;
  double loss_per_kN_Nm = 0.0;
  double loss_per_rad_s_Nm = 0.0;
  // Behind the belt: T_secondary,measured = T_secondary,belt - constant - per_rad_s omega_s.
  double secondary_loss_constant_Nm = 0.0;
  double secondary_loss_per_rad_s_Nm = 0.0;
  // r_g = r_g0 (1 + end stop) (1 - per_kN F - per_kN2 F^2 - per_Nm T_p)
  double deformation_per_kN = 0.0;
  double deformation_per_kN2 = 0.0;
  double tilt_per_Nm = 0.0;
  double end_stop_low = 0.0;
  double end_stop_overdrive = 0.0;
  double creep_rate = 0.0;  // d(ln r_g)/dt = rate omega_p (fall of ln(F_p / F_s))
  // Friction, all factors on mu.
  double friction_per_K = 0.0;          // 1 + a (theta - 80 degC)
  double friction_per_ln_speed = 0.0;   // 1 + a ln(omega_p / 105)
  double friction_load_exponent = 0.0;  // (F / 3 kN)^-n
  double friction_low_relative = 0.0;   // 1 + a at the low end stop
  double peak_slip_percent = 0.0;       // slip at the peak, overdrive; 0: as nominal
  double fall_per_percent = 0.0;        // of mu beyond the peak, more than nominal
  double wear_step = 0.0;               // 1 - step from one experiment on
  double wear_from = 0.0;
  double wear_per_experiment = 0.0;  // 1 - a i
  double warm_up_per_kJ = 0.0;       // 1 + a E, E slip energy within the experiment
  double warm_up_per_start = 0.0;    // 1 + b (1 - exp(-t / 30 s))
};

// Where an effect acts, in the order of evaluation.
enum class Stage { kMeasurement, kForce, kDriveline, kRatio, kFriction, kSecondaryShaft };

// The `role` of an effect in a file: which channel, or which input, it is of.
struct EffectRole {
  std::string_view role;
  double MachineEffects::*value;  // none: nothing that acts on the machine itself
};

// One parameter of one effect.
struct EffectRow {
  std::string_view id, parameter;  // [effects.ID] parameter = ...
  std::string_view unit;
  double MachineEffects::*value;  // none: one of the roles must say which
  Stage stage;
  double typical;  // size met in practice, one sigma of the prior of a diagnosis; 0: not a size
  // Physical bounds of what a fit may find, of the whole of an effect: no drag that drives, no
  // pulley that grows under force, beyond what the nominal machine has of it.
  double low, high;
  std::string_view equation;
  std::string_view acts_on;     // friction, ratio, torque, clamp force, speed
  std::string_view depends_on;  // what the residual follows
  std::string_view separating;  // the experiment that tells it from its twins
  // Most rows leave it out, and g++ warns of that where it has no initializer.
  // NOLINTNEXTLINE(readability-redundant-member-init)
  std::span<const EffectRole> roles = {};
};

namespace effect_table {
using E = MachineEffects;

inline constexpr std::array<EffectRole, 5> kSkewedChannels{{
    {"primary_speed", &E::primary_speed_delay_s},
    {"secondary_speed", &E::secondary_speed_delay_s},
    {"secondary_pressure", &E::pressure_delay_s},
    {"primary_torque", &E::torque_delay_s},
    {"engine_torque", &E::torque_delay_s},
}};
// Of the command: the measured pressure acts.
inline constexpr std::array<EffectRole, 1> kLagged{{{"command", nullptr}}};

// Sizes: ranges of the literature on pushbelt variators and their sensors. The order is that of
// files and of the fingerprint of a configuration.
inline constexpr std::array kRows{
    EffectRow{"torque_bias", "bias_Nm", "Nm", &E::torque_bias_Nm, Stage::kMeasurement, 3.0, -40.0,
              40.0, "T_measured = T_true + bias", "torque", "nothing",
              "repeat one ramp at two torque levels (20 and 60 Nm), or read the sensor unloaded"},
    EffectRow{"torque_gain", "gain", "", &E::torque_gain, Stage::kMeasurement, 0.05, -0.25, 0.25,
              "T_measured = (1 + gain) T_true", "torque", "torque",
              "step the torque at constant clamp force with secondary_torque recorded"},
    EffectRow{"inertia_torque", "inertia_kg_m2", "kg m^2", &E::inertia_kg_m2, Stage::kDriveline,
              0.05, -1.0, 1.0, "T_belt = T_measured - (J_configured + J) d(omega_p)/dt", "torque",
              "acceleration of primary_speed",
              "accelerate and brake briskly at constant clamp force and torque"},
    EffectRow{"torque_delay", "delay_s", "s", &E::torque_delay_s, Stage::kMeasurement, 0.05, -0.2,
              0.5, "T_measured(t) = T_true(t - delay)", "torque", "rate of torque",
              "torque steps at constant speed and clamp force"},
    EffectRow{"torque_loss", "constant_Nm", "Nm", &E::loss_constant_Nm, Stage::kDriveline, 2.0,
              -1.0, 20.0, "T_belt = T - a", "torque", "nothing",
              "sweep the clamp force at constant torque, and repeat at another speed"},
    EffectRow{"torque_loss", "per_kN_Nm", "Nm/kN", &E::loss_per_kN_Nm, Stage::kDriveline, 0.3, 0.0,
              10.0, "T_belt = T - b F/kN", "torque", "secondary_pressure",
              "sweep the clamp force at constant torque, far from the peak"},
    EffectRow{"torque_loss", "per_rad_s_Nm", "Nm s/rad", &E::loss_per_rad_s_Nm, Stage::kDriveline,
              0.015, -5e-3, 0.5, "T_belt = T - c omega_p", "torque", "primary_speed",
              "sweep the speed at constant torque and clamp force"},
    EffectRow{"centrifugal_force", "coefficient_N_s2", "N s^2", &E::centrifugal_N_s2, Stage::kForce,
              6e-3, -0.05, 0.05, "F_true = F_model + c omega_s^2", "clamp force", "secondary_speed",
              "repeat one ramp at two speeds, one of them 250 rad/s and more"},
    EffectRow{"pressure_offset", "offset_Pa", "Pa", &E::pressure_offset_Pa, Stage::kMeasurement,
              4e4, -2e5, 2e5, "p_measured = p_true + offset", "clamp force", "nothing",
              "read the pressure with the pump off; ramps at two torque levels in one ratio"},
    EffectRow{"pressure_gain", "gain", "", &E::pressure_gain, Stage::kMeasurement, 0.03, -0.25,
              0.25, "p_measured = (1 + gain) p_true", "clamp force", "secondary_pressure",
              "a reference gauge: the gain of the pressure and mu_max are one number in ramps"},
    EffectRow{"spring_force", "force_N", "N", &E::spring_N, Stage::kForce, 300.0, -3000.0, 3000.0,
              "F_true = F_model + force", "clamp force", "nothing",
              "read the pressure with the pump off: a zero there leaves the spring"},
    EffectRow{"hydraulic_lag", "time_constant_s", "s", &E::lag_time_constant_s, Stage::kMeasurement,
              0.1, 0.0, 2.0, "tau dp/dt + p = p_in(t)", "clamp force", "rate of secondary_pressure",
              "clamp steps up and down at two rates below the peak", kLagged},
    EffectRow{"hydraulic_lag", "delay_s", "s", &E::lag_delay_s, Stage::kMeasurement, 0.05, -0.01,
              0.5, "p(t) = p_in(t - delay)", "clamp force", "rate of secondary_pressure",
              "clamp steps up and down at two rates below the peak", kLagged},
    EffectRow{"clamp_hysteresis", "force_N", "N", &E::hysteresis_N, Stage::kForce, 120.0, 0.0,
              1500.0, "F_true = F_model - force sgn(dF/dt), with play", "clamp force",
              "direction of secondary_pressure",
              "the same triangle of the clamp force at two rates: a lag grows with the rate"},
    EffectRow{"pulley_deformation", "per_kN", "1/kN", &E::deformation_per_kN, Stage::kRatio, 2e-3,
              -1e-3, 0.03, "r_g = r_g0 (1 - a F/kN)", "ratio", "secondary_pressure",
              "sweep the clamp force at almost no torque"},
    EffectRow{"pulley_deformation", "per_kN2", "1/kN^2", &E::deformation_per_kN2, Stage::kRatio,
              2e-4, 0.0, 0.005, "r_g = r_g0 (1 - b (F/kN)^2)", "ratio", "secondary_pressure",
              "sweep the clamp force up to its maximum at almost no torque"},
    EffectRow{"radius_tilt", "per_Nm", "1/Nm", &E::tilt_per_Nm, Stage::kRatio, 3e-5, -1e-3, 1e-3,
              "r_g = r_g0 (1 - a T_p)", "ratio", "torque",
              "sweep the clamp force at two torques far below the peak"},
    EffectRow{"end_stop_ratio", "low", "", &E::end_stop_low, Stage::kRatio, 5e-3, -0.08, 0.08,
              "r_g0,true = (1 + x) r_g0,configured", "ratio", "nothing",
              "high clamp force and little torque at both end stops"},
    EffectRow{"end_stop_ratio", "overdrive", "", &E::end_stop_overdrive, Stage::kRatio, 5e-3, -0.08,
              0.08, "r_g0,true = (1 + x) r_g0,configured", "ratio", "nothing",
              "high clamp force and little torque at both end stops"},
    EffectRow{"ratio_creep", "rate", "1/rad", &E::creep_rate, Stage::kRatio, 2e-5, 0.0, 5e-3,
              "d(ln r_g)/dt = rate omega_p (fall of the holding force ratio)", "ratio",
              "primary_pressure",
              "vary primary_pressure at constant secondary_pressure and torque"},
    EffectRow{"friction_temperature", "per_K", "1/K", &E::friction_per_K, Stage::kFriction, 1.5e-3,
              -0.02, 0.02, "mu = mu_nom (1 + a (theta - 80 degC))", "friction", "oil_temperature",
              "the same ramp cold and warm, the warm one both first and last"},
    EffectRow{"friction_speed", "per_ln_speed", "", &E::friction_per_ln_speed, Stage::kFriction,
              0.06, -0.5, 0.5, "mu = mu_nom (1 + a ln(omega_p / 105))", "friction", "primary_speed",
              "the same ramp at two speeds in low ratio"},
    EffectRow{"friction_load", "exponent", "", &E::friction_load_exponent, Stage::kFriction, 0.05,
              -0.6, 0.6, "mu = mu_nom (F / 3 kN)^-n", "friction", "secondary_pressure",
              "ramps to the peak at 15 and 100 Nm in the same ratio"},
    EffectRow{"friction_ratio", "relative", "", &E::friction_low_relative, Stage::kFriction, 0.08,
              -0.6, 0.6, "mu_low = (1 + a) mu_overdrive", "friction", "ratio",
              "ramps at both end stops that reach the peak at the same clamp force"},
    EffectRow{"friction_shape", "peak_slip_percent", "%", &E::peak_slip_percent, Stage::kFriction,
              1.0, -0.8, 4.0, "slip at the peak is (1 + x) the nominal", "friction", "slip",
              "a slow ramp through the peak"},
    EffectRow{"friction_shape", "fall_per_percent", "1/%", &E::fall_per_percent, Stage::kFriction,
              0.15, -1.0, 1.0, "fall of mu beyond the peak differs from the nominal", "friction",
              "slip", "a slow ramp through the peak, stopped late"},
    EffectRow{"wear", "step", "", &E::wear_step, Stage::kFriction, 0.05, -0.5, 0.5,
              "mu = mu_nom (1 - step) from one experiment on", "friction", "experiment",
              "repeat the first experiment three times at the end"},
    EffectRow{"wear", "at", "", &E::wear_from, Stage::kFriction, 0.0, 0.0, 0.0,
              "the first experiment that is worn, from 0", "friction", "experiment", ""},
    EffectRow{
        "wear", "per_experiment", "", &E::wear_per_experiment, Stage::kFriction, 8e-3, -0.1, 0.1,
        "mu = mu_nom (1 - a i)", "friction", "experiment",
        "repeat the first experiment in the middle and at the end, temperature as in the first"},
    EffectRow{"warm_up_drift", "per_kJ", "1/kJ", &E::warm_up_per_kJ, Stage::kFriction, 0.02, -0.5,
              0.5, "mu = mu_nom (1 + a E), E slip energy within the experiment", "friction",
              "slip energy", "one ramp at once and one after a minute of idling"},
    EffectRow{"warm_up_drift", "per_start", "", &E::warm_up_per_start, Stage::kFriction, 0.04, -0.5,
              0.5, "mu = mu_nom (1 + b (1 - exp(-t/30 s)))", "friction", "time",
              "one ramp at once and one after a minute of idling"},
    EffectRow{"speed_scale", "primary", "", &E::primary_speed_scale, Stage::kMeasurement, 5e-3,
              -0.08, 0.08, "omega_measured = (1 + x) omega_true", "speed", "primary_speed",
              "high clamp force and little torque at both end stops: a speed scale shows the same "
              "at both"},
    EffectRow{"speed_scale", "secondary", "", &E::secondary_speed_scale, Stage::kMeasurement, 5e-3,
              -0.08, 0.08, "omega_measured = (1 + x) omega_true", "speed", "secondary_speed",
              "high clamp force and little torque at both end stops: a speed scale shows the same "
              "at both"},
    EffectRow{"speed_ripple", "primary", "", &E::primary_ripple, Stage::kMeasurement, 1e-3, -0.05,
              0.05, "omega_measured = omega_true (1 + a sin(phi + phi0))", "speed",
              "angle of the primary shaft", "steady running at two speeds, sampled at 200 Hz"},
    EffectRow{"speed_ripple", "secondary", "", &E::secondary_ripple, Stage::kMeasurement, 1e-3,
              -0.05, 0.05, "omega_measured = omega_true (1 + a sin(phi + phi0))", "speed",
              "angle of the secondary shaft", "steady running at two speeds, sampled at 200 Hz"},
    EffectRow{"channel_skew", "delay_s", "s", nullptr, Stage::kMeasurement, 0.03, -0.2, 0.2,
              "x_measured(t) = x_true(t - delay)", "speed", "rate of the channel",
              "speed steps at constant torque and clamp force", kSkewedChannels},
    EffectRow{
        "secondary_loss", "constant_Nm", "Nm", &E::secondary_loss_constant_Nm,
        Stage::kSecondaryShaft, 2.0, -1.0, 20.0, "T_s = T_s,belt - a", "secondary torque",
        "nothing",
        "steady torque at both end stops: a drag at the other shaft counts there by the ratio"},
    EffectRow{"secondary_loss", "per_rad_s_Nm", "Nm s/rad", &E::secondary_loss_per_rad_s_Nm,
              Stage::kSecondaryShaft, 0.015, -5e-3, 0.5, "T_s = T_s,belt - c omega_s",
              "secondary torque", "secondary_speed",
              "sweep the speed at constant torque and clamp force with secondary_torque recorded"},
};
}  // namespace effect_table

constexpr std::span<const EffectRow> effect_rows() { return effect_table::kRows; }

// Where the value of a row goes in a file that names this role; none: it acts on nothing.
constexpr double MachineEffects::*value_of(const EffectRow& row, std::string_view role) {
  for (const EffectRole& each : row.roles) {
    if (each.role == role) return each.value;
  }
  return row.value;
}
// Whether the row is complete with this role.
constexpr bool takes_role(const EffectRow& row, std::string_view role) {
  if (row.value != nullptr) return true;
  for (const EffectRole& each : row.roles) {
    if (each.role == role) return true;
  }
  return false;
}

}  // namespace beltgrip::estimator
