#include "daemon/core/safety_monitor.h"

#include <algorithm>
#include <cmath>

namespace beltgrip::daemon {

namespace {
constexpr int kDebounce = 3;
constexpr int kEngineDebounce = 5;
constexpr int kNearReference = 16;  // samples: noise of one is as large as what is looked for
constexpr double kNearMean = 8.0;
constexpr double kRounding_N = 1.0;  // requests are whole newtons on the wire
constexpr double kSecondsPerTick = 1e-9;
}  // namespace

void SafetyMonitor::end(MonoTime t) noexcept {
  standing_ = false;
  asked_before_ = true;
  ended_ = t;
}

SafetyVerdict SafetyMonitor::check(MonoTime t, const SafetySignals& signals,
                                   double request_N) noexcept {
  if (!(request_N > 0.0)) {  // none, or not a number
    if (standing_) end(t);
    withdrawn_ = SafetyVerdict::kAllowed;
    return request_N == 0.0 ? SafetyVerdict::kAllowed : SafetyVerdict::kFloor;
  }
  if (withdrawn_ != SafetyVerdict::kAllowed) return withdrawn_;
  withdrawn_ = judge(t, signals, request_N);
  if (withdrawn_ != SafetyVerdict::kAllowed && standing_) end(t);
  last_ = t;
  return withdrawn_;
}

SafetyVerdict SafetyMonitor::judge(MonoTime t, const SafetySignals& signals,
                                   double request_N) noexcept {
  if (!signals.fresh || !std::isfinite(signals.omega_p_rad_s) ||
      !std::isfinite(signals.omega_s_rad_s) || !std::isfinite(signals.torque_Nm)) {
    return SafetyVerdict::kInputs;
  }
  if (signals.omega_p_rad_s < limits_.speed_min_rad_s || signals.omega_s_rad_s <= 0.0) {
    return SafetyVerdict::kSpeed;
  }
  const double floor_N = limits_.spring_force_N + limits_.floor_force_N +
                         limits_.centrifugal_N_s2 * signals.omega_s_rad_s * signals.omega_s_rad_s;
  if (!standing_) {
    if (asked_before_ && t - ended_ < limits_.pause_min) return SafetyVerdict::kPause;
    if (request_N < floor_N) return SafetyVerdict::kFloor;
    standing_ = true;
    begun_ = t;
    reference_ratio_ = signals.omega_s_rad_s / signals.omega_p_rad_s;
    first_request_N_ = last_request_N_ = request_N;
    energy_J_ = near_sum_ = near_mean_ = 0.0;
    near_count_ = 0;
    beyond_ = engine_beyond_ = 0;
    reference_engine_ = signals.omega_e_rad_s / signals.omega_p_rad_s;
    return SafetyVerdict::kAllowed;
  }
  const SafetyVerdict motion = judge_motion(t, signals, request_N);
  return motion != SafetyVerdict::kAllowed ? motion : judge_request(t, request_N, floor_N);
}

bool SafetyMonitor::slips_near_own_force(double ratio, double request_N) noexcept {
  if (near_count_ < kNearReference) {
    near_sum_ += ratio;
    ++near_count_;
    return false;
  }
  const double share = (1.0 - request_N / first_request_N_) / (1.0 - limits_.force_near);
  if (share >= 1.0) return false;
  near_mean_ += (ratio * kNearReference / near_sum_ - 1.0 - near_mean_) / kNearMean;
  return std::abs(near_mean_) >
         limits_.slip_nearest + (limits_.slip_near - limits_.slip_nearest) * share;
}

SafetyVerdict SafetyMonitor::judge_motion(MonoTime t, const SafetySignals& signals,
                                          double request_N) noexcept {
  const double drift =
      std::abs(signals.omega_s_rad_s / signals.omega_p_rad_s / reference_ratio_ - 1.0);
  beyond_ = drift > limits_.slip_debounced ? beyond_ + 1 : 0;
  if (drift > limits_.slip_max || beyond_ >= kDebounce ||
      slips_near_own_force(signals.omega_s_rad_s / signals.omega_p_rad_s, request_N)) {
    return SafetyVerdict::kSlip;
  }
  if (drift * signals.omega_p_rad_s * signals.primary_radius_m > limits_.slip_speed_max_m_s) {
    return SafetyVerdict::kSlipSpeed;
  }
  if (signals.omega_e_rad_s > 0.0 && reference_engine_ > 0.0) {
    const double engine =
        std::abs(signals.omega_e_rad_s / signals.omega_p_rad_s / reference_engine_ - 1.0);
    engine_beyond_ = engine > limits_.engine_drift ? engine_beyond_ + 1 : 0;
    if (engine_beyond_ > kEngineDebounce) return SafetyVerdict::kEngine;
  }
  if (drift > limits_.slip_counted) {
    energy_J_ += drift * std::abs(signals.torque_Nm) * signals.omega_p_rad_s *
                 static_cast<double>(t - last_) * kSecondsPerTick;
  }
  return energy_J_ > limits_.energy_max_J ? SafetyVerdict::kEnergy : SafetyVerdict::kAllowed;
}

SafetyVerdict SafetyMonitor::judge_request(MonoTime t, double request_N, double floor_N) noexcept {
  if (t - begun_ > limits_.duration_max) return SafetyVerdict::kDuration;
  if (request_N < floor_N) return SafetyVerdict::kFloor;
  if (request_N > last_request_N_) return SafetyVerdict::kRise;
  const double fall_max_N =
      limits_.rate_max_N_per_s * static_cast<double>(t - last_) * kSecondsPerTick;
  if (last_request_N_ - request_N > fall_max_N + kRounding_N) return SafetyVerdict::kRate;
  last_request_N_ = request_N;
  return SafetyVerdict::kAllowed;
}

}  // namespace beltgrip::daemon
