#include "can_dbc/dbc/message_codec.h"

#include <algorithm>
#include <cassert>
#include <string_view>
#include <unordered_map>

namespace beltgrip::can {

MessageCodec::MessageCodec(const MessageDef& definition) {
  const auto count = static_cast<std::uint32_t>(definition.signals.size());
  std::unordered_map<std::string_view, std::uint32_t> index_of;
  for (std::uint32_t i = 0; i < count; ++i) index_of.emplace(definition.signals[i].name, i);

  signals_.reserve(count);
  for (const SignalDef& signal : definition.signals) {
    Entry entry{.codec = SignalCodec(signal)};
    if (signal.multiplexed_by) {
      const auto found = index_of.find(signal.multiplexed_by->selector);
      entry.selector = found == index_of.end() ? kNever : found->second;
      entry.range_begin = static_cast<std::uint32_t>(ranges_.size());
      for (const auto& [low, high] : signal.multiplexed_by->ranges) ranges_.push_back({low, high});
      entry.range_end = static_cast<std::uint32_t>(ranges_.size());
    }
    signals_.push_back(entry);
  }

  // Each signal follows its chain of selectors up to the first that is settled; a chain that comes
  // back to itself is a circle, and none of its signals can ever be selected.
  enum class Mark : std::uint8_t { kNew, kOnChain, kSettled };
  std::vector<Mark> marks(count, Mark::kNew);
  std::vector<std::uint32_t> chain;
  order_.reserve(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    std::uint32_t at = i;
    while (at < count && marks[at] == Mark::kNew) {
      marks[at] = Mark::kOnChain;
      chain.push_back(at);
      at = signals_[at].selector;
    }
    const bool circle = at < count && marks[at] == Mark::kOnChain;
    for (; !chain.empty(); chain.pop_back()) {
      const std::uint32_t top = chain.back();
      if (circle) signals_[top].selector = kNever;
      marks[top] = Mark::kSettled;
      order_.push_back(top);
    }
  }
}

std::size_t MessageCodec::decode(std::span<const std::uint8_t> payload,
                                 std::span<DecodedSignal> out) const noexcept {
  assert(out.size() >= signals_.size());
  std::size_t present = 0;
  for (const std::uint32_t index : order_) {
    const Entry& entry = signals_[index];
    DecodedSignal& value = out[index];
    value = {};
    if (!entry.codec.fits(payload.size()) || entry.selector == kNever) continue;
    if (entry.selector != kAlways) {
      const DecodedSignal& selector = out[entry.selector];
      // The file's numbers are those of the bits: 255 selects in an 8-bit signal, signed or not.
      const std::uint64_t bits = selector.raw & signals_[entry.selector].codec.mask();
      const auto selected = [&](const Range& range) {
        return bits >= range.low && bits <= range.high;
      };
      if (!selector.present || !std::any_of(ranges_.begin() + entry.range_begin,
                                            ranges_.begin() + entry.range_end, selected)) {
        continue;
      }
    }
    value.raw = entry.codec.raw(payload);
    value.physical = entry.codec.physical(value.raw);
    value.present = true;
    ++present;
  }
  return present;
}

}  // namespace beltgrip::can
