// Effects in the friction itself.
#include "tools/diagnose/model/effects/effect.h"

#include <algorithm>
#include <cmath>

namespace beltgrip::diagnose {
namespace {

using Eigen::ArrayXd;

constexpr double kReferenceTemperature_C = 80.0;
constexpr double kReferenceSpeed_rad_s = 105.0;
constexpr double kReferenceForce_N = 3000.0;
constexpr double kWarmUp_s = 30.0;

ArrayXd ln_of(const ArrayXd& factor) { return factor.max(0.05).log(); }

void apply_friction_temperature(Context& c, const Slot&, double per_K) {
  c.ln_friction += ln_of(1.0 + per_K * (c.run.temperature.value - kReferenceTemperature_C));
}
void apply_friction_speed(Context& c, const Slot&, double per_ln_speed) {
  c.ln_friction += ln_of(1.0 + per_ln_speed * (c.omega_p / kReferenceSpeed_rad_s).max(0.01).log());
}
// Of the slow pressure: else a larger exponent would fit better for the noise that it divides.
void apply_friction_load(Context& c, const Slot&, double exponent) {
  const ArrayXd force_N =
      c.force_N + c.variator.secondary_piston_area_m2 * (c.run.pressure.slow - c.read.pressure_Pa);
  c.ln_friction -= exponent * (force_N / kReferenceForce_N).max(0.01).log();
}
void apply_friction_ratio(Context& c, const Slot&, double relative) {
  for (Eigen::Index k = 0; k < c.ln_friction.size(); ++k) {
    if (c.run.stop[static_cast<std::size_t>(k)] == kLowStop) {
      c.ln_friction[k] += std::log(std::max(1.0 + relative, 0.05));
    }
  }
}
void apply_peak_slip(Context& c, const Slot&, double relative) {
  for (double& each : c.ln_peak_slip) each += std::log(std::max(1.0 + relative, 0.05));
}
void apply_fall(Context& c, const Slot&, double per_peak_slip) {
  for (double& each : c.fall) each += per_peak_slip;
}
void apply_wear_step(Context& c, const Slot& slot, double step) {
  if (c.experiment >= slot.index) c.ln_friction += std::log(std::max(1.0 - step, 0.05));
}
void apply_wear_gradual(Context& c, const Slot&, double per_experiment) {
  c.ln_friction += std::log(std::max(1.0 - per_experiment * c.experiment, 0.05));
}

void apply_warm_up_energy(Context& c, const Slot&, double per_kJ) {
  double energy_kJ = 0.0;
  for (Eigen::Index k = 0; k < c.ln_friction.size(); ++k) {
    const double power_W = c.belt_torque[k] * c.slip_share[k] * c.omega_p[k];
    if (std::isfinite(power_W)) energy_kJ += 1e-3 * power_W * c.run.dt_s;
    c.ln_friction[k] += std::log(std::max(1.0 + per_kJ * energy_kJ, 0.05));
  }
}

void apply_warm_up_time(Context& c, const Slot&, double per_start) {
  c.ln_friction += ln_of(1.0 + per_start * (1.0 - (-c.run.t_s / kWarmUp_s).exp()));
}

void only_with_temperature(const Carried& data, const AddSlot& add) {
  if (data.temperature) add(0, {});
}
void at_both_stops(const Carried& data, const AddSlot& add) {
  if (data.low && data.overdrive) add(0, {});
}
void from_each_experiment(const Carried& data, const AddSlot& add) {
  for (int at = 1; at < data.experiments && at <= 40; ++at) add(at, {});
}
void over_experiments(const Carried& data, const AddSlot& add) {
  if (data.experiments > 1) add(0, {});
}
// Files hold the slip at the peak and the fall in percent, a fit holds them relative to the nominal
// curve.
double peak_to_contract(double value, double peak_percent, double) {
  return (1.0 + value) * peak_percent;
}
double peak_from_contract(double value, double peak_percent, double) {
  return value / peak_percent - 1.0;
}
double fall_to_contract(double value, double peak_percent, double mu_max) {
  return value * mu_max / peak_percent;
}
double fall_from_contract(double value, double peak_percent, double mu_max) {
  return value * peak_percent / mu_max;
}

constexpr Equation kFrictionEquations[] = {
    {"friction_temperature", "per_K", apply_friction_temperature, only_with_temperature},
    {"friction_speed", "per_ln_speed", apply_friction_speed},
    {"friction_load", "exponent", apply_friction_load},
    {"friction_ratio", "relative", apply_friction_ratio, at_both_stops},
    {"friction_shape", "peak_slip_percent", apply_peak_slip, nullptr, false, peak_to_contract,
     peak_from_contract},
    {"friction_shape", "fall_per_percent", apply_fall, nullptr, false, fall_to_contract,
     fall_from_contract},
    {"wear", "step", apply_wear_step, from_each_experiment, true},
    {"wear", "per_experiment", apply_wear_gradual, over_experiments},
    {"warm_up_drift", "per_kJ", apply_warm_up_energy},
    {"warm_up_drift", "per_start", apply_warm_up_time},
};

}  // namespace

std::span<const Equation> friction_equations() { return kFrictionEquations; }

}  // namespace beltgrip::diagnose
