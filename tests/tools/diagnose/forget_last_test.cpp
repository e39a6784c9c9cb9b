// The name that came last goes, those before it stay. The recordings are the blind generator's.
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/tools/diagnose/recorded_runs.h"
#include "tools/diagnose/decide/namer.h"

namespace beltgrip::diagnose {
namespace {

int slot_of(const Campaign& campaign, std::string_view label) {
  const auto found = std::find_if(campaign.slots.begin(), campaign.slots.end(),
                                  [&](const Slot& slot) { return slot.label() == label; });
  return static_cast<int>(found - campaign.slots.begin());
}

// A drag behind the belt is there, a delay of the torque is not.
TEST(ForgetLast, LeavesTheNamesBefore) {
  blind::Trial trial;
  trial.seed = 7;
  trial.machine.secondary_loss_Nm = 4.5;
  blind::Random random(trial.seed);
  trial.plan = blind::draw_plan(random, trial.machine.setting, 10);
  Engine engine(campaign_of(trial));
  const auto never = [] { return false; };
  Naming naming = name_effects(engine, never);
  const int there = slot_of(engine.campaign(), "secondary_loss.constant_Nm");
  const int last = slot_of(engine.campaign(), "torque_delay.delay_s");
  ASSERT_EQ(engine.accepted(), std::vector<int>{there});
  engine.accept(engine.refine({there, last}));
  engine.update_noise();

  forget_last(engine, naming, never);

  EXPECT_EQ(engine.accepted(), std::vector<int>{there});
  EXPECT_EQ(engine.state().effects[last], 0.0);
  ASSERT_EQ(naming.accepted.size(), 1U);
  EXPECT_EQ(naming.accepted.front().slot, there);
  EXPECT_NEAR(naming.hypothesis.state.effects[there], 4.0, 1.2);
  ASSERT_FALSE(naming.not_confirmed.empty());
  EXPECT_EQ(naming.not_confirmed.back(), last);
}

}  // namespace
}  // namespace beltgrip::diagnose
