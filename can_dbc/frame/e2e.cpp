#include "can_dbc/frame/e2e.h"

#include <array>
#include <cassert>

namespace beltgrip::can::e2e {

namespace {

constexpr std::uint8_t kPolynomial = 0x1D;
constexpr std::size_t kProtectedLength = 8;

constexpr std::array<std::uint8_t, 256> crc_table() {
  std::array<std::uint8_t, 256> table{};
  for (unsigned byte = 0; byte < 256; ++byte) {
    unsigned crc = byte;
    for (int bit = 0; bit < 8; ++bit)
      crc = (crc & 0x80U) != 0 ? (crc << 1) ^ kPolynomial : crc << 1;
    table[byte] = static_cast<std::uint8_t>(crc);
  }
  return table;
}
constexpr std::array<std::uint8_t, 256> kCrcTable = crc_table();

std::span<const std::uint8_t> bytes_1_to_7_of(const CanFrame& frame) noexcept {
  return {frame.data.data() + 1, kProtectedLength - 1};
}

}  // namespace

std::uint8_t crc_profile1(std::uint16_t data_id,
                          std::span<const std::uint8_t> bytes_1_to_7) noexcept {
  std::uint8_t crc = kCrcTable[data_id & 0xFFU];
  crc = kCrcTable[static_cast<std::uint8_t>(crc ^ (data_id >> 8))];
  for (const std::uint8_t byte : bytes_1_to_7) {
    crc = kCrcTable[static_cast<std::uint8_t>(crc ^ byte)];
  }
  return crc;
}

void protect(CanFrame& frame, std::uint16_t data_id, std::uint8_t counter) noexcept {
  assert(frame.length == kProtectedLength && !frame.remote && counter <= kCounterMax);
  frame.data[1] = static_cast<std::uint8_t>((frame.data[1] & 0xF0U) | counter);
  frame.data[0] = crc_profile1(data_id, bytes_1_to_7_of(frame));
}

Checker::Checker(std::uint16_t data_id, std::uint8_t max_delta) noexcept
    : data_id_(data_id), max_delta_(max_delta) {}

void Checker::reset() noexcept { seen_ = false; }

CheckStatus Checker::check(const CanFrame& frame) noexcept {
  if (frame.length != kProtectedLength || frame.remote || frame.error ||
      crc_profile1(data_id_, bytes_1_to_7_of(frame)) != frame.data[0]) {
    return CheckStatus::kWrongCrc;
  }
  const auto counter = static_cast<std::uint8_t>(frame.data[1] & 0x0FU);
  if (counter > kCounterMax) return CheckStatus::kWrongSequence;
  const bool first = !seen_;
  const auto delta =
      static_cast<std::uint8_t>((counter + kCounterMax + 1 - last_counter_) % (kCounterMax + 1));
  // A frame out of sequence is the new reference: the receiver finds back after a longer loss.
  last_counter_ = counter;
  seen_ = true;
  if (first || delta == 1) return CheckStatus::kOk;
  if (delta == 0) return CheckStatus::kRepeated;
  return delta <= max_delta_ ? CheckStatus::kOkSomeLost : CheckStatus::kWrongSequence;
}

}  // namespace beltgrip::can::e2e
