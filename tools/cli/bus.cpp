#include "tools/cli/bus.h"

#include <array>
#include <optional>
#include <string_view>

#include "daemon/io/inproc_bus.h"
#include "daemon/io/socket_port.h"
#include "tools/cli/failure.h"

namespace beltgrip::cli {

namespace {

constexpr std::string_view kInproc = "inproc:";
constexpr daemon::Duration kRetryPause = daemon::kMillisecond;  // after a full queue

// False: stopped.
bool pass_time(daemon::Port& port, daemon::MonoTime until) {
  std::array<daemon::RxFrame, 64> unwanted;
  while (port.now() < until) {
    const daemon::Wake wake = port.wait_until(until);
    if (wake == daemon::Wake::kClosed) return false;
    if (wake == daemon::Wake::kFrames) port.receive(unwanted);
  }
  return true;
}

// False: stopped.
bool send(daemon::Port& port, const std::string& name, const can::CanFrame& frame) {
  for (;;) {
    switch (port.send(frame)) {
      case daemon::SendResult::kSent:
        return true;
      case daemon::SendResult::kFull:
        if (!pass_time(port, port.now() + kRetryPause)) return false;
        break;
      case daemon::SendResult::kDown:
        throw Failure{kUnavailable, name + ": the interface is down"};
      case daemon::SendResult::kFailed:
        throw Failure{kUnavailable, name + ": a frame could not be sent"};
    }
  }
}

}  // namespace

std::unique_ptr<daemon::Port> open_bus(const std::string& name,
                                       const std::vector<can::CanId>& identifiers, int stop_fd) {
  if (name.starts_with(kInproc)) {
    return daemon::InprocBus::named(name.substr(kInproc.size()))->connect();
  }
  std::vector<daemon::WantedFrames> wanted;
  wanted.reserve(identifiers.size());
  for (const can::CanId id : identifiers) wanted.push_back({id, false});
  auto opened = daemon::SocketPort::open(name, wanted, stop_fd);
  if (!opened) throw Failure{kUnavailable, opened.error()};
  return std::move(*opened);
}

std::unique_ptr<daemon::Port> open_buses_whole(const daemon::Config& config, int stop_fd) {
  if (config.interface.starts_with(kInproc)) return open_bus(config.interface, {}, stop_fd);
  std::vector<daemon::BusToOpen> buses{{config.interface, "bus.interface"}};
  std::vector<daemon::WantedFrames> wanted{{.id = {}, .bus = 0, .every = true}};
  if (config.further_bus) {
    buses.push_back(
        {config.further_bus->interface, "bus." + config.further_bus->name + ".interface"});
    wanted.push_back({.id = {}, .bus = 1, .every = true});
  }
  auto opened = daemon::SocketPort::open(buses, wanted, stop_fd);
  if (!opened) throw Failure{kUnavailable, opened.error()};
  return std::move(*opened);
}

bool play(daemon::Port& port, const std::string& name, double speed,
          const std::function<bool(can::StampedFrame&)>& next) {
  const daemon::MonoTime origin = port.now();
  std::optional<std::int64_t> first_ns;
  can::StampedFrame stamped;
  while (next(stamped)) {
    if (stamped.frame.error) continue;  // said by a controller, not sent by a node
    if (!first_ns) first_ns = stamped.t_ns;
    const auto after_ns = static_cast<double>(stamped.t_ns - *first_ns) / speed;
    if (!pass_time(port, origin + daemon::Duration::of_ns(static_cast<std::int64_t>(after_ns))))
      return false;
    if (!send(port, name, stamped.frame)) return false;
  }
  return true;
}

bool play_node(daemon::Port& port, double speed, const NodeStep& advance) {
  constexpr daemon::Duration kStep = daemon::kMillisecond;
  const daemon::MonoTime origin = port.now();
  std::array<daemon::RxFrame, 64> frames;
  std::vector<can::CanFrame> out;
  for (std::int64_t now_ns = 0;; now_ns += kStep.ns()) {
    const auto due = origin + daemon::Duration::of_ns(
                                  static_cast<std::int64_t>(static_cast<double>(now_ns) / speed));
    std::size_t count = 0;
    for (;;) {
      const daemon::Wake wake = port.wait_until(due);
      if (wake == daemon::Wake::kClosed) return false;
      if (wake == daemon::Wake::kDeadline) break;
      count = port.receive(frames);
      out.clear();
      if (!advance(now_ns, {frames.data(), count}, out)) return true;
      for (const can::CanFrame& frame : out) static_cast<void>(port.send(frame));
    }
    out.clear();
    if (!advance(now_ns, {}, out)) return true;
    for (const can::CanFrame& frame : out) static_cast<void>(port.send(frame));
  }
}

}  // namespace beltgrip::cli
