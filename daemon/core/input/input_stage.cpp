#include "daemon/core/input/input_stage.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace beltgrip::daemon {

using estimator::ReadingVerdict;

using estimator::StopReason;

namespace {
// As long as a fault shows: what flickers changes the state at most twice a second.
constexpr Duration kUsableAgain = FaultSet::kHold;
}  // namespace

Duration sample_period(const Config& config) noexcept {
  return period_of(config.estimator.sample_rate_hz);
}

InputStage::InputStage(const Config& config)
    : monitor_(config),
      sampler_(monitor_, config.estimator.torque_is_engine),
      sample_period_(sample_period(config)) {
  // A request to the transmission rests on every input that is there.
  buses_.need(0);
  for (const RoleBinding& role : config.roles) {
    const auto required = monitor_.required();
    const bool is_required =
        std::find(required.begin(), required.end(), role.role) != required.end();
    if (is_required || config.control == Control::kCommand) buses_.need(role.bus);
  }
}

FrameUse InputStage::on_frame(const RxFrame& frame, FaultSet& faults) noexcept {
  const FrameUse use = monitor_.on_frame(frame, faults);
  if (use == FrameUse::kTaken) buses_.on_input(frame.bus, frame.t);
  return use;
}

const estimator::VariatorSample& InputStage::step(MonoTime t, const InputMonitor::Watch& watch,
                                                  bool may_settle, FaultSet& faults) noexcept {
  samples_lost_ = next_samples_lost_;
  next_samples_lost_ = false;
  monitor_.watch(watch);
  monitor_.update(t, faults);
  buses_.raise_faults(t, faults);
  const estimator::VariatorSample& sample = sampler_.sample(t, may_settle);
  if (sample.usable) {
    last_usable_ = t;
    was_usable_ = true;
  } else if (was_usable_) {
    last_unusable_ = t;
  }
  return sample;
}

void InputStage::poll(MonoTime t, Outbox& outbox) noexcept {
  monitor_.diagnostics().step(t, {buses_.up(0), buses_.up(1)}, outbox);
}

Stop InputStage::lost(MonoTime t) const noexcept {
  if (const Stop gone = monitor_.lost(t)) return gone;
  if (samples_lost_) return {StopReason::kInputs, {.what = "samples were taken too late"}};
  return {};
}

estimator::LearnedConditions InputStage::learned_conditions() const noexcept {
  const double unknown = std::numeric_limits<double>::quiet_NaN();
  const auto newest = [&](Role role) {
    bool fresh = true;
    const double value = monitor_.value_or(role, unknown, fresh);
    return fresh ? value : unknown;
  };
  estimator::LearnedConditions out;
  out.oil_temperature_degC = newest(Role::kOilTemperature);
  out.primary_pressure_Pa = newest(Role::kPrimaryPressure);
  return out;
}

bool InputStage::lockup_closed() const noexcept {
  bool fresh = true;
  const bool closed = monitor_.value_or(Role::kLockupClosed, 1.0, fresh) > 0.5;
  return fresh && closed;
}

bool InputStage::starved(MonoTime t) const noexcept {
  const Duration slowest = std::max(sampler_.delay().value_or(Duration{}), sample_period_);
  return t - last_usable_ > InputMonitor::stale_after(slowest);
}

Stop InputStage::starved_for(MonoTime t) const noexcept {
  return {StopReason::kInputs,
          {.what = "reads what gives no sample for",
           .figure = seconds(t - last_usable_),
           .unit = "s",
           .role = Role::kPrimarySpeed}};
}

bool InputStage::usable_again(MonoTime t) const noexcept {
  return !last_unusable_ || t - *last_unusable_ >= kUsableAgain;
}

Stop InputStage::missing_condition() const noexcept {
  for (const Role role : {Role::kExperimentPermitted, Role::kLockupClosed, Role::kBrakePressed,
                          Role::kAcceleratorPedal, Role::kOilTemperature}) {
    if (!monitor_.is_bound(role) || monitor_.verdict(role) == ReadingVerdict::kValid) continue;
    return {StopReason::kInputs, {.what = "silent", .role = role}};
  }
  return {StopReason::kInputs, {}};
}

Duration InputStage::slowest_stale() const noexcept {
  Duration slowest{};
  for (std::size_t i = 0; i < kRoleCount; ++i) {
    const auto role = static_cast<Role>(i);
    const bool idle = role == Role::kOilTemperature || role == Role::kVehicleSpeed ||
                      role == Role::kSecondaryPressure;
    if (idle || !monitor_.is_bound(role)) continue;
    slowest = std::max(slowest, monitor_.period(role).value_or(Duration{}));
  }
  return InputMonitor::stale_after(slowest);
}

}  // namespace beltgrip::daemon
