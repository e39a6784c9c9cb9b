#include "tools/diagnose/model/effects/effect.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "estimator/statistics/order.h"
#include "tools/diagnose/model/effects/clamping.h"
#include "tools/diagnose/model/effects/driveline.h"
#include "tools/diagnose/model/effects/friction.h"
#include "tools/diagnose/model/effects/measurement.h"

namespace beltgrip::diagnose {
namespace {

constexpr auto kMeasure = Stage::kMeasurement;
constexpr auto kForce = Stage::kForce;
constexpr auto kDrive = Stage::kDriveline;
constexpr auto kRatio = Stage::kRatio;
constexpr auto kFriction = Stage::kFriction;

// Sizes: ranges of the literature on pushbelt variators and their sensors.
// id, parameter, unit, stage, typical, bounds, function, equation, acts on, follows, separating run
constexpr std::array kRows{
    EffectRow{"torque_bias", "bias_Nm", "Nm", kMeasure, 3.0, -40.0, 40.0, apply_torque_bias,
              "T_measured = T_true + bias", "torque", "nothing",
              "repeat one ramp at two torque levels (20 and 60 Nm), or read the sensor unloaded"},
    EffectRow{"torque_gain", "gain", "", kMeasure, 0.05, -0.5, 0.5, apply_torque_gain,
              "T_measured = (1 + gain) T_true", "torque", "torque",
              "step the torque at constant clamp force with secondary_torque recorded"},
    EffectRow{"inertia_torque", "inertia_kg_m2", "kg m^2", kDrive, 0.05, -1.0, 1.0,
              apply_inertia_torque, "T_belt = T_measured - (J_configured + J) d(omega_p)/dt",
              "torque", "acceleration of primary_speed",
              "accelerate and brake briskly at constant clamp force and torque"},
    EffectRow{"torque_delay", "delay_s", "s", kMeasure, 0.05, -0.2, 0.5, apply_torque_delay,
              "T_measured(t) = T_true(t - delay)", "torque", "rate of torque",
              "torque steps at constant speed and clamp force"},
    EffectRow{"torque_loss", "constant_Nm", "Nm", kDrive, 2.0, -20.0, 20.0, apply_loss_constant,
              "T_belt = T - a", "torque", "nothing",
              "sweep the clamp force at constant torque, and repeat at another speed"},
    EffectRow{"torque_loss", "per_kN_Nm", "Nm/kN", kDrive, 0.3, -10.0, 10.0, apply_loss_per_kN,
              "T_belt = T - b F/kN", "torque", "secondary_pressure",
              "sweep the clamp force at constant torque, far from the peak"},
    EffectRow{"torque_loss", "per_rad_s_Nm", "Nm s/rad", kDrive, 0.015, -0.5, 0.5,
              apply_loss_per_speed, "T_belt = T - c omega_p", "torque", "primary_speed",
              "sweep the speed at constant torque and clamp force"},
    EffectRow{"centrifugal_force", "coefficient_N_s2", "N s^2", kForce, 6e-3, -0.05, 0.05,
              apply_centrifugal_force, "F_true = F_model + c omega_s^2", "clamp force",
              "secondary_speed", "repeat one ramp at two speeds, one of them 250 rad/s and more"},
    EffectRow{"pressure_offset", "offset_Pa", "Pa", kMeasure, 4e4, -2e5, 2e5, apply_pressure_offset,
              "p_measured = p_true + offset", "clamp force", "nothing",
              "read the pressure with the pump off; ramps at two torque levels in one ratio"},
    EffectRow{"pressure_gain", "gain", "", kMeasure, 0.03, -0.1, 0.1, apply_pressure_gain,
              "p_measured = (1 + gain) p_true", "clamp force", "secondary_pressure",
              "a reference gauge: the gain of the pressure and mu_max are one number in ramps"},
    EffectRow{"spring_force", "force_N", "N", kForce, 300.0, -3000.0, 3000.0, apply_spring_force,
              "F_true = F_model + force", "clamp force", "nothing",
              "read the pressure with the pump off: a zero there leaves the spring"},
    EffectRow{"hydraulic_lag", "time_constant_s", "s", kMeasure, 0.1, 0.0, 2.0, apply_hydraulic_lag,
              "tau dp/dt + p = p_in(t)", "clamp force", "rate of secondary_pressure",
              "clamp steps up and down at two rates below the peak"},
    EffectRow{"hydraulic_lag", "delay_s", "s", kMeasure, 0.05, -0.01, 0.5, apply_hydraulic_delay,
              "p(t) = p_in(t - delay)", "clamp force", "rate of secondary_pressure",
              "clamp steps up and down at two rates below the peak"},
    EffectRow{"clamp_hysteresis", "force_N", "N", kForce, 120.0, 0.0, 1500.0,
              apply_clamp_hysteresis, "F_true = F_model - force sgn(dF/dt), with play",
              "clamp force", "direction of secondary_pressure",
              "the same triangle of the clamp force at two rates: a lag grows with the rate"},
    EffectRow{"pulley_deformation", "per_kN", "1/kN", kRatio, 2e-3, -0.03, 0.03,
              apply_deformation_linear, "r_g = r_g0 (1 - a F/kN)", "ratio", "secondary_pressure",
              "sweep the clamp force at almost no torque"},
    EffectRow{"pulley_deformation", "per_kN2", "1/kN^2", kRatio, 2e-4, -0.005, 0.005,
              apply_deformation_quadratic, "r_g = r_g0 (1 - b (F/kN)^2)", "ratio",
              "secondary_pressure", "sweep the clamp force up to its maximum at almost no torque"},
    EffectRow{"radius_tilt", "per_Nm", "1/Nm", kRatio, 3e-5, -1e-3, 1e-3, apply_radius_tilt,
              "r_g = r_g0 (1 - a T_p)", "ratio", "torque",
              "sweep the clamp force at two torques far below the peak"},
    EffectRow{"end_stop_ratio", "low", "", kRatio, 5e-3, -0.08, 0.08, apply_end_stop_low,
              "r_g0,true = (1 + x) r_g0,configured", "ratio", "nothing",
              "high clamp force and little torque at both end stops"},
    EffectRow{"end_stop_ratio", "overdrive", "", kRatio, 5e-3, -0.08, 0.08,
              apply_end_stop_overdrive, "r_g0,true = (1 + x) r_g0,configured", "ratio", "nothing",
              "high clamp force and little torque at both end stops"},
    EffectRow{"ratio_creep", "rate", "1/rad", kRatio, 2e-5, 0.0, 5e-3, apply_ratio_creep,
              "d(ln r_g)/dt = rate omega_p (fall of the holding force ratio)", "ratio",
              "primary_pressure",
              "vary primary_pressure at constant secondary_pressure and torque"},
    EffectRow{"friction_temperature", "per_K", "1/K", kFriction, 1.5e-3, -0.02, 0.02,
              apply_friction_temperature, "mu = mu_nom (1 + a (theta - 80 degC))", "friction",
              "oil_temperature", "the same ramp cold and warm, the warm one both first and last"},
    EffectRow{"friction_speed", "per_ln_speed", "", kFriction, 0.06, -0.5, 0.5,
              apply_friction_speed, "mu = mu_nom (1 + a ln(omega_p / 105))", "friction",
              "primary_speed", "the same ramp at two speeds in low ratio"},
    EffectRow{"friction_load", "exponent", "", kFriction, 0.05, -0.6, 0.6, apply_friction_load,
              "mu = mu_nom (F / 3 kN)^-n", "friction", "secondary_pressure",
              "ramps to the peak at 15 and 100 Nm in the same ratio"},
    EffectRow{"friction_ratio", "relative", "", kFriction, 0.08, -0.6, 0.6, apply_friction_ratio,
              "mu_low = (1 + a) mu_overdrive", "friction", "ratio",
              "ramps at both end stops that reach the peak at the same clamp force"},
    EffectRow{"friction_shape", "peak_slip_percent", "%", kFriction, 1.0, -0.8, 4.0,
              apply_peak_slip, "slip at the peak is (1 + x) the nominal", "friction", "slip",
              "a slow ramp through the peak"},
    EffectRow{"friction_shape", "fall_per_percent", "1/%", kFriction, 0.15, -1.0, 1.0, apply_fall,
              "fall of mu beyond the peak differs from the nominal", "friction", "slip",
              "a slow ramp through the peak, stopped late"},
    EffectRow{"wear", "step", "", kFriction, 0.05, -0.5, 0.5, apply_wear_step,
              "mu = mu_nom (1 - step) from one experiment on", "friction", "experiment",
              "repeat the first experiment three times at the end"},
    EffectRow{
        "wear", "per_experiment", "", kFriction, 8e-3, -0.1, 0.1, apply_wear_gradual,
        "mu = mu_nom (1 - a i)", "friction", "experiment",
        "repeat the first experiment in the middle and at the end, temperature as in the first"},
    EffectRow{"warm_up_drift", "per_kJ", "1/kJ", kFriction, 0.02, -0.5, 0.5, apply_warm_up_energy,
              "mu = mu_nom (1 + a E), E slip energy within the experiment", "friction",
              "slip energy", "one ramp at once and one after a minute of idling"},
    EffectRow{"warm_up_drift", "per_start", "", kFriction, 0.04, -0.5, 0.5, apply_warm_up_time,
              "mu = mu_nom (1 + b (1 - exp(-t/30 s)))", "friction", "time",
              "one ramp at once and one after a minute of idling"},
    EffectRow{"speed_ripple", "primary", "", kMeasure, 1e-3, -0.05, 0.05, nullptr,
              "omega_measured = omega_true (1 + a sin(phi + phi0))", "speed",
              "angle of the primary shaft", "steady running at two speeds, sampled at 200 Hz"},
    EffectRow{"speed_ripple", "secondary", "", kMeasure, 1e-3, -0.05, 0.05, nullptr,
              "omega_measured = omega_true (1 + a sin(phi + phi0))", "speed",
              "angle of the secondary shaft", "steady running at two speeds, sampled at 200 Hz"},
    EffectRow{
        "speed_scale", "primary", "", kMeasure, 5e-3, -0.08, 0.08, apply_speed_scale_primary,
        "omega_measured = (1 + x) omega_true", "speed", "primary_speed",
        "high clamp force and little torque at both end stops: a speed scale shows the same at "
        "both"},
    EffectRow{
        "speed_scale", "secondary", "", kMeasure, 5e-3, -0.08, 0.08, apply_speed_scale_secondary,
        "omega_measured = (1 + x) omega_true", "speed", "secondary_speed",
        "high clamp force and little torque at both end stops: a speed scale shows the same at "
        "both"},
    EffectRow{"channel_skew", "delay_s", "s", kMeasure, 0.03, -0.2, 0.2, apply_channel_skew,
              "x_measured(t) = x_true(t - delay)", "speed", "rate of the channel",
              "speed steps at constant torque and clamp force"},
};

bool any(const std::vector<ExperimentData>& runs, auto&& has) {
  for (const ExperimentData& run : runs) {
    if (run.valid_count > 0 && has(run)) return true;
  }
  return false;
}

bool has_stop(const ExperimentData& run, int stop) {
  for (std::size_t k = 0; k < run.valid.size(); ++k) {
    if (run.valid[k] && run.stop[k] == stop) return true;
  }
  return false;
}

// Ramps at one and the same rate shift the force of a lag by one and the same amount: there it is
// no other thing than an offset, or another shape of the friction curve.
bool pressure_moves_variously(const std::vector<ExperimentData>& runs) {
  constexpr double kMoves = 0.2, kVarious = 0.5;  // of the usual largest rate
  constexpr int kBlock = 20;                      // samples: noise is no variety
  std::vector<double> rates;
  for (const ExperimentData& run : runs) {
    double sum = 0.0;
    int count = 0;
    for (int k = 0; k < run.size(); ++k) {
      const bool valid = run.valid[static_cast<std::size_t>(k)];
      sum = valid ? sum + run.pressure.slow_slope[k] : 0.0;
      count = valid ? count + 1 : 0;
      if (count < kBlock) continue;
      rates.push_back(sum / kBlock);
      sum = 0.0;
      count = 0;
    }
  }
  if (rates.empty()) return false;
  const auto quantile = [&](double share) {
    return estimator::at_rank(
        rates, static_cast<std::size_t>(share * static_cast<double>(rates.size() - 1)));
  };
  const double largest = std::max(std::abs(quantile(0.02)), std::abs(quantile(0.98)));
  std::erase_if(rates, [&](double rate) { return !(std::abs(rate) > kMoves * largest); });
  return !rates.empty() && quantile(0.95) - quantile(0.05) > kVarious * largest;
}

}  // namespace

std::string Slot::label() const {
  std::string text = std::string(row->id) + "." + std::string(row->parameter);
  if (!role.empty()) text += "@" + std::string(role);
  if (counts_experiments()) text += "@" + std::to_string(index);
  return text;
}

bool Slot::counts_experiments() const { return row->apply == apply_wear_step; }

double Slot::to_contract(double value, const Eigen::VectorXd& nuisance) const {
  const double peak_percent = 100.0 * std::exp(nuisance[kLnPeakSlipOverdrive]);
  if (row->apply == apply_peak_slip) return (1.0 + value) * peak_percent;
  if (row->apply == apply_fall) return value * std::exp(nuisance[kLnMuMax]) / peak_percent;
  return value;
}

double Slot::from_contract(double value, const std::map<std::string, double>& friction) const {
  const double peak_percent = friction.at("peak_slip_overdrive_percent");
  if (row->apply == apply_peak_slip) return value / peak_percent - 1.0;
  if (row->apply == apply_fall) return value * peak_percent / friction.at("mu_max");
  return value;
}

std::span<const EffectRow> effect_rows() { return kRows; }

std::vector<Slot> make_slots(const std::vector<ExperimentData>& runs) {
  const bool command = any(runs, [](const auto& run) { return run.command.present; });
  const bool low = any(runs, [](const auto& run) { return has_stop(run, kLowStop); });
  const bool overdrive = any(runs, [](const auto& run) { return has_stop(run, kOverdriveStop); });
  const bool various = pressure_moves_variously(runs);
  std::vector<Slot> slots;
  for (const EffectRow& row : kRows) {
    const auto add = [&](int index, std::string_view role) {
      slots.push_back({&row, index, role});
    };
    if (row.apply == nullptr) continue;  // speed_ripple: found in the order spectrum
    if (row.apply == apply_friction_temperature) {
      if (any(runs, [](const auto& run) { return run.temperature.present; })) add(0, {});
    } else if (row.apply == apply_friction_ratio) {
      if (low && overdrive) add(0, {});
    } else if (row.apply == apply_end_stop_low) {
      if (low) add(0, {});
    } else if (row.apply == apply_end_stop_overdrive) {
      if (overdrive) add(0, {});
    } else if (row.apply == apply_wear_step) {
      for (int at = 1; at < static_cast<int>(runs.size()) && at <= 40; ++at) add(at, {});
    } else if (row.apply == apply_wear_gradual) {
      if (runs.size() > 1) add(0, {});
    } else if (row.apply == apply_hydraulic_lag || row.apply == apply_hydraulic_delay) {
      if (various) add(0, {});
      if (command) add(0, "command");
    } else if (row.apply == apply_clamp_hysteresis) {
      // The clamp force before each experiment: unknown, raised to where it begins, lowered.
      for (const std::string_view before : {"", "raised", "lowered"}) add(0, before);
    } else if (row.apply == apply_ratio_creep) {
      add(0, {});
      add(0, "clamp force");
    } else if (row.apply == apply_channel_skew) {
      for (const std::string_view role :
           {"primary_speed", "secondary_speed", "secondary_pressure"}) {
        add(0, role);
      }
      // Of the torque it is torque_delay.
    } else {
      add(0, {});
    }
  }
  return slots;
}

}  // namespace beltgrip::diagnose
