#include "daemon/core/experiment/own_force.h"

#include <algorithm>
#include <cmath>

namespace beltgrip::daemon {

namespace {
// Chosen: a pressure with 3 kPa of noise every 10 ms is known to 7 N, and a lag three times as long
// as most hides nothing.
constexpr double kMean_s = 0.2;
// Chosen: what a law and its pressure scatter, from one request to the next, by 1 % each, three
// deviations.
constexpr double kBack = 0.955;
}  // namespace

void OwnForce::step(const Now& now) noexcept {
  const double step_s = seconds(now.t - last_);
  last_ = now.t;
  const double share = begun_ ? std::min(1.0, step_s / kMean_s) : 1.0;
  begun_ = true;
  force_N_ += share * (now.force_N - force_N_);
  torque_Nm_ += share * (std::abs(now.torque_Nm) - torque_Nm_);
  back_ = back_ || force_N_ >= least_N();
}

double OwnForce::least_N() const noexcept {
  const double torque_share = own_torque_Nm_ > 0.0 ? torque_Nm_ / own_torque_Nm_ : 1.0;
  return kBack * own_N_ * std::min(1.0, torque_share);
}

void OwnForce::begin() noexcept {
  back_ = false;
  own_N_ = force_N_;
  own_torque_Nm_ = torque_Nm_;
}

}  // namespace beltgrip::daemon
