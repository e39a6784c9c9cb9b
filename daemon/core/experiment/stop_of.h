// What was found, as a reason to stop and its cause. Real-time thread.
#pragma once

#include <cstdint>

#include "daemon/core/experiment/arming.h"
#include "daemon/core/guard/safety_monitor.h"
#include "daemon/core/input/stop_cause.h"
#include "estimator/method/slip_curve_estimator.h"

namespace beltgrip::daemon {

// What the safety monitor found: motion leaves data worth evaluating. What its own request broke is
// an input's fault.
Stop stop_of(SafetyVerdict verdict, double figure, double limit) noexcept;
// Why an experiment was refused, by its inhibit_bit()s: what will not pass by itself first.
Stop stop_of(std::uint32_t inhibits, const Obstacle& obstacle) noexcept;
// What the estimator saw when it stopped.
Stop stop_of(const estimator::CurveEstimate& curve) noexcept;

}  // namespace beltgrip::daemon
