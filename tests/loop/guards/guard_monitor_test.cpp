// The safety monitor alone, in the assembled pipeline: request and state machine are sabotaged, the
// transmit gate is open.
#include <gtest/gtest.h>

#include "tests/loop/guards/harm.h"

namespace beltgrip::test {
namespace {

TEST(MonitorAlone, SavesTheBelt) {
  for (const GuardCase& each : guard_cases()) {
    SCOPED_TRACE(each.name);
    EXPECT_EQ(each.harm(run_guarded(each)), "");
  }
}

}  // namespace
}  // namespace beltgrip::test
