#include "daemon/io/socket_port.h"

#include <poll.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace beltgrip::daemon {

Result<std::unique_ptr<SocketPort>> SocketPort::open(const std::string& interface,
                                                     const std::vector<WantedFrames>& wanted,
                                                     int stop_fd) {
  return open({{interface, "bus.interface"}}, wanted, stop_fd);
}

Result<std::unique_ptr<SocketPort>> SocketPort::open(const std::vector<BusToOpen>& buses,
                                                     const std::vector<WantedFrames>& wanted,
                                                     int stop_fd) {
  std::unique_ptr<SocketPort> port(new SocketPort(stop_fd));
  for (const BusToOpen& bus : buses) {
    port->sockets_[port->count_] =
        std::make_unique<CanSocket>(bus.interface, wanted, static_cast<std::uint8_t>(port->count_));
    CanSocket& opened = *port->sockets_[port->count_++];
    const char* where = "";
    const int error = opened.open(where);
    if (error == 0) continue;
    const std::string reason = std::string(where) + ": " + std::strerror(error);
    if (error == EAFNOSUPPORT || error == EPROTONOSUPPORT) {
      return bus.key + ": found no SocketCAN in this kernel (" + reason +
             "), expected one with CAN_RAW, or inproc:NAME";
    }
    return bus.key + ": found no CAN interface \"" + bus.interface + "\" (" + reason +
           "), expected one that `ip link show` lists";
  }
  return port;
}

MonoTime SocketPort::now() noexcept { return monotonic_now(); }

Wake SocketPort::wait_until(MonoTime deadline) noexcept {
  for (;;) {
    const MonoTime t = now();
    MonoTime until = deadline;
    // A negative descriptor is skipped by poll.
    std::array<pollfd, kBusMax + 1> fds;
    fds[0] = {stop_fd_, POLLIN, 0};
    for (std::size_t i = 0; i < count_; ++i) {
      sockets_[i]->try_reopen(t);
      until = std::min(until, sockets_[i]->reopen_at());
      fds[i + 1] = {sockets_[i]->descriptor(), POLLIN, 0};
    }
    const bool waiting = std::any_of(waiting_.begin(), waiting_.end(),
                                     [](const Waiting& each) { return !each.empty(); });
    const Duration left = waiting ? Duration{} : std::max(until - t, Duration{});
    const timespec timeout{static_cast<time_t>(left / kSecond),
                           static_cast<long>((left % kSecond).ns())};
    const int ready = ppoll(fds.data(), count_ + 1, &timeout, nullptr);
    if (ready > 0 && (fds[0].revents & POLLIN) != 0) return Wake::kClosed;
    for (std::size_t i = 1; i <= count_ && ready > 0; ++i) {
      if (fds[i].revents != 0) return Wake::kFrames;
    }
    if (waiting) return Wake::kFrames;
    if (now() >= deadline) return Wake::kDeadline;
  }
}

std::size_t SocketPort::receive(std::span<RxFrame> out) noexcept {
  return count_ == 1 ? sockets_[0]->receive(out) : receive_merged(out);
}

// What has come to one bus up to an instant is known only once that bus has been read after it: of
// two buses, frames are handed on up to the instant before both were read.
std::size_t SocketPort::receive_merged(std::span<RxFrame> out) noexcept {
  const MonoTime known = now();
  for (std::size_t i = 0; i < count_; ++i) {
    Waiting& waiting = waiting_[i];
    if (waiting.empty()) waiting.next = waiting.end = 0;
    waiting.end += sockets_[i]->receive(std::span(waiting.frames).subspan(waiting.end));
    waiting.full = waiting.end == waiting.frames.size();
  }
  std::size_t taken = 0;
  while (taken < out.size()) {
    Waiting* first = nullptr;
    bool unread = false;
    for (Waiting& each : waiting_) {
      unread = unread || (each.empty() && each.full);
      if (each.empty() || each.frames[each.next].t > known) continue;
      if (first == nullptr || each.frames[each.next].t < first->frames[first->next].t) {
        first = &each;
      }
    }
    if (first == nullptr || unread) break;
    out[taken++] = first->frames[first->next++];
  }
  return taken;
}

SendResult SocketPort::send_on(std::uint8_t bus, const can::CanFrame& frame) noexcept {
  return bus < count_ ? sockets_[bus]->send(frame) : SendResult::kDown;
}

void SocketPort::select(std::span<const WantedFrames> wanted) noexcept {
  for (std::size_t i = 0; i < count_; ++i) sockets_[i]->select(wanted);
}

BusState SocketPort::bus_state_of(std::uint8_t bus) noexcept {
  return bus < count_ ? sockets_[bus]->state() : BusState::kAbsent;
}

}  // namespace beltgrip::daemon
