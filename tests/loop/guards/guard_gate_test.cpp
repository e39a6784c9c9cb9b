// The transmit gate alone, in the assembled pipeline: request, state machine and safety monitor are
// sabotaged. It sees frames and the force that acts: slip and silence it cannot know.
#include <gtest/gtest.h>

#include "tests/loop/guards/harm.h"

namespace beltgrip::test {
namespace {

TEST(GateAlone, SavesTheBelt) {
  for (const GuardCase& each : guard_cases()) {
    if (each.last != Layer::kGate) continue;
    SCOPED_TRACE(each.name);
    EXPECT_EQ(each.harm(run_guarded(each)), "");
  }
}

}  // namespace
}  // namespace beltgrip::test
