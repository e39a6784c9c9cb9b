// The experiment's state machine: every state with every combination of guards against the table of
// its header, written out here a second time as rows, and what can be reached.
#include "daemon/core/experiment/experiment.h"

#include <gtest/gtest.h>

#include <array>
#include <functional>
#include <set>
#include <utility>
#include <vector>

namespace beltgrip::daemon {
namespace {

using estimator::StopReason;

constexpr unsigned kGuardCount = 13;
constexpr unsigned kWords = 1U << kGuardCount;

Guards guards_of(unsigned word) {
  const auto bit = [word](unsigned i) { return (word >> i & 1U) != 0; };
  Guards g{bit(0), bit(1), bit(2), bit(3),  bit(4),  bit(5), bit(6),
           bit(7), bit(8), bit(9), bit(10), bit(11), bit(12)};
  g.withdrawn_reason = StopReason::kDriver;
  return g;
}

struct Row {
  std::vector<State> from;
  std::function<bool(const Guards&)> when;
  State next;
  Action action = Action::kNone;
  StopReason reason = StopReason::kNone;
};

const std::vector<Row>& table() {
  using G = const Guards&;
  const std::vector<State> before{State::kInhibited, State::kIdle, State::kSettling};
  static const std::vector<Row> rows{
      {before, [](G g) { return g.faulted; }, State::kFault},
      {before, [](G g) { return !g.inputs_usable; }, State::kInhibited},
      {before, [](G g) { return !g.bus_up; }, State::kInhibited},
      {before, [](G g) { return !g.triggered; }, State::kIdle},
      {before, [](G g) { return !g.settled; }, State::kSettling},
      {before, [](G g) { return g.cleared; }, State::kRamping, Action::kStart},
      {before, [](G) { return true; }, State::kEvaluating, Action::kRefuse},
      {{State::kRamping},
       [](G g) { return !g.bus_up; },
       State::kReleasing,
       Action::kAbort,
       StopReason::kBus},
      {{State::kRamping},
       [](G g) { return g.inputs_lost; },
       State::kReleasing,
       Action::kAbort,
       StopReason::kInputs},
      {{State::kRamping},
       [](G g) { return g.withdrawn; },
       State::kReleasing,
       Action::kAbort,
       StopReason::kDriver},
      {{State::kRamping}, [](G g) { return g.stop_decided; }, State::kEvaluating, Action::kStop},
      {{State::kRamping}, [](G g) { return !g.triggered; }, State::kEvaluating, Action::kEnd},
      {{State::kRamping}, [](G) { return true; }, State::kRamping},
      {{State::kEvaluating}, [](G g) { return g.concluded; }, State::kReleasing, Action::kPublish},
      {{State::kEvaluating}, [](G) { return true; }, State::kEvaluating},
      {{State::kReleasing}, [](G g) { return g.stuck; }, State::kFault, Action::kOver},
      {{State::kReleasing}, [](G g) { return !g.released; }, State::kReleasing},
      {{State::kReleasing}, [](G g) { return !g.cooled; }, State::kCooldown, Action::kOver},
      {{State::kReleasing}, [](G) { return true; }, State::kInhibited, Action::kOver},
      {{State::kCooldown}, [](G g) { return g.faulted; }, State::kFault},
      {{State::kCooldown}, [](G g) { return g.cooled; }, State::kInhibited},
      {{State::kCooldown}, [](G) { return true; }, State::kCooldown},
      {{State::kFault}, [](G g) { return g.faulted; }, State::kFault},
      {{State::kFault}, [](G g) { return !g.cooled; }, State::kCooldown},
      {{State::kFault}, [](G) { return true; }, State::kInhibited}};
  return rows;
}

Transition expected(State state, const Guards& guards) {
  for (const Row& row : table()) {
    for (const State from : row.from) {
      if (from == state && row.when(guards)) return {row.next, row.action, row.reason};
    }
  }
  ADD_FAILURE() << "the table has no row for state " << static_cast<int>(state);
  return {};
}

template <typename Check>
void for_all(Check check) {
  for (std::size_t s = 0; s < kStateCount; ++s) {
    for (unsigned word = 0; word < kWords; ++word) {
      const auto state = static_cast<State>(s);
      const Guards guards = guards_of(word);
      check(state, guards, next_state(state, guards));
    }
  }
}

TEST(Experiment, EveryStateWithEveryGuardWord) {
  for_all([](State state, const Guards& guards, const Transition& got) {
    const Transition want = expected(state, guards);
    ASSERT_EQ(got.next, want.next) << static_cast<int>(state);
    ASSERT_EQ(got.action, want.action) << static_cast<int>(state);
    ASSERT_EQ(got.abort_reason, want.abort_reason) << static_cast<int>(state);
  });
}

TEST(Experiment, ForbiddenPairsAreUnreachable) {
  std::set<std::pair<State, State>> pairs;
  for_all([&](State state, const Guards&, const Transition& got) {
    pairs.insert({state, got.next});
  });
  const auto never = [&](State from, State to) {
    EXPECT_FALSE(pairs.contains({from, to}))
        << static_cast<int>(from) << " -> " << static_cast<int>(to);
  };
  for (const State from :
       {State::kReleasing, State::kEvaluating, State::kCooldown, State::kFault}) {
    never(from, State::kRamping);
    never(from, State::kSettling);
    never(from, State::kIdle);
  }
  for (const State to : {State::kReleasing, State::kEvaluating}) never(State::kFault, to);
  never(State::kRamping, State::kInhibited);
  never(State::kRamping, State::kIdle);
  never(State::kRamping, State::kCooldown);
  never(State::kEvaluating, State::kInhibited);
  never(State::kEvaluating, State::kCooldown);
}

TEST(Experiment, EveryStateIsReachedAndRampingOnlyWithEveryGuardOfTheStart) {
  std::set<State> reached{State::kInhibited};
  for (std::size_t before = 0; before != reached.size();) {
    before = reached.size();
    for (const State state : std::set<State>(reached)) {
      for (unsigned word = 0; word < kWords; ++word) {
        reached.insert(next_state(state, guards_of(word)).next);
      }
    }
  }
  EXPECT_EQ(reached.size(), kStateCount);
  for_all([](State state, const Guards& g, const Transition& got) {
    if (got.next != State::kRamping || state == State::kRamping) return;
    ASSERT_EQ(got.action, Action::kStart);
    ASSERT_TRUE(g.inputs_usable && g.bus_up && g.triggered && g.settled && g.cleared && !g.faulted);
  });
}

TEST(Experiment, WhateverGoesWrongEndsRampingInOneStep) {
  for_all([](State state, const Guards& g, const Transition& got) {
    if (state != State::kRamping) return;
    if (g.inputs_lost || !g.bus_up || g.withdrawn) {
      ASSERT_EQ(got.action, Action::kAbort);
      ASSERT_EQ(got.next, State::kReleasing);
    } else if (g.stop_decided || !g.triggered) {
      ASSERT_EQ(got.next, State::kEvaluating);
    }
  });
}

TEST(Experiment, ObservationPassesTheStatesItAlwaysDid) {
  // observe with trigger "signal": settled, cleared, cooled hold, nothing is withdrawn.
  std::set<State> reached{State::kInhibited};
  for (std::size_t before = 0; before != reached.size();) {
    before = reached.size();
    for (const State state : std::set<State>(reached)) {
      for (unsigned word = 0; word < 64; ++word) {
        Guards guards = guards_of(word);
        guards.settled = guards.cleared = guards.cooled = true;
        guards.released = !guards.triggered;
        reached.insert(next_state(state, guards).next);
      }
    }
  }
  EXPECT_EQ(reached, (std::set<State>{State::kInhibited, State::kIdle, State::kRamping,
                                      State::kReleasing, State::kEvaluating}));
}

}  // namespace
}  // namespace beltgrip::daemon
