#include "daemon/io/can_link.h"

#include <fcntl.h>
#include <libsocketcan.h>
#include <linux/ethtool.h>
#include <linux/if_link.h>
#include <linux/sockios.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>

namespace beltgrip::daemon {

namespace {

// By enum can_state.
constexpr std::array<std::string_view, CAN_STATE_MAX> kStates{
    "error-active", "error-warning", "error-passive", "bus-off", "stopped", "sleeping"};
constexpr double kSamplePointUnit = 1000.0;  // netlink counts thousandths

// libsocketcan writes its own complaints to standard error: they are said here, in one line.
class QuietStandardError {
 public:
  QuietStandardError() : saved_(fcntl(STDERR_FILENO, F_DUPFD_CLOEXEC, 3)) {
    const int nothing = open("/dev/null", O_WRONLY | O_CLOEXEC);
    if (saved_ >= 0 && nothing >= 0) dup2(nothing, STDERR_FILENO);
    if (nothing >= 0) close(nothing);
  }
  ~QuietStandardError() {
    const int error = errno;
    if (saved_ >= 0) {
      dup2(saved_, STDERR_FILENO);
      close(saved_);
    }
    errno = error;
  }
  QuietStandardError(const QuietStandardError&) = delete;
  QuietStandardError& operator=(const QuietStandardError&) = delete;

 private:
  int saved_;
};

// An ioctl on the interface; any kind of socket carries it.
class InterfaceRequest {
 public:
  explicit InterfaceRequest(const std::string& interface) {
    interface.copy(request.ifr_name, sizeof request.ifr_name - 1);
  }
  ~InterfaceRequest() {
    if (fd_ >= 0) close(fd_);
  }
  InterfaceRequest(const InterfaceRequest&) = delete;
  InterfaceRequest& operator=(const InterfaceRequest&) = delete;
  bool call(unsigned long number) { return ioctl(fd_, number, &request) == 0; }

  ifreq request{};

 private:
  int fd_ = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
};

std::string driver_of(const std::string& interface) {
  InterfaceRequest ask(interface);
  ethtool_drvinfo driver{};
  driver.cmd = ETHTOOL_GDRVINFO;
  ask.request.ifr_data = reinterpret_cast<char*>(&driver);
  if (!ask.call(SIOCETHTOOL)) return {};
  return {driver.driver, strnlen(driver.driver, sizeof driver.driver)};
}

void read_controller(CanLink& link) {
  const char* name = link.interface.c_str();
  int state = -1;
  if (can_get_state(name, &state) == 0 && state >= 0 && state < CAN_STATE_MAX) {
    link.state = kStates[static_cast<std::size_t>(state)];
  }
  can_bittiming timing{};
  if (can_get_bittiming(name, &timing) == 0 && timing.bitrate != 0) {
    link.bitrate = timing.bitrate;
    if (timing.sample_point != 0) link.sample_point = timing.sample_point / kSamplePointUnit;
  }
  std::uint32_t restart_ms = 0;
  if (can_get_restart_ms(name, &restart_ms) == 0) link.restart_ms = restart_ms;
  can_berr_counter errors{};
  if (can_get_berr_counter(name, &errors) == 0) {
    link.error_counters = CanLink::ErrorCounters{errors.txerr, errors.rxerr};
  }
  can_device_stats device{};
  if (can_get_device_stats(name, &device) == 0) {
    link.device_counters = CanLink::DeviceCounters{
        .bus_errors = device.bus_error,
        .warnings = device.error_warning,
        .passives = device.error_passive,
        .bus_offs = device.bus_off,
        .arbitration_lost = device.arbitration_lost,
        .restarts = device.restarts,
    };
  }
}

std::string refused(const CanLink& link, const std::string& what) {
  const int error = errno;
  std::string why = std::strerror(error);
  if (error == EPERM) why += "; setting an interface takes root or CAP_NET_ADMIN";
  if (error == EOPNOTSUPP) why += " by driver \"" + link.driver + "\"";
  return link.interface + ": " + what + " was refused (" + why + ")";
}

}  // namespace

Result<CanLink> read_can_link(const std::string& interface) {
  InterfaceRequest ask(interface);
  if (interface.size() >= IFNAMSIZ || !ask.call(SIOCGIFHWADDR)) {
    return "found no interface \"" + interface + "\", expected one that `ip link show` lists";
  }
  if (ask.request.ifr_hwaddr.sa_family != ARPHRD_CAN) {
    return "found \"" + interface +
           "\", which is no CAN interface, expected one of `ip link show` with link/can";
  }
  CanLink link;
  link.interface = interface;
  link.up = ask.call(SIOCGIFFLAGS) && (ask.request.ifr_flags & IFF_UP) != 0;
  if (ask.call(SIOCGIFTXQLEN)) link.queue_length = ask.request.ifr_qlen;
  link.driver = driver_of(interface);
  link.has_controller = link.driver != "vcan" && link.driver != "vxcan";
  const QuietStandardError quiet;
  rtnl_link_stats64 frames{};
  if (can_get_link_stats(interface.c_str(), &frames) == 0) {
    link.frame_counters = CanLink::FrameCounters{
        .received = frames.rx_packets,
        .sent = frames.tx_packets,
        .receive_errors = frames.rx_errors,
        .transmit_errors = frames.tx_errors,
        .received_dropped = frames.rx_dropped,
        .sent_dropped = frames.tx_dropped,
        .overruns = frames.rx_over_errors,
    };
  }
  if (link.has_controller) read_controller(link);
  return link;
}

std::string bring_up(const CanLink& link, const CanLinkSetting& setting) {
  const char* name = link.interface.c_str();
  const bool timing = setting.bitrate || setting.sample_point;
  if (!link.has_controller && (timing || setting.restart_ms)) {
    return link.interface + ": found a virtual interface, which has no " +
           (timing ? "bit rate" : "restart time") + "; leave it out";
  }
  if (setting.sample_point && !setting.bitrate) {
    return link.interface + ": found a sample point without a bit rate, expected both";
  }
  const QuietStandardError quiet;
  if (link.up && (timing || setting.restart_ms) && can_do_stop(name) != 0) {
    return refused(link, "taking it down");
  }
  if (setting.bitrate) {
    const auto point = static_cast<std::uint32_t>(
        std::lround(setting.sample_point.value_or(0) * kSamplePointUnit));
    if (can_set_bitrate_samplepoint(name, *setting.bitrate, point) != 0) {
      return refused(link, "bit rate " + std::to_string(*setting.bitrate));
    }
  }
  if (setting.restart_ms && can_set_restart_ms(name, *setting.restart_ms) != 0) {
    return refused(link, "restart after " + std::to_string(*setting.restart_ms) + " ms");
  }
  if (setting.queue_length) {
    InterfaceRequest change(link.interface);
    change.request.ifr_qlen = *setting.queue_length;
    if (!change.call(SIOCSIFTXQLEN)) return refused(link, "the queue length");
  }
  if (can_do_start(name) != 0) return refused(link, "bringing it up");
  return {};
}

std::string bring_down(const CanLink& link) {
  const QuietStandardError quiet;
  if (can_do_stop(link.interface.c_str()) != 0) return refused(link, "taking it down");
  return {};
}

}  // namespace beltgrip::daemon
