#include "daemon/core/experiment/clamp_request.h"

#include <algorithm>
#include <cmath>

namespace beltgrip::daemon {

using estimator::StopReason;

namespace {
constexpr double kSecondsPerTick = 1e-9;
constexpr double kPercent = 100.0;
// What the slip since the start leaves out: slip at the start, and the deformation that is gone.
constexpr double kSlipAtStart = 0.01;
constexpr Duration kSlipMean = 15 * kMillisecond;
constexpr Duration kSlipRateOver = 80 * kMillisecond;
constexpr Duration kReleaseMinimum = 300 * kMillisecond;
constexpr double kSlipAfter = 2e8;   // ns: averages noise, forgets macro slip before kReleaseTime
constexpr double kSlipTold = 0.003;  // slip at the end of a request that shows whether it goes back
constexpr double kSlipGone = 0.5;    // of it: then the force is back
constexpr double kUntrueShare = 0.5;    // of the ratio's drift that another node's speed tells too
constexpr double kStuckForce = 1.1;     // of the last request
constexpr double kStuckFriction = 0.8;  // of the friction expected: the belt is near its peak
}  // namespace

ClampRequest::ClampRequest(const Config& config) : settings_(config.experiment) {
  for (const RoleBinding& binding : config.roles) {
    if (binding.role != Role::kVehicleSpeed) continue;
    speed_step_m_s_ =
        std::abs(binding.factor * (binding.codec.physical(1) - binding.codec.physical(0)));
  }
}

void ClampRequest::begin(const Now& now, double rate_N_per_s, double floor_N) noexcept {
  standing_ = true;
  followed_ = true;
  stop_ = {};
  begun_ = last_ = off_since_ = now.t;
  rate_N_per_s_ = rate_N_per_s;
  force_N_ = start_force_N_ = std::max(now.clamp_force_N, floor_N);
  start_torque_Nm_ = now.torque_Nm;
  start_ratio_ = now.omega_s_rad_s / now.omega_p_rad_s;
  start_engine_ = now.omega_e_rad_s / now.omega_p_rad_s;
  start_wheels_ = now.speed_m_s / now.omega_s_rad_s;
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
  if (slip_ > limits::kSlipCounted) {
    energy_J_ += (slip_ + kSlipAtStart) * std::abs(now.torque_Nm) * now.omega_p_rad_s *
                 static_cast<double>(now.t - last_) * kSecondsPerTick;
  }
}

Stop ClampRequest::judge(const Now& now, double floor_N) const noexcept {
  if (slip_ > limits::kRequestSlip) {
    return {StopReason::kSlip,
            {.what = "slip since the start",
             .figure = kPercent * slip_,
             .limit = kPercent * limits::kRequestSlip,
             .unit = "%"}};
  }
  if (slip_ > limits::kRequestSlipRateFrom && slip_rate_1_s_ > limits::kRequestSlipRate_1_s) {
    return {StopReason::kSlipRate,
            {.what = "slip grows by",
             .figure = kPercent * slip_rate_1_s_,
             .limit = kPercent * limits::kRequestSlipRate_1_s,
             .unit = "%/s"}};
  }
  if (energy_J_ > limits::kRequestEnergy_J) {
    return {StopReason::kSlipEnergy,
            {.what = "slip energy",
             .figure = energy_J_,
             .limit = limits::kRequestEnergy_J,
             .unit = "J"}};
  }
  if (force_N_ <= floor_N) {
    return {StopReason::kForceFloor,
            {.what = "request at its floor", .figure = force_N_, .limit = floor_N, .unit = "N"}};
  }
  if (now.t - begun_ >= limits::kRequestLongest) {
    return {StopReason::kTime,
            {.what = "request stood for",
             .figure = static_cast<double>(now.t - begun_) * kSecondsPerTick,
             .limit = static_cast<double>(limits::kRequestLongest) * kSecondsPerTick,
             .unit = "s"}};
  }
  if (const Stop stop = judge_course(now)) return stop;
  const double given_rad_s = now.omega_s_rad_s / start_ratio_;
  const double off = std::abs(now.omega_p_rad_s / given_rad_s - 1.0);
  if (off > kSpeedBand) {
    return {StopReason::kEngineSpeed,
            {.what = "off the speed that the secondary gives it by",
             .figure = kPercent * off,
             .limit = kPercent * kSpeedBand,
             .unit = "%",
             .role = Role::kPrimarySpeed}};
  }
  const double least_rad_s = limits::kRequestSpeedShare * settings_.primary_speed_min_rad_s;
  if (now.omega_p_rad_s < least_rad_s) {
    return {StopReason::kEngineSpeed,
            {.what = "falls to",
             .figure = now.omega_p_rad_s,
             .limit = least_rad_s,
             .unit = "rad/s",
             .role = Role::kPrimarySpeed}};
  }
  const double torque_off_Nm = std::abs(now.torque_Nm - start_torque_Nm_);
  const double torque_band_Nm = kTorqueBand * std::abs(start_torque_Nm_) + kTorqueBand_Nm;
  if (torque_off_Nm > torque_band_Nm) {
    return {StopReason::kTorque,
            {.what = "torque on the belt has changed by",
             .figure = torque_off_Nm,
             .limit = torque_band_Nm,
             .unit = "Nm"}};
  }
  return {};
}

// Slip lowers the speed ratio in drive and raises it in overrun. Where it moves the other way while
// the force falls, a speed is not true, or the transmission shifts.
Stop ClampRequest::judge_course(const Now& now) const noexcept {
  const double drift = now.omega_s_rad_s / now.omega_p_rad_s / start_ratio_ - 1.0;
  const double wrong_way = drift * std::copysign(1.0, start_torque_Nm_);
  if (wrong_way <= kRatioBand) return {};
  const std::optional<Role> untrue = untrue_speed(now, drift);
  return {untrue ? StopReason::kInputFrozen : StopReason::kRatio,
          {.what = untrue ? "alone moves the speed ratio against the torque, by"
                          : "speed ratio has moved against the torque by",
           .figure = kPercent * wrong_way,
           .limit = kPercent * kRatioBand,
           .unit = "%",
           .role = untrue}};
}

// The shaft whose speed has left a neighbour's by as much and in the same direction. A torque that
// changes moves the neighbour the other way, a shift moves it along.
std::optional<Role> ClampRequest::untrue_speed(const Now& now, double drift) const noexcept {
  const double told = kUntrueShare * std::abs(drift);
  if (start_engine_ > 0.0 && now.omega_e_rad_s > 0.0) {
    const double left = now.omega_e_rad_s / now.omega_p_rad_s / start_engine_ - 1.0;
    if (left * std::copysign(1.0, drift) > told) return Role::kPrimarySpeed;
  }
  if (start_wheels_ > 0.0 && now.speed_m_s > 0.0) {
    const double left = now.omega_s_rad_s * start_wheels_ / now.speed_m_s - 1.0;
    if (left * std::copysign(1.0, drift) > told + speed_step_m_s_ / now.speed_m_s) {
      return Role::kSecondarySpeed;
    }
  }
  return std::nullopt;
}

void ClampRequest::step(const Now& now, double floor_N) noexcept {
  if (!standing_) return;
  follow_slip(now);
  if (!stop_) stop_ = judge(now, floor_N);
  const double fall_N = rate_N_per_s_ * static_cast<double>(now.t - last_) * kSecondsPerTick;
  last_ = now.t;
  force_N_ = std::max(force_N_ - fall_N, std::min(force_N_, floor_N));
  off_N_ = std::abs(now.clamp_force_N - force_N_);
  if (off_N_ <= follow_band_N()) off_since_ = now.t;
  followed_ = now.t - off_since_ <= kFollowTime;
}

bool ClampRequest::changed_since(MonoTime t) const noexcept {
  const double since_s = static_cast<double>(last_ - std::max(t, begun_)) * kSecondsPerTick;
  return rate_N_per_s_ * since_s > follow_band_N();
}

void ClampRequest::end(MonoTime t) noexcept {
  if (standing_) slip_after_ = slip_;
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

void ClampRequest::follow_release(const Now& now) noexcept {
  const double drift = now.omega_s_rad_s / now.omega_p_rad_s / start_ratio_ - 1.0;
  const double slip = -std::copysign(1.0, start_torque_Nm_) * drift;
  const double share = std::min(1.0, static_cast<double>(now.t - last_) / kSlipAfter);
  slip_after_ += share * (slip - slip_after_);
  last_ = now.t;
}

std::optional<bool> ClampRequest::held_again() const noexcept {
  if (slip_ < kSlipTold) return std::nullopt;
  return slip_after_ < kSlipGone * slip_;
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
