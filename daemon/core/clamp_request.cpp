#include "daemon/core/clamp_request.h"

#include <algorithm>
#include <cmath>

namespace beltgrip::daemon {

using estimator::StopReason;

namespace {
constexpr double kSecondsPerTick = 1e-9;
// What the slip since the start leaves out: slip at the start, and the deformation that is gone.
constexpr double kSlipAtStart = 0.01;
constexpr Duration kSlipMean = 15 * kMillisecond;
constexpr Duration kSlipRateOver = 80 * kMillisecond;
constexpr Duration kReleaseMinimum = 300 * kMillisecond;
constexpr double kStuckForce = 1.1;     // of the last request
constexpr double kStuckFriction = 0.8;  // of the friction expected: the belt is near its peak
}  // namespace

ClampRequest::ClampRequest(const Config& config) : settings_(config.experiment) {}

void ClampRequest::begin(const Now& now, double rate_N_per_s, double floor_N) noexcept {
  standing_ = true;
  followed_ = true;
  stop_ = StopReason::kNone;
  begun_ = last_ = off_since_ = now.t;
  rate_N_per_s_ = rate_N_per_s;
  force_N_ = start_force_N_ = std::max(now.clamp_force_N, floor_N);
  start_torque_Nm_ = now.torque_Nm;
  start_ratio_ = now.omega_s_rad_s / now.omega_p_rad_s;
  count_ = 0;
  slip_ = slip_max_ = slip_rate_1_s_ = energy_J_ = 0.0;
}

// Slip from the speeds alone, without the estimator's filters and their delay.
void ClampRequest::follow_slip(const Now& now) noexcept {
  const double drift = now.omega_s_rad_s / now.omega_p_rad_s / start_ratio_ - 1.0;
  points_[count_++ % kPoints] = {now.t, -std::copysign(1.0, start_torque_Nm_) * drift};
  double recent = 0.0, recent_n = 0.0, oldest_s = 0.0;
  double n = 0.0, sum_t = 0.0, sum_x = 0.0, sum_tt = 0.0, sum_tx = 0.0;
  for (std::size_t age = 0; age < std::min(count_, kPoints); ++age) {
    const Point& point = points_[(count_ - 1 - age) % kPoints];
    const Duration before = now.t - point.t;
    if (before > kSlipRateOver) break;
    const double t = -static_cast<double>(before) * kSecondsPerTick;
    oldest_s = t;
    n += 1.0;
    sum_t += t;
    sum_x += point.slip;
    sum_tt += t * t;
    sum_tx += t * point.slip;
    if (before > kSlipMean) continue;
    recent += point.slip;
    recent_n += 1.0;
  }
  slip_ = recent / recent_n;
  slip_max_ = std::max(slip_max_, slip_);
  const bool whole = -oldest_s > 0.8 * static_cast<double>(kSlipRateOver) * kSecondsPerTick;
  slip_rate_1_s_ = whole ? (n * sum_tx - sum_t * sum_x) / (n * sum_tt - sum_t * sum_t) : 0.0;
  if (slip_ > kSlipCounted) {
    energy_J_ += (slip_ + kSlipAtStart) * std::abs(now.torque_Nm) * now.omega_p_rad_s *
                 static_cast<double>(now.t - last_) * kSecondsPerTick;
  }
}

StopReason ClampRequest::judge(const Now& now, double floor_N) const noexcept {
  if (slip_ > kSlipBand) return StopReason::kSlip;
  if (slip_ > kSlipRateFrom && slip_rate_1_s_ > kSlipRate_1_s) return StopReason::kSlipRate;
  if (energy_J_ > kSlipEnergy_J) return StopReason::kSlipEnergy;
  if (force_N_ <= floor_N) return StopReason::kForceFloor;
  if (now.t - begun_ >= Arming::kRequestMax) return StopReason::kTime;
  const double given_rad_s = now.omega_s_rad_s / start_ratio_;
  if (std::abs(now.omega_p_rad_s / given_rad_s - 1.0) > kSpeedBand ||
      now.omega_p_rad_s < kSpeedMargin * settings_.primary_speed_min_rad_s) {
    return StopReason::kEngineSpeed;
  }
  if (std::abs(now.torque_Nm - start_torque_Nm_) >
      kTorqueBand * std::abs(start_torque_Nm_) + kTorqueBand_Nm) {
    return StopReason::kTorque;
  }
  // Slip lowers the speed ratio in drive and raises it in overrun.
  const double drift = now.omega_s_rad_s / now.omega_p_rad_s / start_ratio_ - 1.0;
  if (drift * std::copysign(1.0, start_torque_Nm_) > kRatioBand) {
    return StopReason::kRatio;
  }
  return StopReason::kNone;
}

void ClampRequest::step(const Now& now, double floor_N) noexcept {
  if (!standing_) return;
  follow_slip(now);
  if (stop_ == StopReason::kNone) stop_ = judge(now, floor_N);
  const double fall_N = rate_N_per_s_ * static_cast<double>(now.t - last_) * kSecondsPerTick;
  last_ = now.t;
  force_N_ = std::max(force_N_ - fall_N, std::min(force_N_, floor_N));
  if (std::abs(now.clamp_force_N - force_N_) <= kFollowBand * force_N_ + kFollowBand_N) {
    off_since_ = now.t;
  }
  followed_ = now.t - off_since_ <= kFollowTime;
}

void ClampRequest::end(MonoTime t) noexcept {
  standing_ = false;
  ended_ = t;
  rest_s_ = rest_m_ = 0.0;
  travelled_ = false;
}

bool ClampRequest::released(const Now& now) const noexcept {
  const Duration since = now.t - ended_;
  return (since >= kReleaseMinimum && now.clamp_force_N >= kRestored * start_force_N_) ||
         since >= kReleaseTime;
}

bool ClampRequest::stuck(const Now& now) const noexcept {
  return now.t - ended_ >= kReleaseTime && now.clamp_force_N <= kStuckForce * force_N_ &&
         now.mu_star >= kStuckFriction * settings_.friction_expected;
}

void ClampRequest::travel(MonoTime t, double speed_m_s) noexcept {
  if (travelled_) {
    const double step_s = static_cast<double>(t - last_travel_) * kSecondsPerTick;
    rest_s_ += step_s;
    rest_m_ += std::max(0.0, speed_m_s) * step_s;
  }
  travelled_ = true;
  last_travel_ = t;
}

bool ClampRequest::cooled() const noexcept {
  return rest_s_ >= settings_.cooldown_s && rest_m_ >= settings_.cooldown_m;
}

}  // namespace beltgrip::daemon
