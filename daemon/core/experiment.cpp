#include "daemon/core/experiment.h"

namespace beltgrip::daemon {

using estimator::StopReason;

Transition next_state(State state, const Guards& guards) noexcept {
  const bool ready = guards.inputs_usable && guards.bus_up;
  switch (state) {
    case State::kInhibited:
    case State::kIdle:
      if (!ready) return {State::kInhibited};
      if (guards.triggered) return {State::kRamping, Action::kStart};
      return {State::kIdle};
    case State::kRamping:
      if (!guards.bus_up) return {State::kReleasing, Action::kAbort, StopReason::kBus};
      if (guards.inputs_lost) return {State::kReleasing, Action::kAbort, StopReason::kInputs};
      if (guards.stop_decided) return {State::kEvaluating, Action::kStop};
      if (!guards.triggered) return {State::kEvaluating, Action::kEnd};
      return {State::kRamping};
    case State::kEvaluating:
      if (guards.concluded) return {State::kReleasing, Action::kPublish};
      return {State::kEvaluating};
    case State::kReleasing:
      if (!guards.triggered) return {State::kInhibited, Action::kOver};
      return {State::kReleasing};
    case State::kSettling:
    case State::kCooldown:
    case State::kFault:
      break;
  }
  return {State::kInhibited};
}

}  // namespace beltgrip::daemon
