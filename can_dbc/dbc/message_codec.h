// One message compiled: all its signals decoded in one pass into an array the caller provides.
// Presence first: payload length and multiplexing (simple, extended, cascaded) decide which signals
// the frame carries. decode is noexcept and allocation-free; construction is start-up only.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "can_dbc/dbc/model.h"
#include "can_dbc/dbc/signal_codec.h"

namespace beltgrip::can {

struct DecodedSignal {
  bool present = false;  // inside the payload and, if multiplexed, selected; else the rest is zero
  std::uint64_t raw = 0;
  double physical = 0.0;
};

class MessageCodec {
 public:
  MessageCodec() = default;
  explicit MessageCodec(const MessageDef& definition);

  std::size_t signal_count() const noexcept { return signals_.size(); }
  const SignalCodec& signal(std::size_t index) const noexcept { return signals_[index].codec; }
  // out[i] is the i-th signal of the definition. Precondition: out.size() >= signal_count().
  // Returns how many are present.
  std::size_t decode(std::span<const std::uint8_t> payload,
                     std::span<DecodedSignal> out) const noexcept;

 private:
  static constexpr std::uint32_t kAlways = ~std::uint32_t{0};  // not multiplexed
  static constexpr std::uint32_t kNever = kAlways - 1;         // selector unknown or in a circle
  struct Range {
    std::uint64_t low, high;
  };
  struct Entry {
    SignalCodec codec;
    std::uint32_t selector = kAlways;  // index of the multiplexer signal
    std::uint32_t range_begin = 0;     // in ranges_
    std::uint32_t range_end = 0;
  };

  std::vector<Entry> signals_;        // in the definition's order
  std::vector<std::uint32_t> order_;  // every selector before what it selects
  std::vector<Range> ranges_;
};

}  // namespace beltgrip::can
