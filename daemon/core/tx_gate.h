// The one exit: reads the bytes about to leave and lets pass only what is allowed. Default deny.
// Knows nothing of the publisher, the experiment or the estimator: it judges the frame alone.
// Real-time thread.
//
// Passes: one of the four identifiers, standard, data, classic, 8 bytes, right CRC for its data id,
// a legal counter that follows the one before (any after a refusal), codes inside their tables,
// MuMaxValid only with a value; a clamp frame only with control "command".
#pragma once

#include <array>
#include <cstdint>

#include "can_dbc/can_frame.h"
#include "daemon/core/config.h"

namespace beltgrip::daemon {

class TxGate {
 public:
  TxGate(const FrameIdentifiers& identifiers, Control control) noexcept;
  bool permits(const can::CanFrame& frame) noexcept;  // counts what it refuses
  std::uint64_t refused() const noexcept { return refused_; }

 private:
  static constexpr std::size_t kMessages = 4;
  static constexpr std::uint8_t kAnyCounter = 0xFF;

  std::size_t message_of(const can::CanFrame& frame) const noexcept;  // kMessages: none

  std::array<std::uint32_t, kMessages> identifiers_;
  std::array<std::uint8_t, kMessages> expected_counter_;
  Control control_;
  std::uint64_t refused_ = 0;
};

}  // namespace beltgrip::daemon
