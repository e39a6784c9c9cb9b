// The frames that one sample leaves to be sent, in sending order. Fixed capacity.
#pragma once

#include <array>
#include <cassert>
#include <cstddef>

#include "can_dbc/can_frame.h"

namespace beltgrip::daemon {

struct Outbox {
  static constexpr std::size_t kCapacity = 12;
  std::array<can::CanFrame, kCapacity> frames;
  std::size_t size = 0;

  void push(const can::CanFrame& frame) noexcept {
    assert(size < kCapacity);
    frames[size++] = frame;
  }
};

}  // namespace beltgrip::daemon
