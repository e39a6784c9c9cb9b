#include "estimator/signal/input_correction.h"

#include <algorithm>
#include <cmath>

#include "estimator/physics/clamp_force.h"
#include "estimator/physics/slip.h"

namespace beltgrip::estimator {
namespace {

constexpr double kDelayMax_s = 0.5;
constexpr double kAcceleration_s = 0.05;  // smoothing of d(omega_p)/dt for a further inertia

double largest_delay_s(const MachineEffects& e) {
  return std::clamp(std::max({0.0, e.torque_delay_s, e.primary_speed_delay_s,
                              e.secondary_speed_delay_s, e.pressure_delay_s - e.lag_delay_s}),
                    0.0, kDelayMax_s);
}

}  // namespace

InputCorrection::Delay::Delay(double delay_s, double sample_rate_hz) {
  const double samples = std::clamp(delay_s, 0.0, 2.0 * kDelayMax_s) * sample_rate_hz;
  whole_ = static_cast<std::size_t>(samples);
  share_ = samples - static_cast<double>(whole_);
  past_ = std::vector<double>(whole_ + 2, 0.0);
}

void InputCorrection::Delay::reset(double value) noexcept {
  std::fill(past_.begin(), past_.end(), value);
}

double InputCorrection::Delay::step(double value) noexcept {
  now_ = (now_ + 1) % past_.size();
  past_[now_] = value;
  const double young = past_[(now_ + past_.size() - whole_) % past_.size()];
  const double old = past_[(now_ + past_.size() - whole_ - 1) % past_.size()];
  return young + share_ * (old - young);
}

InputCorrection::InputCorrection(const MachineEffects& effects, const VariatorParameters& variator,
                                 double sample_rate_hz, std::span<const LearnedTerm> learned)
    : effects_(effects),
      variator_(variator),
      rate_hz_(sample_rate_hz),
      keep_(effects.lag_time_constant_s > 0.0
                ? std::exp(-1.0 / (sample_rate_hz * effects.lag_time_constant_s))
                : 0.0),
      latency_s_(largest_delay_s(effects)),
      delays_{Delay(latency_s_ - effects.primary_speed_delay_s, sample_rate_hz),
              Delay(latency_s_ - effects.secondary_speed_delay_s, sample_rate_hz),
              Delay(latency_s_ - effects.pressure_delay_s + effects.lag_delay_s, sample_rate_hz),
              Delay(latency_s_ - effects.torque_delay_s, sample_rate_hz)} {
  const auto is_friction = [](const LearnedTerm& each) {
    return each.point == LearnedPoint::kFriction;
  };
  learned_.assign(learned.begin(), learned.end());
  learned_.erase(std::remove_if(learned_.begin(), learned_.end(), is_friction), learned_.end());
}

void InputCorrection::begin(const VariatorSample& measured) noexcept {
  delays_[0].reset(measured.omega_p_rad_s);
  delays_[1].reset(measured.omega_s_rad_s);
  delays_[2].reset(measured.secondary_pressure_Pa);
  delays_[3].reset(measured.torque_Nm);
  acting_Pa_ = input_Pa_ = measured.secondary_pressure_Pa;
  omega_p_rad_s_ = measured.omega_p_rad_s;
  acceleration_rad_s2_ = 0.0;
}

const VariatorSample& InputCorrection::correct(const VariatorSample& measured,
                                               LearnedConditions now) noexcept {
  out_ = measured;
  force_error_N_ = 0.0;
  now.primary_speed_rad_s = measured.omega_p_rad_s;
  now.secondary_pressure_Pa = measured.secondary_pressure_Pa;
  now.torque_Nm = measured.torque_Nm;
  uncovered_ = nullptr;
  for (const LearnedTerm& each : learned_) {
    const double at = condition(now, each.variable);
    if (!out_.usable || each.covers(at)) continue;
    out_.usable = false;
    uncovered_ = &each;
    uncovered_at_ = at;
  }
  if (!out_.usable) {
    started_ = false;
    return out_;
  }
  if (!started_) begin(measured);
  const MachineEffects e = with_learned(effects_, learned_, now);

  const double omega_p = delays_[0].step(measured.omega_p_rad_s) / (1.0 + e.primary_speed_scale);
  const double omega_s = delays_[1].step(measured.omega_s_rad_s) / (1.0 + e.secondary_speed_scale);
  acceleration_rad_s2_ += ((omega_p - omega_p_rad_s_) * rate_hz_ - acceleration_rad_s2_) *
                          -std::expm1(-1.0 / (kAcceleration_s * rate_hz_));
  omega_p_rad_s_ = omega_p;

  // The lag, exact for a pressure that is linear between samples.
  const double pressure_Pa =
      (delays_[2].step(measured.secondary_pressure_Pa) - e.pressure_offset_Pa) /
      (1.0 + e.pressure_gain);
  if (!started_) acting_Pa_ = input_Pa_ = pressure_Pa;
  if (e.lag_time_constant_s > 0.0) {
    const double rise_Pa = pressure_Pa - input_Pa_;
    acting_Pa_ = keep_ * acting_Pa_ + pressure_Pa - keep_ * input_Pa_ -
                 e.lag_time_constant_s * rate_hz_ * (1.0 - keep_) * rise_Pa;
  } else {
    acting_Pa_ = pressure_Pa;
  }
  input_Pa_ = pressure_Pa;
  double force_N = secondary_clamp_force_N(variator_, acting_Pa_, omega_s);
  if (!started_) play_N_ = force_N;
  play_N_ = std::clamp(play_N_, force_N - e.hysteresis_N, force_N + e.hysteresis_N);
  force_N = play_N_ + e.spring_N + e.centrifugal_N_s2 * omega_s * omega_s;
  force_error_N_ =
      force_N - secondary_clamp_force_N(variator_, measured.secondary_pressure_Pa, omega_s);

  const double shaft_Nm =
      (delays_[3].step(measured.torque_Nm) - e.torque_bias_Nm) / (1.0 + e.torque_gain);
  const double kN = 1e-3 * force_N;
  const EndStop stop = nearest_end_stop(variator_, std::max(omega_s, 0.0) / std::max(omega_p, 1.0));
  const double ratio = (1.0 + (stop == EndStop::kLow ? e.end_stop_low : e.end_stop_overdrive)) *
                       (1.0 - e.deformation_per_kN * kN - e.deformation_per_kN2 * kN * kN) *
                       (1.0 - e.tilt_per_Nm * shaft_Nm);

  out_.omega_p_rad_s = omega_p;
  out_.omega_s_rad_s = omega_s / std::max(ratio, 0.5);
  out_.secondary_pressure_Pa =
      (force_N - secondary_clamp_force_N(variator_, 0.0, out_.omega_s_rad_s)) /
      variator_.secondary_piston_area_m2;
  out_.torque_Nm = shaft_Nm - e.loss_constant_Nm - e.loss_per_kN_Nm * kN -
                   e.loss_per_rad_s_Nm * omega_p - e.inertia_kg_m2 * acceleration_rad_s2_;
  started_ = true;
  return out_;
}

}  // namespace beltgrip::estimator
