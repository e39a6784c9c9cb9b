// A signal's bits picked one by one, straight from the DBC's numbering, and whether a payload has
// it by following its selectors: the truth the compiled codec is compared with. Shares no code with
// it.
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

// Whether a payload has the signal: inside it and, if multiplexed, selected by a signal that it
// has.
inline bool naive_present(const can::MessageDef& message, const can::SignalDef& signal,
                          std::span<const std::uint8_t> payload) {
  const can::SignalDef* at = &signal;
  // A chain of selectors longer than there are signals comes back to itself.
  for (std::size_t steps = 0; steps <= message.signals.size(); ++steps) {
    if (!naive_fits(*at, payload.size())) return false;
    if (!at->multiplexed_by) return true;
    const can::SignalDef* selector = nullptr;
    for (const can::SignalDef& each : message.signals) {
      if (selector == nullptr && each.name == at->multiplexed_by->selector) selector = &each;
    }
    if (selector == nullptr || !naive_fits(*selector, payload.size())) return false;
    can::SignalDef bits = *selector;
    bits.type = can::ValueType::kUnsigned;
    const std::uint64_t value = naive_raw(bits, payload);
    bool selected = false;
    for (const auto& [low, high] : at->multiplexed_by->ranges) {
      selected = selected || (value >= low && value <= high);
    }
    if (!selected) return false;
    at = selector;
  }
  return false;
}

}  // namespace beltgrip::testing
