#include "daemon/core/experiment/experiment.h"

namespace beltgrip::daemon {

using estimator::StopReason;

namespace {

Transition before_start(const Guards& guards) noexcept {
  if (guards.faulted) return {State::kFault};
  if (!guards.inputs_usable || !guards.bus_up) return {State::kInhibited};
  if (!guards.triggered) return {State::kIdle};
  if (!guards.settled) return {State::kSettling};
  if (guards.cleared) return {State::kRamping, Action::kStart};
  return {State::kEvaluating, Action::kRefuse};
}

Transition ramping(const Guards& guards) noexcept {
  if (!guards.bus_up) return {State::kReleasing, Action::kAbort, StopReason::kBus};
  if (guards.inputs_lost) return {State::kReleasing, Action::kAbort, guards.lost_reason};
  if (guards.withdrawn) return {State::kReleasing, Action::kAbort, guards.withdrawn_reason};
  if (guards.stop_decided) return {State::kEvaluating, Action::kStop};
  if (!guards.triggered) return {State::kEvaluating, Action::kEnd};
  return {State::kRamping};
}

Transition releasing(const Guards& guards) noexcept {
  if (guards.stuck) return {State::kFault, Action::kOver};
  if (!guards.released) return {State::kReleasing};
  return {guards.cooled ? State::kInhibited : State::kCooldown, Action::kOver};
}

}  // namespace

Transition next_state(State state, const Guards& guards) noexcept {
  switch (state) {
    case State::kInhibited:
    case State::kIdle:
    case State::kSettling:
      return before_start(guards);
    case State::kRamping:
      return ramping(guards);
    case State::kEvaluating:
      if (guards.concluded) return {State::kReleasing, Action::kPublish};
      return {State::kEvaluating};
    case State::kReleasing:
      return releasing(guards);
    case State::kCooldown:
      if (guards.faulted) return {State::kFault};
      return {guards.cooled ? State::kInhibited : State::kCooldown};
    case State::kFault:
      if (guards.faulted) break;
      return {guards.cooled ? State::kInhibited : State::kCooldown};
  }
  return {State::kFault};
}

}  // namespace beltgrip::daemon
