#include "daemon/io/link_health.h"

#include <libsocketcan.h>
#include <unistd.h>

#include <array>
#include <string_view>

namespace beltgrip::daemon {

namespace {

// By enum can_state.
constexpr std::array<std::string_view, CAN_STATE_MAX> kStates{
    "error-active", "error-warning", "error-passive", "bus-off", "stopped", "sleeping"};

}  // namespace

std::string link_health(const std::string& interface) {
  std::string line = "controller of " + interface + ": ";
  // A hardware interface has a device; asking a virtual one only draws complaints.
  const std::string device = "/sys/class/net/" + interface + "/device";
  if (access(device.c_str(), F_OK) != 0) return line + "unknown (a virtual interface has none)";
  int state = -1;
  if (can_get_state(interface.c_str(), &state) != 0 || state < 0 || state >= CAN_STATE_MAX) {
    return line + "unknown (it does not say)";
  }
  line += kStates[static_cast<std::size_t>(state)];
  can_bittiming timing{};
  if (can_get_bittiming(interface.c_str(), &timing) == 0 && timing.bitrate != 0) {
    line += ", " + std::to_string(timing.bitrate) + " bit/s";
  }
  return line;
}

}  // namespace beltgrip::daemon
