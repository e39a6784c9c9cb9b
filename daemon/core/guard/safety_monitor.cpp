#include "daemon/core/guard/safety_monitor.h"

#include <algorithm>
#include <cmath>

namespace beltgrip::daemon {

namespace {
// Three and six samples at 200 Hz.
constexpr Duration kDebounce = 10 * kMillisecond;
constexpr Duration kEngineDebounce = 25 * kMillisecond;
// A single sample's noise is as large as what is looked for.
constexpr Duration kNearReference = 80 * kMillisecond;
constexpr Duration kNearMean = 40 * kMillisecond;
constexpr double kRateMean_s = 0.04;
// Chosen, ns: ten frames of the pressure; the own force moves by 15 N within it before a request.
constexpr Duration kActingMean = 100 * kMillisecond;
constexpr double kRounding_N = 1.0;  // requests are whole newtons on the wire
}  // namespace

void SafetyMonitor::end(MonoTime t) noexcept {
  standing_ = false;
  asked_before_ = true;
  ended_ = t;
}

SafetyVerdict SafetyMonitor::check(MonoTime t, const SafetySignals& signals,
                                   double request_N) noexcept {
  see_acting_force(t, signals);
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

void SafetyMonitor::see_acting_force(MonoTime t, const SafetySignals& signals) noexcept {
  if (!signals.fresh || !(signals.clamp_force_N > 0.0)) {  // or not a number
    acting_N_ = 0.0;
    return;
  }
  const double latest =
      acting_N_ > 0.0 ? std::min(1.0, fraction(t - acting_seen_, kActingMean)) : 1.0;
  acting_N_ += latest * (signals.clamp_force_N - acting_N_);
  acting_seen_ = t;
}

SafetyVerdict SafetyMonitor::judge(MonoTime t, const SafetySignals& signals,
                                   double request_N) noexcept {
  if (!signals.fresh || !std::isfinite(signals.omega_p_rad_s) ||
      !std::isfinite(signals.omega_s_rad_s) || !std::isfinite(signals.torque_Nm)) {
    return SafetyVerdict::kInputs;
  }
  if (signals.omega_p_rad_s < limits_.speed_min_rad_s) {
    return beyond(SafetyVerdict::kSpeed, signals.omega_p_rad_s, limits_.speed_min_rad_s);
  }
  if (signals.omega_s_rad_s <= 0.0) {
    return beyond(SafetyVerdict::kSecondary, signals.omega_s_rad_s, 0.0);
  }
  const double floor_N = limits_.spring_force_N + limits_.floor_force_N +
                         limits_.centrifugal_N_s2 * signals.omega_s_rad_s * signals.omega_s_rad_s;
  if (!standing_) {
    if (asked_before_ && t - ended_ < limits_.pause_min) return SafetyVerdict::kPause;
    if (request_N < floor_N) return beyond(SafetyVerdict::kFloor, request_N, floor_N);
    const double least_N = limits_.start_share * acting_N_;
    if (!(acting_N_ > 0.0) || request_N < least_N) {
      return beyond(SafetyVerdict::kStart, request_N, least_N);
    }
    standing_ = true;
    begun_ = t;
    reference_ratio_ = signals.omega_s_rad_s / signals.omega_p_rad_s;
    first_request_N_ = last_request_N_ = request_N;
    near_sum_ = near_mean_ = slip_mean_share_ = slip_rate_1_s_ = 0.0;
    near_count_ = 0.0;
    beyond_since_ = engine_beyond_since_ = power_since_ = kNever;
    reference_engine_ = signals.omega_e_rad_s / signals.omega_p_rad_s;
    return SafetyVerdict::kAllowed;
  }
  const SafetyVerdict motion = judge_motion(t, signals, request_N);
  return motion != SafetyVerdict::kAllowed ? motion : judge_request(t, request_N, floor_N);
}

bool SafetyMonitor::slips_near_own_force(MonoTime t, double ratio, double request_N) noexcept {
  if (t - begun_ <= kNearReference || near_count_ == 0) {
    near_sum_ += ratio;
    near_count_ += 1.0;
    return false;
  }
  const double share = (1.0 - request_N / first_request_N_) / (1.0 - limits_.force_near_share);
  if (share >= 1.0) return false;
  const double latest = std::min(1.0, fraction(t - last_, kNearMean));
  near_mean_ += latest * (ratio * near_count_ / near_sum_ - 1.0 - near_mean_);
  const double most =
      limits_.slip_nearest_share + (limits_.slip_near_share - limits_.slip_nearest_share) * share;
  if (std::abs(near_mean_) > most) beyond(SafetyVerdict::kSlip, std::abs(near_mean_), most);
  return std::abs(near_mean_) > most;
}

SafetyVerdict SafetyMonitor::judge_motion(MonoTime t, const SafetySignals& signals,
                                          double request_N) noexcept {
  const double drift =
      std::abs(signals.omega_s_rad_s / signals.omega_p_rad_s / reference_ratio_ - 1.0);
  if (drift <= limits_.slip_debounced_share) beyond_since_ = kNever;
  if (drift > limits_.slip_debounced_share && beyond_since_ == kNever) beyond_since_ = t;
  if (drift > limits_.slip_max_share ||
      (beyond_since_ != kNever && t - beyond_since_ >= kDebounce)) {
    return beyond(
        SafetyVerdict::kSlip, drift,
        drift > limits_.slip_max_share ? limits_.slip_max_share : limits_.slip_debounced_share);
  }
  if (slips_near_own_force(t, signals.omega_s_rad_s / signals.omega_p_rad_s, request_N)) {
    return SafetyVerdict::kSlip;
  }
  const double slip_speed_m_s = drift * signals.omega_p_rad_s * signals.primary_radius_m;
  if (slip_speed_m_s > limits_.slip_speed_max_m_s) {
    return beyond(SafetyVerdict::kSlipSpeed, slip_speed_m_s, limits_.slip_speed_max_m_s);
  }
  if (signals.omega_e_rad_s > 0.0 && reference_engine_ > 0.0) {
    const double engine =
        std::abs(signals.omega_e_rad_s / signals.omega_p_rad_s / reference_engine_ - 1.0);
    if (engine <= limits_.engine_drift) engine_beyond_since_ = kNever;
    if (engine > limits_.engine_drift && engine_beyond_since_ == kNever) engine_beyond_since_ = t;
    if (engine_beyond_since_ != kNever && t - engine_beyond_since_ >= kEngineDebounce) {
      return beyond(SafetyVerdict::kEngine, engine, limits_.engine_drift);
    }
  }
  if (slips_away(t, drift)) {
    return beyond(SafetyVerdict::kSlipRate, slip_rate_1_s_, limits_.slip_rate_max_1_s);
  }
  const double power_W = drift * std::abs(signals.torque_Nm) * signals.omega_p_rad_s;
  if (power_W <= limits_.power_max_W) power_since_ = kNever;
  if (power_W > limits_.power_max_W && power_since_ == kNever) power_since_ = t;
  if (power_since_ == kNever || t - power_since_ < limits_.power_for) {
    return SafetyVerdict::kAllowed;
  }
  return beyond(SafetyVerdict::kPower, power_W, limits_.power_max_W);
}

// The rate of a lag that follows the drift, through another.
bool SafetyMonitor::slips_away(MonoTime t, double drift) noexcept {
  const double share = std::min(1.0, seconds(t - last_) / kRateMean_s);
  slip_rate_1_s_ += share * ((drift - slip_mean_share_) / kRateMean_s - slip_rate_1_s_);
  slip_mean_share_ += share * (drift - slip_mean_share_);
  return drift > limits_.slip_rate_from_share && slip_rate_1_s_ > limits_.slip_rate_max_1_s;
}

SafetyVerdict SafetyMonitor::judge_request(MonoTime t, double request_N, double floor_N) noexcept {
  if (t - begun_ > limits_.duration_max) return SafetyVerdict::kDuration;
  if (request_N < floor_N) return beyond(SafetyVerdict::kFloor, request_N, floor_N);
  if (request_N > last_request_N_) return SafetyVerdict::kRise;
  const double fall_max_N = limits_.rate_max_N_per_s * seconds(t - last_);
  if (last_request_N_ - request_N > fall_max_N + kRounding_N) return SafetyVerdict::kRate;
  last_request_N_ = request_N;
  return SafetyVerdict::kAllowed;
}

}  // namespace beltgrip::daemon
