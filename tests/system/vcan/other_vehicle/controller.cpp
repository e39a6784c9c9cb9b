#include "tests/system/vcan/other_vehicle/controller.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tests/system/vcan/other_vehicle/car.h"

namespace beltgrip::other {
namespace {

constexpr double kSafety = 1.3, kDesignFriction = 0.088;
constexpr double kHold_s = 0.5;  // a torque is held that long: engine and hydraulics have settled
constexpr double kSilence_s = 0.050, kBetweenRequests_s = 1.0, kCycle_s = 0.010;
constexpr double kOwnRate_N_per_s = 1000.0;  // never let down faster
constexpr double kMoreThanAtBegin = 7.0 / 6.0;

}  // namespace

double own_force_N(double torque_Nm) {
  const double wedge = std::cos(kHalfWedge_deg * std::numbers::pi / 180.0);
  const double needed = std::abs(torque_Nm) * wedge / (2.0 * kPrimaryRadius_m * kDesignFriction);
  return std::max(1500.0, kSafety * needed);
}

void Controller::judge_torque(double t_s, double requested_Nm, double actual_Nm) {
  torques_Nm_.emplace_back(t_s, std::max(std::abs(requested_Nm), std::abs(actual_Nm)));
  while (torques_Nm_.front().first < t_s - kHold_s) torques_Nm_.pop_front();
  double largest = 0.0;
  for (const auto& [when, torque] : torques_Nm_) largest = std::max(largest, torque);
  own_N_ = own_force_N(largest);
  if (asked_N_ && own_N_ > kMoreThanAtBegin * own_at_begin_N_) give_back(t_s);
}

void Controller::give_back(double t_s) {
  asked_N_.reset();
  idle_seen_ = false;
  ended_s_ = t_s;
}

void Controller::hear(double t_s, const Bytes& frame) {
  if (frame.size() != 8 || protection(kEstimateDataId + 2, frame) != frame[0]) return;
  const bool active = bits(frame, 16, 1) != 0;
  const auto force_N = static_cast<double>(bits(frame, 24, 16));
  const auto counter = static_cast<unsigned>(bits(frame, 8, 4));
  const bool reserved =
      bits(frame, 12, 4) != 0 || bits(frame, 17, 7) != 0 || bits(frame, 40, 24) != 0;
  if (counter > 14 || reserved || active != (force_N > 0.0)) return;
  const unsigned step = counter_ ? (counter + 15 - *counter_) % 15 : 1;
  counter_ = counter;
  if (!active) {
    if (asked_N_) give_back(t_s);
    idle_seen_ = true;
    return;
  }
  if (step < 1 || step > 3) return;
  begin_or_follow(t_s, force_N);
}

void Controller::begin_or_follow(double t_s, double force_N) {
  if (!asked_N_) {
    if (!idle_seen_ || !permits || t_s < ended_s_ + kBetweenRequests_s) return;
    own_at_begin_N_ = own_N_;
    given_N_ = own_N_;
  }
  idle_seen_ = false;
  asked_N_ = force_N;
  heard_s_ = t_s;
}

double Controller::command_N(double t_s, double secondary_rad_s) {
  if (asked_N_ && !permits) give_back(t_s);
  if (asked_N_ && t_s > heard_s_ + kSilence_s) give_back(t_s);
  if (holds_on) return given_N_;
  if (!asked_N_ || deaf) return has_given_ ? stays_share * own_N_ : own_N_;
  has_given_ = true;
  const double floor_N = clamp_N(kFloor_Pa, secondary_rad_s);
  const double slowest_N = given_N_ - kOwnRate_N_per_s * kCycle_s;
  given_N_ = std::min(own_N_, std::max({given_share * *asked_N_, floor_N, slowest_N}));
  return given_N_;
}

}  // namespace beltgrip::other
