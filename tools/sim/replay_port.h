// The daemon's Port over a log: the stamps are the clock, time passes only in wait_until, what is
// sent is handed to a receiver. Tools only.
#pragma once

#include <array>
#include <cstdint>
#include <functional>

#include "daemon/core/port.h"
#include "tools/sim/log_timeline.h"

namespace beltgrip::sim {

class ReplayPort final : public daemon::Port {
 public:
  using Receiver = std::function<void(daemon::MonoTime, const can::CanFrame&)>;

  // receiver may be empty.
  ReplayPort(LogTimeline& log, Receiver receiver);

  bool empty() const { return !has_next_; }  // before the first call: the log has no frame
  // Before the first frame: its stamp.
  daemon::MonoTime now() noexcept override { return now_; }
  daemon::Wake wait_until(daemon::MonoTime deadline) noexcept override;
  std::size_t receive(std::span<daemon::RxFrame> out) noexcept override;
  daemon::SendResult send(const can::CanFrame& frame) noexcept override;
  daemon::BusState bus_state() noexcept override { return daemon::BusState::kActive; }

 private:
  LogTimeline& log_;
  Receiver receiver_;
  can::StampedFrame next_;
  bool has_next_;
  daemon::MonoTime now_ = 0;
  daemon::MonoTime limit_;  // frames up to here have arrived
};

}  // namespace beltgrip::sim
