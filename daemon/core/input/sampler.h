// Brings the stamped inputs to one instant: signals of different rates and phases become one
// VariatorSample. Real-time thread.
//
// A sample taken at t represents the instant t - delay. The delay is the period of the slower of
// the two speeds, so that both are interpolated: 10 ms of skew between them would read as 0.07 to
// 0.24 percent of slip. Pressure and torque are interpolated as well where their periods are at
// most kSlow; the slope of a slower one is followed instead of waiting for it. What a role tells
// late (delay_ms) is waited for as well, up to kDelayMaximum in all, and its slope followed beyond.
#pragma once

#include <limits>
#include <optional>

#include "daemon/core/input/input_monitor.h"
#include "estimator/physics/variator_sample.h"

namespace beltgrip::daemon {

class Sampler {
 public:
  static constexpr Duration kDelayMaximum = 50 * kMillisecond;
  static constexpr Duration kSlow = 25 * kMillisecond;

  Sampler(const InputMonitor& inputs, bool torque_is_engine);

  // may_settle: the delay may change now (no experiment runs).
  const estimator::VariatorSample& sample(MonoTime t, bool may_settle) noexcept;
  const estimator::VariatorSample& newest() const noexcept { return sample_; }
  std::optional<Duration> delay() const noexcept { return delay_; }

 private:
  void settle() noexcept;
  bool read(Role role, MonoTime t, double& value) const noexcept;

  const InputMonitor& inputs_;
  Role torque_;
  std::optional<Duration> delay_;
  MonoTime last_ = MonoTime::min();  // instant of the last usable sample
  estimator::VariatorSample sample_;
};

}  // namespace beltgrip::daemon
