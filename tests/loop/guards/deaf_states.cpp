// The state machine, deaf: what it once let stand goes on, whatever the estimator, the inputs, the
// bus, the driver or the safety monitor say. The product's own source is read under another name,
// so that its other states stay what they are: a copy of the table could differ from it.
#define next_state told_next_state
#include "daemon/core/experiment/experiment.cpp"  // NOLINT(bugprone-suspicious-include)
#undef next_state

namespace beltgrip::daemon {

Transition next_state(State state, const Guards& guards) noexcept;

Transition next_state(State state, const Guards& guards) noexcept {
  return state == State::kRamping ? Transition{State::kRamping} : told_next_state(state, guards);
}

}  // namespace beltgrip::daemon
