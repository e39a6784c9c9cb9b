// The daemon's Port over a log: the stamps are the clock, time passes only in wait_until, what is
// sent is handed to a receiver and confirmed at once: a log says nothing of the confirmations of
// another daemon. A frame of the log that is the one just sent (a request for diagnostics that the
// recorded daemon sent as well) is taken for its echo, not for another node's. Tools only.
#pragma once

#include <array>
#include <cstdint>
#include <functional>

#include "daemon/core/base/port.h"
#include "tools/ports/log_timeline.h"

namespace beltgrip::ports {

class ReplayPort final : public daemon::Port {
 public:
  using Receiver = std::function<void(daemon::MonoTime, const can::CanFrame&, std::uint8_t bus)>;

  // receiver may be empty.
  ReplayPort(LogTimeline& log, Receiver receiver);

  bool empty() const { return !has_next_; }  // before the first call: the log has no frame
  // Before the first frame: its stamp.
  daemon::MonoTime now() noexcept override { return now_; }
  daemon::Wake wait_until(daemon::MonoTime deadline) noexcept override;
  std::size_t receive(std::span<daemon::RxFrame> out) noexcept override;
  daemon::SendResult send(const can::CanFrame& frame) noexcept override;
  daemon::SendResult send_on(std::uint8_t bus, const can::CanFrame& frame) noexcept override;
  // With a receiver every frame that the daemon would have sent is wanted, but for pauses of the
  // recording beyond ten minutes.
  daemon::MonoTime silent_until() noexcept override;
  daemon::BusState bus_state() noexcept override { return daemon::BusState::kActive; }
  daemon::BusState bus_state_of(std::uint8_t) noexcept override { return bus_state(); }

 private:
  daemon::MonoTime next_t() const noexcept { return daemon::MonoTime::of_ns(next_.t_ns); }

  LogTimeline& log_;
  Receiver receiver_;
  can::StampedFrame next_;
  bool has_next_;
  daemon::MonoTime now_;
  daemon::MonoTime limit_;  // frames up to here have arrived
  static constexpr std::size_t kEchoes = 32;
  struct Echo {
    can::CanFrame frame;
    std::uint8_t bus = 0;
  };
  std::array<Echo, kEchoes> echoes_;  // sent, not yet confirmed
  std::size_t echo_count_ = 0;
  struct Sent {
    can::CanFrame frame;
    std::uint8_t bus = 0;
    daemon::MonoTime t = daemon::MonoTime::origin();
  };
  static constexpr std::size_t kSent = 32;
  std::array<Sent, kSent> sent_;  // the last of each bus and identifier that the log has not shown
  std::size_t sent_count_ = 0;
  void remember(std::uint8_t bus, const can::CanFrame& frame) noexcept;
  bool take_sent(const can::StampedFrame& frame) noexcept;
};

}  // namespace beltgrip::ports
