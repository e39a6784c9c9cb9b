// Error frames of every class with every detail byte, as linux/can/error.h defines them.
#include "daemon/core/base/bus_error.h"

#include <gtest/gtest.h>
#include <linux/can/error.h>

namespace beltgrip::daemon {
namespace {

can::CanFrame error_frame(std::uint32_t classes, std::uint8_t details) {
  can::CanFrame frame;
  frame.error = true;
  frame.id.value = classes;
  frame.length = 8;
  frame.data[1] = details;
  return frame;
}

TEST(BusError, EveryCombinationOfClassesAndDetails) {
  for (std::uint32_t classes = 0; classes < 0x400; ++classes) {
    for (unsigned details = 0; details < 256; ++details) {
      std::optional<BusState> expected;
      if ((classes & CAN_ERR_CRTL) != 0) {
        if ((details & CAN_ERR_CRTL_ACTIVE) != 0) expected = BusState::kActive;
        if ((details & (CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING)) != 0) {
          expected = BusState::kWarning;
        }
        if ((details & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE)) != 0) {
          expected = BusState::kPassive;
        }
      }
      if ((classes & CAN_ERR_RESTARTED) != 0) expected = BusState::kActive;
      if ((classes & CAN_ERR_BUSOFF) != 0) expected = BusState::kOff;
      ASSERT_EQ(bus_state_of(error_frame(classes, static_cast<std::uint8_t>(details))), expected)
          << classes << " " << details;
    }
  }
}

TEST(BusError, ShortAndOrdinaryFramesSayNothing) {
  can::CanFrame frame = error_frame(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_PASSIVE);
  frame.length = 1;
  EXPECT_EQ(bus_state_of(frame), std::nullopt);
  frame = error_frame(CAN_ERR_BUSOFF, 0);
  frame.error = false;
  EXPECT_EQ(bus_state_of(frame), std::nullopt);
}

}  // namespace
}  // namespace beltgrip::daemon
