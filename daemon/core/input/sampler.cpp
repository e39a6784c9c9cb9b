#include "daemon/core/input/sampler.h"

#include <algorithm>

namespace beltgrip::daemon {

Sampler::Sampler(const InputMonitor& inputs, bool torque_is_engine)
    : inputs_(inputs), torque_(torque_is_engine ? Role::kEngineTorque : Role::kPrimaryTorque) {}

void Sampler::settle() noexcept {
  Duration delay{};
  for (const Role role : inputs_.required()) {
    const std::optional<Duration> period = inputs_.period(role);
    if (!period) return;
    const bool speed = role == Role::kPrimarySpeed || role == Role::kSecondarySpeed;
    if (!speed && (role == Role::kExperimentActive || *period > kSlow)) continue;
    delay = std::max(delay, std::min(*period + inputs_.delay(role), kDelayMaximum));
  }
  delay_ = delay;
}

bool Sampler::read(Role role, MonoTime t, double& value) const noexcept {
  constexpr int kReachPeriods = 2;
  const Duration delay = inputs_.delay(role);
  const std::optional<Duration>& period = inputs_.period(role);
  Duration reach = period ? kReachPeriods * *period : Duration{};
  reach += std::max<Duration>(delay, Duration{});
  return inputs_.history(role).value_at(t + delay, reach, value);
}

const estimator::VariatorSample& Sampler::sample(MonoTime t, bool may_settle) noexcept {
  sample_.usable = false;
  if (may_settle) settle();
  if (!delay_ || !inputs_.all_valid()) return sample_;
  const MonoTime at = t - *delay_;
  estimator::VariatorSample next;
  next.t_ns = at.ns();
  next.usable = read(Role::kPrimarySpeed, at, next.omega_p_rad_s) &&
                read(Role::kSecondarySpeed, at, next.omega_s_rad_s) &&
                read(Role::kSecondaryPressure, at, next.secondary_pressure_Pa) &&
                read(torque_, at, next.torque_Nm) && next.omega_p_rad_s > 0.0 && at > last_;
  if (!next.usable) return sample_;
  const Duration ahead = at + inputs_.delay(Role::kSecondaryPressure) -
                         inputs_.history(Role::kSecondaryPressure).newest();
  next.pressure_ahead_ns = std::max<Duration>(ahead, Duration{}).ns();
  last_ = at;
  sample_ = next;
  return sample_;
}

}  // namespace beltgrip::daemon
