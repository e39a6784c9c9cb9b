// The experiment's state machine: every state with every combination of guards against the table of
// its header, written out here a second time as rules, and what can be reached.
#include "daemon/core/experiment.h"

#include <gtest/gtest.h>

#include <set>

namespace beltgrip::daemon {
namespace {

using estimator::StopReason;

Guards guards_of(unsigned word) {
  return {(word & 1U) != 0, (word & 2U) != 0,  (word & 4U) != 0,
          (word & 8U) != 0, (word & 16U) != 0, (word & 32U) != 0};
}
constexpr unsigned kWords = 64;

Transition expected(State state, const Guards& g) {
  if (state == State::kInhibited || state == State::kIdle) {
    if (g.inputs_usable && g.bus_up && g.triggered) return {State::kRamping, Action::kStart};
    if (g.inputs_usable && g.bus_up) return {State::kIdle, Action::kNone};
    return {State::kInhibited, Action::kNone};
  }
  if (state == State::kRamping) {
    if (!g.bus_up) return {State::kReleasing, Action::kAbort, StopReason::kBus};
    if (g.inputs_lost) return {State::kReleasing, Action::kAbort, StopReason::kInputs};
    if (g.stop_decided) return {State::kEvaluating, Action::kStop};
    return g.triggered ? Transition{State::kRamping, Action::kNone}
                       : Transition{State::kEvaluating, Action::kEnd};
  }
  if (state == State::kEvaluating) {
    return g.concluded ? Transition{State::kReleasing, Action::kPublish}
                       : Transition{State::kEvaluating, Action::kNone};
  }
  if (state == State::kReleasing) {
    return g.triggered ? Transition{State::kReleasing, Action::kNone}
                       : Transition{State::kInhibited, Action::kOver};
  }
  return {State::kInhibited, Action::kNone};
}

TEST(Experiment, EveryStateWithEveryGuardWord) {
  for (std::size_t s = 0; s < kStateCount; ++s) {
    for (unsigned word = 0; word < kWords; ++word) {
      const auto state = static_cast<State>(s);
      const Transition got = next_state(state, guards_of(word));
      const Transition want = expected(state, guards_of(word));
      EXPECT_EQ(got.next, want.next) << s << " " << word;
      EXPECT_EQ(got.action, want.action) << s << " " << word;
      EXPECT_EQ(got.abort_reason, want.abort_reason) << s << " " << word;
    }
  }
}

TEST(Experiment, OnlyTheStatesOfAnObservedExperimentAreReached) {
  std::set<State> reached{State::kInhibited};
  for (std::size_t before = 0; before != reached.size();) {
    before = reached.size();
    for (const State state : std::set<State>(reached)) {
      for (unsigned word = 0; word < kWords; ++word) {
        reached.insert(next_state(state, guards_of(word)).next);
      }
    }
  }
  EXPECT_EQ(reached, (std::set<State>{State::kInhibited, State::kIdle, State::kRamping,
                                      State::kReleasing, State::kEvaluating}));
}

TEST(Experiment, AFaultEndsRampingInOneStep) {
  for (unsigned word = 0; word < kWords; ++word) {
    const Guards guards = guards_of(word);
    if (!guards.inputs_lost && guards.bus_up) continue;
    EXPECT_EQ(next_state(State::kRamping, guards).action, Action::kAbort) << word;
  }
}

}  // namespace
}  // namespace beltgrip::daemon
