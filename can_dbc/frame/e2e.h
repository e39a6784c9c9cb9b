// AUTOSAR E2E Profile 1, variant 1A: Crc is byte 0, Counter the low nibble of byte 1, 0..14.
// CRC-8 polynomial 0x1D, start 0x00, no reflection, no final XOR, over data-id low byte, data-id
// high byte, then bytes 1 to 7. Pure functions, any thread.
#pragma once

#include <cstdint>
#include <span>

#include "can_dbc/frame/can_frame.h"

namespace beltgrip::can::e2e {

inline constexpr std::uint8_t kCounterMax = 14;  // 15 is never sent

std::uint8_t crc_profile1(std::uint16_t data_id,
                          std::span<const std::uint8_t> bytes_1_to_7) noexcept;
// Writes counter (low nibble of byte 1) and CRC (byte 0). Precondition: 8 payload bytes, counter
// <= 14.
void protect(CanFrame& frame, std::uint16_t data_id, std::uint8_t counter) noexcept;
constexpr std::uint8_t next_counter(std::uint8_t counter) noexcept {
  return counter >= kCounterMax ? 0 : static_cast<std::uint8_t>(counter + 1);
}

enum class CheckStatus { kOk, kOkSomeLost, kRepeated, kWrongSequence, kWrongCrc };

// Receiver side: last counter seen and the verdict on each frame. max_delta = 1 + frames that may
// be lost in a row. The first correct frame is kOk.
class Checker {
 public:
  Checker(std::uint16_t data_id, std::uint8_t max_delta) noexcept;
  CheckStatus check(const CanFrame& frame) noexcept;
  void reset() noexcept;

 private:
  std::uint16_t data_id_;
  std::uint8_t max_delta_;
  std::uint8_t last_counter_ = 0;
  bool seen_ = false;
};

}  // namespace beltgrip::can::e2e
