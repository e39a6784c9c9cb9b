// One message compiled: all its signals decoded in one pass into values the caller keeps. Payload
// length and multiplexing (simple, extended, cascaded) decide which signals the frame carries. What
// is present together is decoded together, in flat steps: the signals of no selector, then for each
// selector those of the case that its value is. decode is noexcept and allocation-free;
// construction is start-up only.
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "can_dbc/dbc/model.h"
#include "can_dbc/dbc/signal_codec.h"

namespace beltgrip::can {

struct DecodedSignal {
  std::uint64_t raw = 0;  // as SignalCodec::raw() has it
  double physical = 0.0;
};

// What a frame carries of one message's signals, and which of them: those inside the payload and,
// if multiplexed, selected. The values of the others are left over from frames before.
class DecodedMessage {
 public:
  // For messages of up to so many signals.
  explicit DecodedMessage(std::size_t signals = 0)
      : signals_(signals), present_(std::max(kWordsLeast, (signals + kBits - 1) / kBits)) {}

  std::size_t size() const noexcept { return signals_.size(); }
  bool has(std::size_t signal) const noexcept {
    return (present_[signal / kBits] >> (signal % kBits) & 1U) != 0;
  }
  const DecodedSignal& operator[](std::size_t signal) const noexcept { return signals_[signal]; }
  std::size_t count() const noexcept {
    std::size_t present = 0;
    for (const std::uint64_t word : present_) {
      present += static_cast<std::size_t>(std::popcount(word));
    }
    return present;
  }
  // In the definition's order.
  template <typename Do>
  void for_each_present(Do&& take) const {
    for (std::size_t word = 0; word < present_.size(); ++word) {
      for (std::uint64_t left = present_[word]; left != 0; left &= left - 1) {
        take(word * kBits + static_cast<std::size_t>(std::countr_zero(left)));
      }
    }
  }
  void drop(std::size_t signal) noexcept { present_[signal / kBits] &= ~bit(signal); }

 private:
  friend class MessageCodec;
  static constexpr std::size_t kBits = 64;
  static constexpr std::size_t kWordsLeast = 2;  // cleared without a look at how many there are
  static std::uint64_t bit(std::size_t signal) noexcept {
    return std::uint64_t{1} << (signal % kBits);
  }

  bool has_unchecked(std::size_t signal) const noexcept {
    return (present_.data()[signal / kBits] & bit(signal)) != 0;
  }
  void clear() noexcept {
    std::uint64_t* const words = present_.data();
    words[0] = words[1] = 0;
    if (present_.size() > kWordsLeast) std::fill(words + kWordsLeast, words + present_.size(), 0U);
  }

  std::vector<DecodedSignal> signals_;
  std::vector<std::uint64_t> present_;
};

class MessageCodec {
 public:
  MessageCodec() = default;
  explicit MessageCodec(const MessageDef& definition);

  std::size_t signal_count() const noexcept { return signals_.size(); }
  const SignalCodec& signal(std::size_t index) const noexcept { return signals_[index]; }
  // What decode() will need, before it is called; and what else it leads to.
  void bring_near() const noexcept;
  void bring_signals_near() const noexcept;
  // out[i] is the i-th signal of the definition. Precondition: out.size() >= signal_count().
  void decode(std::span<const std::uint8_t> payload, DecodedMessage& out) const noexcept;

 private:
  // What SignalCodec::raw() and physical() do for an integer inside eight bytes that fits 64 bits
  // with a sign, as numbers alone: no decision is left for the frame.
  struct Step {
    std::uint64_t mask = 0;  // as many ones as the signal has bits
    std::uint64_t sign = 0;  // its top bit; 0: unsigned
    double scale = 1.0;
    double offset = 0.0;
    std::uint32_t place = 0;  // of the signal, in bytes: one addition and no shift for each
    std::uint16_t first_byte = 0;
    // To the right, of the eight bytes from byte 0 on as one number, the first of them lowest
    // (little endian) or highest (big). From a later byte on less by 8 a byte (little), or more
    // (big).
    std::int16_t shift = 0;

    std::uint32_t signal() const noexcept {
      return static_cast<std::uint32_t>(place / sizeof(DecodedSignal));
    }
    DecodedSignal& at(DecodedSignal* out) const noexcept {
      return *reinterpret_cast<DecodedSignal*>(reinterpret_cast<std::byte*>(out) + place);
    }
    DecodedSignal of(std::uint64_t word, std::int32_t right) const noexcept {
      const std::uint64_t raw = (((word >> right) & mask) ^ sign) - sign;
      const double scaled = static_cast<double>(static_cast<std::int64_t>(raw)) * scale;
      return {raw, scaled + offset};
    }
  };
  struct Presence {
    std::uint32_t word = 0;  // of 64 signals
    std::uint64_t bits = 0;
  };
  // Signals that are present together, as ranges of the vectors below.
  struct Block {
    std::uint32_t little = 0, big = 0, big_end = 0;  // in steps_
    std::uint32_t other = 0, other_end = 0;          // in others_
    std::uint32_t presence = 0, presence_end = 0;    // in presences_
    std::uint32_t bytes = 0;                         // of a payload that holds them all
  };
  // From a selector's value on, up to that of the next case.
  struct Case {
    std::uint64_t from = 0;
    std::uint32_t block = 0;
  };
  struct Range {
    std::uint64_t low = 0, high = 0;
    std::uint32_t signal = 0;
  };
  struct Selector {
    std::uint32_t signal = 0;
    std::uint32_t cases = 0, cases_end = 0;    // in cases_, by value
    std::uint32_t ranges = 0, ranges_end = 0;  // in ranges_: what would take too many cases
    std::uint64_t mask = 0;
    bool direct = false;  // a case for each value
  };
  struct Words {
    std::span<const std::uint8_t> payload;
    std::uint64_t little = 0, big = 0;  // a payload of at most eight bytes as one number
  };
  class Builder;

  void decode_any(std::span<const std::uint8_t> payload, DecodedMessage& out) const noexcept;
  void decode_eight(const Block& block, std::uint64_t little, DecodedMessage& out) const noexcept;
  void decode_flat(const Block& block, const Words& words, DecodedSignal* out) const noexcept;
  void decode_long(const Block& block, const Words& words, DecodedSignal* out) const noexcept;
  void decode_one(std::uint32_t signal, const Words& words, DecodedMessage& out) const noexcept;
  void decode_block(const Block& block, const Words& words, DecodedMessage& out) const noexcept;
  void decode_selected(const Selector& selector, const Words& words,
                       DecodedMessage& out) const noexcept;

  // First what most frames need, so that it lies together.
  Block always_;
  // Every signal has a flat form in eight bytes, and every selector a case for each value.
  bool of_eight_ = false;
  std::vector<Step> steps_;
  std::vector<SignalCodec> signals_;  // in the definition's order
  std::vector<Presence> presences_;
  std::vector<Selector> selectors_;  // every one before those that it selects
  std::vector<Block> blocks_;
  std::vector<Case> cases_;
  std::vector<Range> ranges_;
  std::vector<std::uint32_t> others_;  // signals without a flat form
};

}  // namespace beltgrip::can
