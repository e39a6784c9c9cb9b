#include "daemon/core/experiment/drive_changes.h"
#include "estimator/physics/units.h"

#include <algorithm>
#include <cmath>

namespace beltgrip::daemon {

using estimator::StopReason;

namespace {
using estimator::kPercent;
constexpr double kEver_s = 1e9;  // before the first
// Chosen: of the pedal, above what a foot that holds it, or a cruise control, does in a second.
// campaign --seeds 150 --from 1600001: at 0.024 one request more is ended for the pedal; at 0.036
// a case with several faults slips by 54 % that 0.03 ends below 8 %.
constexpr double kPedalChanged = 0.03;
constexpr double kPedalHeld_s = 1.0;
// Chosen: a torque that comes every 10 ms is halved in its noise, and late by 20 ms.
constexpr double kTorqueNow_s = 0.02;
constexpr double kTorqueCourse_s = 0.3;  // chosen: of slow drives, grades and cruise controls
// Chosen: scatters, six deviations of what kTorqueNow_s leaves of them. With 5 noise of 5 Nm on
// 45 Nm was taken for a change 19 times in 800 drives of 8 s (drive_changes_test).
constexpr double kScatters = 6.5;
constexpr double kScatter_s = 3.0;  // chosen: it is to know the signal, not the change
constexpr double kOutlier = 4.0;    // chosen: scatters, of which noise is hardly ever more
// Chosen: of the torque; from less than the step of a signal it must be able to grow.
constexpr double kScatterLeast = 0.002;
}  // namespace

namespace {
void follow(double& mean, double value, double step_s, double over_s) noexcept {
  mean += std::min(1.0, step_s / over_s) * (value - mean);
}
}  // namespace

void DriveChanges::take_torque(const Now& now) noexcept {
  const double step_s = begun_ ? seconds(now.torque_at - torque_at_) : kEver_s;
  torque_at_ = now.torque_at;
  scatter_Nm_ = std::sqrt(scatter_Nm2_);
  follow(torque_Nm_, now.torque_Nm, step_s, kTorqueNow_s);
  follow(course_Nm_, now.torque_Nm, step_s, kTorqueCourse_s);
  // A torque that moves is no scatter.
  const double off_Nm = now.torque_Nm - torque_Nm_;
  const double most_Nm = kOutlier * std::max(scatter_Nm_, kScatterLeast * std::abs(course_Nm_));
  follow(scatter_Nm2_, std::min(off_Nm * off_Nm, most_Nm * most_Nm), step_s, kScatter_s);
}

Stop DriveChanges::step(const Now& now) noexcept {
  if (now.torque_at != torque_at_) take_torque(now);
  follow(accelerator_, now.accelerator, begun_ ? seconds(now.t - last_) : kEver_s, kPedalHeld_s);
  begun_ = true;
  last_ = now.t;
  const double pedal = std::abs(now.accelerator - accelerator_);
  if (pedal > kPedalChanged) {
    return {StopReason::kDriver,
            {.what = "pedal moves by",
             .figure = kPercent * pedal,
             .limit = kPercent * kPedalChanged,
             .unit = "%",
             .role = Role::kAcceleratorPedal}};
  }
  return moves_beyond(kMoved);
}

Stop DriveChanges::moves_beyond(double share) const noexcept {
  const double moved_Nm = std::abs(torque_Nm_ - course_Nm_);
  const double most_Nm = share * std::abs(course_Nm_) + kScatters * scatter_Nm_;
  if (moved_Nm <= most_Nm) return {};
  return {
      StopReason::kTorque,
      {.what = "torque moves within 0.3 s by", .figure = moved_Nm, .limit = most_Nm, .unit = "Nm"}};
}

}  // namespace beltgrip::daemon
