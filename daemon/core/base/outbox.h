// The frames that one sample leaves to be sent, in sending order. Fixed capacity.
#pragma once

#include <array>
#include <cassert>
#include <cstddef>
#include <cstdint>

#include "can_dbc/frame/can_frame.h"

namespace beltgrip::daemon {

struct Outbox {
  // Own frames at the most at the end; a request or a flow control to each ECU otherwise.
  static constexpr std::size_t kCapacity = 32;
  std::array<can::CanFrame, kCapacity> frames;
  std::array<std::uint8_t, kCapacity> bus;  // of each
  std::size_t size = 0;

  void push(const can::CanFrame& frame, std::uint8_t on_bus = 0) noexcept {
    assert(size < kCapacity);
    frames[size] = frame;
    bus[size++] = on_bus;
  }
};

}  // namespace beltgrip::daemon
