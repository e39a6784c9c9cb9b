#include "tests/pairs/signal_by_signal.h"

#include <cstring>

namespace beltgrip::test {

std::uint64_t SignalBySignal::little(const Signal& signal, const Payload& payload) {
  std::uint64_t word = 0;
  std::memcpy(&word, payload.data(), sizeof word);
  return word >> signal.shift & signal.mask;
}

std::uint64_t SignalBySignal::big(const Signal& signal, const Payload& payload) {
  std::uint64_t word = 0;
  std::memcpy(&word, payload.data(), sizeof word);
  return __builtin_bswap64(word) >> signal.shift & signal.mask;
}

std::uint64_t SignalBySignal::little_signed(const Signal& signal, const Payload& payload) {
  return (little(signal, payload) ^ signal.sign) - signal.sign;
}

std::uint64_t SignalBySignal::big_signed(const Signal& signal, const Payload& payload) {
  return (big(signal, payload) ^ signal.sign) - signal.sign;
}

SignalBySignal::SignalBySignal(const can::MessageDef& definition) {
  for (const can::SignalDef& signal : definition.signals) {
    const bool is_little = signal.byte_order == can::ByteOrder::kLittle;
    const bool is_signed = signal.type == can::ValueType::kSigned;
    // Of a big-endian signal the start is its top bit.
    const unsigned top = 8 * (signal.start_bit / 8) + 7 - signal.start_bit % 8;
    const can::MuxRule* const rule = signal.multiplexed_by;
    const std::uint64_t sign = std::uint64_t{1} << (signal.length - 1);
    signals_.push_back(
        {is_little ? (is_signed ? little_signed : little) : (is_signed ? big_signed : big),
         2 * sign - 1, sign, is_little ? signal.start_bit : 64 - top - signal.length, signal.scale,
         signal.offset, rule != nullptr, rule != nullptr ? rule->ranges.begin()->first : 0});
    if (signal.is_multiplexer) multiplexer_ = signals_.size() - 1;
  }
}

void SignalBySignal::decode(const Payload& payload, std::vector<double>& values) const {
  const Signal& multiplexer = signals_[multiplexer_];
  for (std::size_t i = 0; i < signals_.size(); ++i) {
    const Signal& signal = signals_[i];
    if (signal.is_selected && multiplexer.raw(multiplexer, payload) != signal.value) continue;
    const auto raw = static_cast<std::int64_t>(signal.raw(signal, payload));
    values[i] = static_cast<double>(raw) * signal.scale + signal.offset;
  }
}

}  // namespace beltgrip::test
