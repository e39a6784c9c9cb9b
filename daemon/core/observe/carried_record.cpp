#include "daemon/core/observe/carried_record.h"

#include <algorithm>
#include <cmath>

#include "can_dbc/text/format.h"
#include "daemon/core/loop/pipeline_setup.h"
#include "estimator/method/possible_friction.h"
#include "estimator/physics/sensor_error.h"
#include "estimator/physics/slip.h"
#include "estimator/physics/units.h"
#include "estimator/statistics/interval.h"

namespace beltgrip::daemon {

namespace {

constexpr double kWindow_s = seconds(CarriedWatch::kWindow);

}  // namespace

std::optional<double> reserve_share(const CarriedBound& bound) noexcept {
  if (!bound.known() || !(bound.force_N_s > 0.0)) return std::nullopt;
  return std::max(0.0, 1.0 - bound.used_N_s / (bound.mu_star * bound.force_N_s));
}

CarriedRecord::CarriedRecord(const Config& config)
    : variator_(as_read(config).variator), sensors_(config.sensors) {
  if (config.friction_is_assumed) {
    assumptions_.emplace(variator_, sensors_, config.assumed_constants);
  }
}

// The lower end of what mu* may have been: sensors have constant errors, and constants that nobody
// stated were drawn from a distribution.
double CarriedRecord::weighed(const CarriedWindow& window) {
  const double torque_Nm = estimator::torque_carried_Nm(variator_, window.end_stop,
                                                        window.clamp_force_N, window.mu_star_held);
  if (!assumptions_) {
    const double deviation = estimator::relative_sensor_deviation(
        variator_, sensors_, torque_Nm, window.clamp_force_N, window.omega_s_rad_s);
    return window.mu_star_held * std::max(0.0, 1.0 - estimator::kNormal95 * deviation);
  }
  const double sign = window.direction == estimator::Direction::kDrive ? 1.0 : -1.0;
  assumptions_->begin({.end_stop = window.end_stop,
                       .mu = window.mu_star_held,
                       .relative_noise = 0.0,
                       .clamp_force_N = window.clamp_force_N,
                       .torque_Nm = torque_Nm,
                       .omega_s_rad_s = window.omega_s_rad_s,
                       .acceleration_rad_s2 = sign * window.acceleration_rad_s2});
  while (!assumptions_->step()) {
  }
  return std::clamp(assumptions_->spread().low, 0.0, window.mu_star_held);
}

bool CarriedRecord::take(const CarriedWindow& window, double time_s) {
  CarriedBound& bound = bounds_[estimator::belt_group(window.direction, window.end_stop)];
  const bool higher = window.mu_star_held > bound.mu_star;
  const double least = higher ? weighed(window) : 0.0;
  if (least > estimator::kBeltMost) {
    bound.refused_mu_star = std::max(bound.refused_mu_star, window.mu_star_held);
    return false;
  }
  if (!window.lowered && time_s > bound.counted_until_s) {
    bound.counted_until_s = time_s;
    bound.held_s += kWindow_s;
    bound.force_N_s += kWindow_s * window.clamp_force_N;
    bound.used_N_s += kWindow_s * window.clamp_force_N * window.mu_star;
  }
  if (!higher) return false;
  bound.mu_star = window.mu_star_held;
  bound.mu_max_least = least;
  bound.time_s = time_s;
  bound.torque_Nm = window.torque_Nm;
  bound.clamp_force_N = window.clamp_force_N;
  bound.omega_p_rad_s = window.omega_p_rad_s;
  bound.oil_degC = window.oil_degC;
  return true;
}

std::string carried_text(const CarriedBound& bound) {
  std::string text = format(
      "mu_max is at least %.4f: mu* %.4f was carried without slip at %.0f Nm, "
      "%.0f N, %.0f rad/s",
      bound.mu_max_least, bound.mu_star, bound.torque_Nm, bound.clamp_force_N, bound.omega_p_rad_s);
  if (std::isfinite(bound.oil_degC)) text += format(", oil %.0f degC", bound.oil_degC);
  if (const std::optional<double> share = reserve_share(bound)) {
    text += format("; at least %.0f %% of the controller's force was reserve, over %.0f s",
                   estimator::kPercent * *share, bound.held_s);
  }
  return text + "; a lower bound, no value";
}

std::string refused_text(const CarriedBound& bound) {
  return format(
      "mu* %.3f is read where the belt holds, more than any belt has (%.2f): sign or unit "
      "of the torque, piston area, spring, centrifugal term or radii are wrong",
      bound.refused_mu_star, estimator::kBeltMost);
}

std::string group_text(std::size_t group) {
  const bool drive = estimator::direction_of(group) == estimator::Direction::kDrive;
  const bool overdrive = estimator::end_stop_of(group) == estimator::EndStop::kOverdrive;
  return std::string(drive ? "drive" : "overrun") + (overdrive ? ", overdrive" : ", low");
}

}  // namespace beltgrip::daemon
