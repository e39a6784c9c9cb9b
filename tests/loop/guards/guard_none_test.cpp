// No guard at all: each sabotage does its harm, or the tests beside this one would show nothing.
#include <gtest/gtest.h>

#include "tests/loop/guards/harm.h"

namespace beltgrip::test {
namespace {

TEST(NoGuard, EachSabotageDoesItsHarm) {
  for (const GuardCase& each : guard_cases()) {
    SCOPED_TRACE(each.name);
    EXPECT_NE(each.harm(run_guarded(each)), "");
  }
}

}  // namespace
}  // namespace beltgrip::test
