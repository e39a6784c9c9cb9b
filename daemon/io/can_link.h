// A CAN interface as its driver and controller describe it, and what can be set of it: libsocketcan
// (netlink) and two ioctls. Blocks, so never on the real-time thread; setting needs CAP_NET_ADMIN.
// Where a controller or a virtual interface cannot say, the value is absent: normal, not a fault.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "daemon/core/base/result.h"

namespace beltgrip::daemon {

struct CanLink {
  std::string interface;
  bool up = false;
  std::string driver;  // as the driver calls itself; "vcan" and "vxcan" are virtual
  bool has_controller = false;
  int queue_length = 0;  // frames
  // The controller's.
  std::optional<std::string_view> state;    // "error-active", ...
  std::optional<std::uint32_t> bitrate;     // bit/s
  std::optional<double> sample_point;       // share of a bit
  std::optional<std::uint32_t> restart_ms;  // 0: none
  struct ErrorCounters {
    unsigned transmit = 0, receive = 0;
  };
  std::optional<ErrorCounters> error_counters;
  struct DeviceCounters {
    std::uint32_t bus_errors = 0, warnings = 0, passives = 0, bus_offs = 0, arbitration_lost = 0,
                  restarts = 0;
  };
  std::optional<DeviceCounters> device_counters;
  // The interface's.
  struct FrameCounters {
    std::uint64_t received = 0, sent = 0, receive_errors = 0, transmit_errors = 0;
    std::uint64_t received_dropped = 0, sent_dropped = 0, overruns = 0;
  };
  std::optional<FrameCounters> frame_counters;
};

// Where there is no such CAN interface: one line that says what is there.
Result<CanLink> read_can_link(const std::string& interface);

// What is to be set; what is absent stays as it is.
struct CanLinkSetting {
  std::optional<std::uint32_t> bitrate;
  std::optional<double> sample_point;
  std::optional<std::uint32_t> restart_ms;
  std::optional<int> queue_length;
};
// Sets it and brings the interface up; it is taken down for that where it is up already. Empty:
// done, else one line: what was refused and why.
std::string bring_up(const CanLink& link, const CanLinkSetting& setting);
std::string bring_down(const CanLink& link);

}  // namespace beltgrip::daemon
