#include "can_dbc/dbc/message_codec.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cstring>
#include <optional>
#include <string_view>
#include <unordered_map>

#include "can_dbc/dbc/bring_near.h"

namespace beltgrip::can {

namespace {

constexpr std::size_t kWord = sizeof(std::uint64_t);
constexpr std::uint32_t kFirstByteMost = 4000;        // of a flat step: its bits are counted in 16
constexpr std::uint32_t kAlways = ~std::uint32_t{0};  // not multiplexed
constexpr std::uint32_t kNever = kAlways - 1;         // selector unknown or in a circle

// Chosen so that the tables of a message stay in proportion to what the file says of it: signals in
// all cases together, and entries of a table that has one for each value of a selector.
constexpr std::size_t kStepsPerSignal = 16, kStepsAtLeast = 1024;
constexpr std::uint64_t kValuesPerCase = 16, kValuesMost = 256;

// At most eight bytes as one number, the first byte lowest.
std::uint64_t word_of(std::span<const std::uint8_t> payload) noexcept {
  std::uint64_t word = 0;
  if (payload.size() == kWord) {
    std::memcpy(&word, payload.data(), kWord);
  } else {
    for (std::size_t i = 0; i < payload.size(); ++i) word |= std::uint64_t{payload[i]} << (8 * i);
  }
  return word;
}

// Where a signal lies.
struct BitLayout {
  explicit BitLayout(const SignalDef& signal)
      : little(signal.byte_order == ByteOrder::kLittle),
        first_byte(signal.start_bit / 8),
        // Of the payload's bits, counted from the start of its first byte.
        first_bit(little ? signal.start_bit : 8 * first_byte + 7 - signal.start_bit % 8),
        end_byte((first_bit + signal.length + 7) / 8),
        shift(little ? static_cast<std::int32_t>(first_bit)
                     : 64 - static_cast<std::int32_t>(first_bit + signal.length)) {}
  bool little;
  std::uint32_t first_byte;
  std::uint32_t first_bit;
  std::uint32_t end_byte;
  std::int32_t shift;  // MessageCodec::Step
};

// The selector of each signal, or kAlways, kNever; and an order with every selector before what it
// selects.
struct Selection {
  explicit Selection(const MessageDef& definition);
  std::vector<std::uint32_t> selector_of;
  std::vector<std::uint32_t> order;
};

Selection::Selection(const MessageDef& definition) {
  const auto count = static_cast<std::uint32_t>(definition.signals.size());
  std::unordered_map<std::string_view, std::uint32_t> index_of;
  for (std::uint32_t i = 0; i < count; ++i) index_of.emplace(definition.signals[i].name, i);
  for (const SignalDef& signal : definition.signals) {
    selector_of.push_back(kAlways);
    if (!signal.multiplexed_by) continue;
    const auto found = index_of.find(signal.multiplexed_by->selector);
    selector_of.back() = found == index_of.end() ? kNever : found->second;
  }
  // Each signal follows its chain of selectors up to the first that is settled; a chain that comes
  // back to itself is a circle, and none of its signals can ever be selected.
  enum class Mark : std::uint8_t { kNew, kOnChain, kSettled };
  std::vector<Mark> marks(count, Mark::kNew);
  std::vector<std::uint32_t> chain;
  for (std::uint32_t i = 0; i < count; ++i) {
    std::uint32_t at = i;
    while (at < count && marks[at] == Mark::kNew) {
      marks[at] = Mark::kOnChain;
      chain.push_back(at);
      at = selector_of[at];
    }
    const bool circle = at < count && marks[at] == Mark::kOnChain;
    for (; !chain.empty(); chain.pop_back()) {
      const std::uint32_t top = chain.back();
      if (circle) selector_of[top] = kNever;
      marks[top] = Mark::kSettled;
      order.push_back(top);
    }
  }
}

}  // namespace

class MessageCodec::Builder {
 public:
  Builder(MessageCodec& codec, const MessageDef& definition)
      : codec_(codec),
        definition_(definition),
        steps_left_(kStepsPerSignal * definition.signals.size() + kStepsAtLeast) {}

  void build() {
    for (const SignalDef& signal : definition_.signals) codec_.signals_.emplace_back(signal);
    const Selection selection(definition_);
    std::vector<std::uint32_t> always;
    std::vector<std::vector<std::uint32_t>> selected_by(definition_.signals.size());
    for (std::uint32_t i = 0; i < selection.selector_of.size(); ++i) {
      // What lies in no payload is never there.
      if (!codec_.signals_[i].fits(SIZE_MAX)) continue;
      const std::uint32_t selector = selection.selector_of[i];
      if (selector == kAlways) always.push_back(i);
      if (selector < kNever) selected_by[selector].push_back(i);
    }
    codec_.always_ = block_of(always);
    codec_.blocks_.emplace_back();  // of values that select nothing
    for (const std::uint32_t signal : selection.order) {
      if (!selected_by[signal].empty()) add_selector(signal, selected_by[signal]);
    }
    codec_.of_eight_ = codec_.others_.empty() && codec_.always_.bytes <= kWord &&
                       std::all_of(codec_.blocks_.begin(), codec_.blocks_.end(),
                                   [](const Block& block) { return block.bytes <= kWord; }) &&
                       std::all_of(codec_.selectors_.begin(), codec_.selectors_.end(),
                                   [](const Selector& selector) { return selector.direct; });
  }

 private:
  void add_selector(std::uint32_t signal, const std::vector<std::uint32_t>& selected) {
    Selector selector{.signal = signal, .mask = codec_.signals_[signal].mask()};
    std::vector<Range> ranges;
    std::vector<std::uint64_t> begins{0};
    for (const std::uint32_t each : selected) {
      const MuxRule* const rule = definition_.signals[each].multiplexed_by;
      if (!rule) continue;
      for (const auto& [low, high] : rule->ranges) {
        if (low > high || low > selector.mask) continue;
        ranges.push_back({low, high, each});
        begins.push_back(low);
        if (high < selector.mask) begins.push_back(high + 1);
      }
    }
    std::sort(begins.begin(), begins.end());
    begins.erase(std::unique(begins.begin(), begins.end()), begins.end());
    // Which cases a range covers.
    const auto case_at = [&](std::uint64_t value) {
      return static_cast<std::size_t>(std::upper_bound(begins.begin(), begins.end(), value) -
                                      begins.begin()) -
             1;
    };
    std::size_t steps = 0;
    for (const Range& range : ranges) steps += case_at(range.high) - case_at(range.low) + 1;
    if (steps > steps_left_) {
      selector.ranges = size_of(codec_.ranges_);
      codec_.ranges_.insert(codec_.ranges_.end(), ranges.begin(), ranges.end());
      selector.ranges_end = size_of(codec_.ranges_);
    } else {
      steps_left_ -= steps;
      std::vector<std::vector<std::uint32_t>> cases(begins.size());
      for (const Range& range : ranges) {
        for (std::size_t i = case_at(range.low); i <= case_at(range.high); ++i) {
          // Ranges of one signal may overlap.
          if (cases[i].empty() || cases[i].back() != range.signal) cases[i].push_back(range.signal);
        }
      }
      add_cases(selector, begins, cases);
    }
    codec_.selectors_.push_back(selector);
  }

  void add_cases(Selector& selector, const std::vector<std::uint64_t>& begins,
                 const std::vector<std::vector<std::uint32_t>>& cases) {
    selector.direct =
        selector.mask < std::min<std::uint64_t>(kValuesMost, kValuesPerCase * begins.size());
    selector.cases = size_of(codec_.cases_);
    for (std::size_t i = 0; i < cases.size(); ++i) {
      std::uint32_t block = 0;
      if (!cases[i].empty()) {
        block = size_of(codec_.blocks_);
        codec_.blocks_.push_back(block_of(cases[i]));
      }
      const std::uint64_t end = i + 1 < begins.size() ? begins[i + 1] : selector.mask + 1;
      const std::uint64_t entries = selector.direct ? end - begins[i] : 1;
      for (std::uint64_t k = 0; k < entries; ++k) codec_.cases_.push_back({begins[i] + k, block});
    }
    selector.cases_end = size_of(codec_.cases_);
  }

  // signals: in the definition's order.
  Block block_of(const std::vector<std::uint32_t>& signals) {
    Block block;
    const auto add_steps = [&](bool little) {
      for (const std::uint32_t signal : signals) {
        if (is_flat(signal) && BitLayout(definition_.signals[signal]).little == little) {
          codec_.steps_.push_back(step_of(signal));
        }
      }
      return size_of(codec_.steps_);
    };
    block.little = size_of(codec_.steps_);
    block.big = add_steps(true);
    block.big_end = add_steps(false);
    block.other = size_of(codec_.others_);
    block.presence = size_of(codec_.presences_);
    for (const std::uint32_t signal : signals) {
      block.bytes = std::max(block.bytes, BitLayout(definition_.signals[signal]).end_byte);
      if (!is_flat(signal)) codec_.others_.push_back(signal);
      const auto word = static_cast<std::uint32_t>(signal / DecodedMessage::kBits);
      const bool is_new =
          size_of(codec_.presences_) == block.presence || codec_.presences_.back().word != word;
      if (is_new) codec_.presences_.push_back({word, 0});
      codec_.presences_.back().bits |= DecodedMessage::bit(signal);
    }
    block.other_end = size_of(codec_.others_);
    block.presence_end = size_of(codec_.presences_);
    return block;
  }

  // Not so: floats, 64 bits without a sign, nine bytes, and what no frame is long enough for.
  bool is_flat(std::uint32_t signal) const {
    const SignalDef& definition = definition_.signals[signal];
    const BitLayout layout(definition);
    const bool too_large = definition.type != ValueType::kSigned && definition.length == 64;
    if (layout.first_byte > kFirstByteMost) return false;
    return !codec_.signals_[signal].is_float() && !too_large &&
           layout.end_byte - layout.first_byte <= kWord;
  }

  Step step_of(std::uint32_t signal) const {
    const SignalDef& definition = definition_.signals[signal];
    const BitLayout layout(definition);
    const bool is_signed = definition.type == ValueType::kSigned;
    return {.mask = codec_.signals_[signal].mask(),
            .sign = is_signed ? std::uint64_t{1} << (definition.length - 1) : 0,
            .scale = definition.scale,
            .offset = definition.offset,
            .place = static_cast<std::uint32_t>(signal * sizeof(DecodedSignal)),
            .first_byte = static_cast<std::uint16_t>(layout.first_byte),
            .shift = static_cast<std::int16_t>(layout.shift)};
  }

  static std::uint32_t size_of(const auto& list) { return static_cast<std::uint32_t>(list.size()); }

  MessageCodec& codec_;
  const MessageDef& definition_;
  std::size_t steps_left_;
};

MessageCodec::MessageCodec(const MessageDef& definition) { Builder(*this, definition).build(); }

// What follows is inline, and without the library's assertions on an index where it is the
// Builder's own: they took as long as the signals of a frame.

// A payload of eight bytes, of a message that needs nothing else: no question is left.
[[gnu::always_inline]] inline void MessageCodec::decode_eight(const Block& block,
                                                              std::uint64_t little,
                                                              DecodedMessage& out) const noexcept {
  decode_flat(block, {{}, little, __builtin_bswap64(little)}, out.signals_.data());
  const Presence* const last = presences_.data() + block.presence_end;
  for (const Presence* each = presences_.data() + block.presence; each != last; ++each) {
    out.present_.data()[each->word] |= each->bits;
  }
}

// All signals of the block lie in the payload, which has at most eight bytes.
[[gnu::always_inline]] inline void MessageCodec::decode_flat(const Block& block, const Words& words,
                                                             DecodedSignal* out) const noexcept {
  const auto decode_all = [&](std::uint32_t begin, std::uint32_t end, std::uint64_t word) {
    const Step* const last = steps_.data() + end;
    for (const Step* step = steps_.data() + begin; step != last; ++step) {
      step->at(out) = step->of(word, step->shift);
    }
  };
  decode_all(block.little, block.big, words.little);
  decode_all(block.big, block.big_end, words.big);
}

// The same in a longer payload: each signal's word begins where the signal does, or as near to it
// as the payload's end leaves eight bytes.
[[gnu::noinline]] void MessageCodec::decode_long(const Block& block, const Words& words,
                                                 DecodedSignal* out) const noexcept {
  const auto last = static_cast<std::uint32_t>(words.payload.size() - kWord);
  for (std::uint32_t i = block.little; i != block.big_end; ++i) {
    const Step& step = steps_[i];
    const std::uint32_t base = std::min<std::uint32_t>(step.first_byte, last);
    const auto bits_before = static_cast<std::int32_t>(8 * base);
    std::uint64_t word = 0;
    std::memcpy(&word, words.payload.data() + base, kWord);
    step.at(out) = i < block.big ? step.of(word, step.shift - bits_before)
                                 : step.of(__builtin_bswap64(word), step.shift + bits_before);
  }
}

[[gnu::noinline]] void MessageCodec::decode_one(std::uint32_t signal, const Words& words,
                                                DecodedMessage& out) const noexcept {
  const SignalCodec& codec = signals_[signal];
  if (!codec.fits(words.payload.size())) return;
  const std::uint64_t raw = codec.raw(words.payload);
  out.signals_[signal] = {raw, codec.physical(raw)};
  out.present_[signal / DecodedMessage::kBits] |= DecodedMessage::bit(signal);
}

[[gnu::always_inline]] inline void MessageCodec::decode_block(const Block& block,
                                                              const Words& words,
                                                              DecodedMessage& out) const noexcept {
  if (block.bytes > words.payload.size()) {
    for (std::uint32_t i = block.little; i != block.big_end; ++i) {
      decode_one(steps_[i].signal(), words, out);
    }
  } else {
    if (words.payload.size() <= kWord) {
      decode_flat(block, words, out.signals_.data());
    } else {
      decode_long(block, words, out.signals_.data());
    }
    const Presence* const last = presences_.data() + block.presence_end;
    for (const Presence* each = presences_.data() + block.presence; each != last; ++each) {
      out.present_.data()[each->word] |= each->bits;
    }
  }
  for (std::uint32_t i = block.other; i != block.other_end; ++i) {
    decode_one(others_[i], words, out);
  }
}

[[gnu::always_inline]] inline void MessageCodec::decode_selected(
    const Selector& selector, const Words& words, DecodedMessage& out) const noexcept {
  // The file's numbers are those of the bits: 255 selects in an 8-bit signal, signed or not.
  const std::uint64_t value = out.signals_.data()[selector.signal].raw & selector.mask;
  for (std::uint32_t i = selector.ranges; i != selector.ranges_end; ++i) {
    const Range& range = ranges_[i];
    if (value >= range.low && value <= range.high) decode_one(range.signal, words, out);
  }
  if (selector.cases == selector.cases_end) return;
  const Case* const begin = cases_.data() + selector.cases;
  const Case* found = begin + (selector.direct ? value : 0);
  if (!selector.direct) {
    const auto is_before = [](std::uint64_t wanted, const Case& each) {
      return wanted < each.from;
    };
    found = std::upper_bound(begin, cases_.data() + selector.cases_end, value, is_before) - 1;
  }
  decode_block(blocks_.data()[found->block], words, out);
}

void MessageCodec::bring_near() const noexcept {
  can::bring_near(steps_);
  can::bring_near(presences_);
  if (of_eight_) return;
  bring_signals_near();
  can::bring_near(others_);
}

void MessageCodec::bring_signals_near() const noexcept { can::bring_near(signals_); }

[[gnu::noinline]] void MessageCodec::decode_any(std::span<const std::uint8_t> payload,
                                                DecodedMessage& out) const noexcept {
  Words words{.payload = payload};
  if (payload.size() <= kWord) {
    words.little = word_of(payload);
    words.big = __builtin_bswap64(words.little);
  }
  decode_block(always_, words, out);
  for (const Selector& selector : selectors_) {
    if (out.has_unchecked(selector.signal)) decode_selected(selector, words, out);
  }
}

void MessageCodec::decode(std::span<const std::uint8_t> payload,
                          DecodedMessage& out) const noexcept {
  assert(out.size() >= signals_.size());
  out.clear();
  if (payload.size() != kWord || !of_eight_) return decode_any(payload, out);
  std::uint64_t little = 0;
  std::memcpy(&little, payload.data(), kWord);
  decode_eight(always_, little, out);
  for (const Selector& selector : selectors_) {
    if (!out.has_unchecked(selector.signal)) continue;
    const std::uint64_t value = out.signals_.data()[selector.signal].raw & selector.mask;
    decode_eight(blocks_.data()[cases_.data()[selector.cases + value].block], little, out);
  }
}

}  // namespace beltgrip::can
