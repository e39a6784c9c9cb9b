// The state of the CAN controller as its error frames tell it (linux/can/error.h gives the layout).
// Pure. Real-time thread.
#pragma once

#include <optional>

#include "can_dbc/frame/can_frame.h"
#include "daemon/core/base/port.h"

namespace beltgrip::daemon {

// Nothing where the frame says nothing about the state (arbitration lost, no acknowledge, ...).
std::optional<BusState> bus_state_of(const can::CanFrame& error_frame) noexcept;

}  // namespace beltgrip::daemon
