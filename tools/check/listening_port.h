// A port that shows every frame to a watch and sends nothing: the daemon's own loop runs behind it,
// and no bus hears of it. With a length it ends after so long. Tools only.
#pragma once

#include <optional>

#include "daemon/core/base/port.h"
#include "tools/check/role_watch.h"

namespace beltgrip::check {

class ListeningPort final : public daemon::Port {
 public:
  ListeningPort(daemon::Port& port, RoleWatch& watch, std::optional<daemon::Duration> length = {})
      : port_(port), watch_(watch) {
    if (length) end_ = port.now() + *length;
  }

  daemon::MonoTime now() noexcept override { return port_.now(); }
  daemon::Wake wait_until(daemon::MonoTime deadline) noexcept override {
    if (end_ && port_.now() >= *end_) return daemon::Wake::kClosed;
    return port_.wait_until(deadline);
  }
  std::size_t receive(std::span<daemon::RxFrame> out) noexcept override {
    const std::size_t count = port_.receive(out);
    for (std::size_t i = 0; i < count; ++i) watch_.on_frame(out[i]);
    return count;
  }
  daemon::SendResult send(const can::CanFrame&) noexcept override {
    return daemon::SendResult::kSent;
  }
  daemon::SendResult send_on(std::uint8_t, const can::CanFrame&) noexcept override {
    return daemon::SendResult::kSent;
  }
  daemon::BusState bus_state() noexcept override { return port_.bus_state(); }
  daemon::BusState bus_state_of(std::uint8_t bus) noexcept override {
    return port_.bus_state_of(bus);
  }
  daemon::MonoTime silent_until() noexcept override { return port_.silent_until(); }

 private:
  daemon::Port& port_;
  RoleWatch& watch_;
  std::optional<daemon::MonoTime> end_;
};

}  // namespace beltgrip::check
