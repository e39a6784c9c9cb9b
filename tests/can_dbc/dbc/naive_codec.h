// A signal's bits picked one by one, straight from the DBC's numbering: the truth the compiled
// codec is compared with. Shares no code with it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "can_dbc/dbc/model.h"

namespace beltgrip::testing {

// Payload bit numbers (byte * 8 + bit, bit 0 least significant) from the signal's least significant
// bit on. Little endian counts up; big endian starts at the most significant bit, goes down within
// a byte and on to the top of the next.
inline std::vector<std::uint32_t> naive_bits(const can::SignalDef& signal) {
  std::vector<std::uint32_t> bits(signal.length);
  std::uint32_t bit = signal.start_bit;
  for (std::uint32_t i = 0; i < signal.length; ++i) {
    if (signal.byte_order == can::ByteOrder::kLittle) {
      bits[i] = bit++;
    } else {
      bits[signal.length - 1 - i] = bit;
      bit = bit % 8 == 0 ? bit + 15 : bit - 1;
    }
  }
  return bits;
}

inline bool naive_fits(const can::SignalDef& signal, std::size_t payload_bytes) {
  if (signal.length == 0 || signal.length > 64) return false;
  for (const std::uint32_t bit : naive_bits(signal)) {
    if (bit / 8 >= payload_bytes) return false;
  }
  return true;
}

inline std::uint64_t naive_raw(const can::SignalDef& signal,
                               std::span<const std::uint8_t> payload) {
  const std::vector<std::uint32_t> bits = naive_bits(signal);
  std::uint64_t raw = 0;
  for (std::size_t i = 0; i < bits.size(); ++i) {
    const bool one = ((payload[bits[i] / 8] >> (bits[i] % 8)) & 1) != 0;
    if (one) raw |= std::uint64_t{1} << i;
  }
  if (signal.type == can::ValueType::kSigned && ((raw >> (bits.size() - 1)) & 1) != 0) {
    for (std::size_t i = bits.size(); i < 64; ++i) raw |= std::uint64_t{1} << i;
  }
  return raw;
}

}  // namespace beltgrip::testing
