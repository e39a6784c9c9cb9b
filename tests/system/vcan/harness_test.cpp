// The harness itself: can-utils and a raw socket see each other on vcan0, each test on its own bus.
#include <gtest/gtest.h>

#include "tests/system/vcan/vcan_fixture.h"

namespace beltgrip::test {
namespace {

class Harness : public Vcan {};

TEST_F(Harness, CansendIsSeenByTheSocket) {
  const BusSocket bus("vcan0");
  EXPECT_EQ(run({"cansend", "vcan0", "123#1122"}, kLimit).status, 0);
  const auto seen = bus.receive(kLimit);
  ASSERT_TRUE(seen);
  EXPECT_EQ(seen->frame.can_id, 0x123U);
  EXPECT_EQ(seen->frame.len, 2);
  EXPECT_EQ(seen->frame.data[1], 0x22);
  EXPECT_FALSE(seen->fd);
  EXPECT_GT(seen->t_ns, 0);
}

TEST_F(Harness, CandumpSeesWhatTheSocketSends) {
  const BusSocket bus("vcan0");
  Process candump({"candump", "-L", "-n", "2", "vcan0"});
  // candump has no sign of being ready: send until the first frame has come through.
  while (!candump.wait_for_output("12345678#", Milliseconds{20})) {
    bus.send(0x12345678U | CAN_EFF_FLAG, {});
  }
  bus.send_fd(0x7FF, {1, 2, 3});
  EXPECT_EQ(candump.wait(kLimit), 0) << candump.out();
}

TEST_F(Harness, EveryTestHasItsOwnBus) {
  EXPECT_NO_FATAL_FAILURE(add_interface("vcan1"));  // would exist already were it shared
  const BusSocket one("vcan0");
  const BusSocket other("vcan1");
  one.send(1, {});
  EXPECT_FALSE(other.receive(Milliseconds{20}));
}

TEST_F(Harness, EveryTestHasItsOwnBusStill) { EXPECT_NO_FATAL_FAILURE(add_interface("vcan1")); }

}  // namespace
}  // namespace beltgrip::test
