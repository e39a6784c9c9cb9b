// A ratio of friction where the curve is flat about its peak: both peaks can slide along it, and no
// small step leads back. The recording is the blind generator's.
#include <gtest/gtest.h>

#include "tests/tools/diagnose/recorded_runs.h"
#include "tools/diagnose/decide/namer.h"

namespace beltgrip::diagnose {
namespace {

TEST(FlatCurve, ARatioOfFrictionIsFoundFromTheUsualForm) {
  blind::Trial trial;
  trial.seed = 9;
  trial.machine.law = blind::Law::kExponential;
  trial.machine.fall_per_unit = 0.01;
  trial.machine.noise_speed = 1e-4;
  trial.machine.noise_torque_Nm = 0.15;
  blind::Random random(trial.seed);
  trial.plan = blind::draw_plan(random, trial.machine.setting, 10);
  constexpr double kRelative = -0.05;
  trial.planted.push_back({"friction_ratio", {{"relative", kRelative}}, {}});
  Engine engine(campaign_of(trial));
  const Naming naming = name_effects(engine, [] { return false; });
  ASSERT_EQ(naming.accepted.size(), 1U);
  const int slot = naming.accepted.front().slot;
  EXPECT_EQ(engine.campaign().slots[static_cast<std::size_t>(slot)].row->id, "friction_ratio");
  EXPECT_NEAR(naming.hypothesis.state.effects[slot], kRelative, 0.02);
}

}  // namespace
}  // namespace beltgrip::diagnose
