// What the CAN controller behind an interface says of itself (can_link.h), as a line for the log:
// state and bit rate. It blocks, so it is asked once, at start-up. While the loop runs, the
// controller's error frames tell.
#pragma once

#include <string>

namespace beltgrip::daemon {

// One line for the log: "controller of can0: error-active, 500000 bit/s". An interface without a
// controller (vcan, vxcan) and one that does not answer have an unknown one: normal, not a fault.
std::string link_health(const std::string& interface);

}  // namespace beltgrip::daemon
