#include "can_dbc/dbc/message_codec.h"

#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <random>

#include "tests/can_dbc/dbc/naive_codec.h"
#include "tests/support/guarded_bytes.h"

namespace beltgrip::can {
namespace {

SignalDef byte_signal(const char* name, std::uint32_t byte) {
  SignalDef signal;
  signal.name = name;
  signal.start_bit = byte * 8;
  signal.length = 8;
  return signal;
}

SignalDef selected(const char* name, std::uint32_t byte, const char* selector,
                   const std::vector<ValueRange>& ranges) {
  static Arena arena;
  SignalDef signal = byte_signal(name, byte);
  signal.multiplexed_by = arena.one(MuxRule{selector, arena.list(ranges)});
  return signal;
}

TEST(MessageCodec, LeavesOutWhatLiesOutsideThePayload) {
  MessageDef message;
  message.signals = {byte_signal("a", 0), byte_signal("b", 1), byte_signal("c", 7)};
  const MessageCodec codec(message);
  DecodedMessage values(8);
  codec.decode(std::array<std::uint8_t, 2>{5, 6}, values);
  EXPECT_EQ(values.count(), 2U);
  EXPECT_TRUE(values.has(0));
  EXPECT_EQ(values[1].raw, 6U);
  EXPECT_FALSE(values.has(2));
  codec.decode({}, values);
  EXPECT_EQ(values.count(), 0U);
}

// Whichever word of the mask a signal has its bit in.
TEST(MessageCodec, ForgetsTheFrameBefore) {
  MessageDef message;
  for (std::uint32_t i = 0; i < 150; ++i) message.signals.push_back(byte_signal("s", i % 8));
  const MessageCodec codec(message);
  DecodedMessage values(150);
  codec.decode(std::array<std::uint8_t, 8>{}, values);
  EXPECT_EQ(values.count(), 150U);
  codec.decode({}, values);
  EXPECT_EQ(values.count(), 0U);
}

TEST(MessageCodec, SelectsByRangesAlsoWhenTheSelectorComesLater) {
  MessageDef message;
  message.signals = {selected("low", 1, "mux", {{0, 3}, {7, 7}}),
                     selected("high", 1, "mux", {{4, 6}}), byte_signal("mux", 0)};
  const MessageCodec codec(message);
  DecodedMessage values(8);
  for (std::uint8_t mux = 0; mux < 9; ++mux) {
    codec.decode(std::array<std::uint8_t, 2>{mux, 9}, values);
    EXPECT_EQ(values.has(0), mux <= 3 || mux == 7) << int{mux};
    EXPECT_EQ(values.has(1), mux >= 4 && mux <= 6) << int{mux};
    EXPECT_TRUE(values.has(2));
  }
}

TEST(MessageCodec, CascadesThroughSelectorsThatAreThemselvesSelected) {
  MessageDef message;
  message.signals = {selected("leaf", 2, "inner", {{1, 1}}),
                     selected("inner", 1, "outer", {{5, 5}}), byte_signal("outer", 0)};
  const MessageCodec codec(message);
  DecodedMessage values(8);
  codec.decode(std::array<std::uint8_t, 3>{5, 1, 42}, values);
  EXPECT_TRUE(values.has(0));
  EXPECT_EQ(values[0].physical, 42.0);
  codec.decode(std::array<std::uint8_t, 3>{4, 1, 42}, values);
  EXPECT_FALSE(values.has(0));
  EXPECT_FALSE(values.has(1));
}

TEST(MessageCodec, NeverSelectsThroughACircleOrAnUnknownSelector) {
  MessageDef message;
  message.signals = {
      selected("a", 0, "b", {{0, 255}}),         selected("b", 1, "a", {{0, 255}}),
      selected("below", 2, "a", {{0, 255}}),     selected("self", 3, "self", {{0, 255}}),
      selected("lost", 4, "nobody", {{0, 255}}), byte_signal("plain", 5)};
  const MessageCodec codec(message);
  DecodedMessage values(8);
  codec.decode(std::array<std::uint8_t, 8>{}, values);
  EXPECT_EQ(values.count(), 1U);
  EXPECT_TRUE(values.has(5));
}

TEST(MessageCodec, SelectsByTheBitsOfASignedSelector) {
  MessageDef message;
  SignalDef mux = byte_signal("mux", 0);
  mux.type = ValueType::kSigned;
  message.signals = {mux, selected("a", 1, "mux", {{128, 255}})};
  const MessageCodec codec(message);
  DecodedMessage values(8);
  codec.decode(std::array<std::uint8_t, 2>{0x7F, 0}, values);
  EXPECT_FALSE(values.has(1));
  codec.decode(std::array<std::uint8_t, 2>{0x80, 0}, values);
  EXPECT_TRUE(values.has(1));
}

// --- against the naive codec ------------------------------------------------------------------

class Drawn {
 public:
  explicit Drawn(unsigned seed) : random_(seed) {}

  std::uint64_t below(std::uint64_t end) { return random_() % end; }

  SignalDef signal(std::size_t number, std::uint32_t bytes) {
    SignalDef signal;
    signal.name = arena_.keep("s" + std::to_string(number));
    signal.start_bit = static_cast<std::uint32_t>(below(bytes * 8));
    const std::uint64_t lengths[] = {1, 8, 16, 32, 64, below(12), below(20), below(67)};
    signal.length = static_cast<std::uint32_t>(lengths[below(8)]);
    signal.byte_order = below(2) == 0 ? ByteOrder::kLittle : ByteOrder::kBig;
    signal.type = below(3) == 0   ? ValueType::kSigned
                  : below(8) == 0 ? ValueType::kFloat32
                                  : ValueType::kUnsigned;
    const double scales[] = {1.0, 0.1, 0.25, -3.0, 1e-9};
    signal.scale = scales[below(5)];
    signal.offset = below(2) == 0 ? 0.0 : -40.0;
    return signal;
  }

  // Multiplexed by any other signal, by itself, or by none that there is.
  void select(MessageDef& message, std::uint64_t range_most) {
    for (SignalDef& signal : message.signals) {
      if (below(3) == 0) continue;
      const std::string selector = "s" + std::to_string(below(message.signals.size() + below(2)));
      std::vector<ValueRange> ranges;
      for (std::uint64_t k = below(4); k > 0; --k) {
        const std::uint64_t low = below(range_most);
        ranges.emplace_back(low, low + below(range_most));
      }
      if (below(20) == 0) ranges.emplace_back(7, 3);
      signal.multiplexed_by = arena_.one(MuxRule{arena_.keep(selector), arena_.list(ranges)});
    }
  }

  std::vector<std::uint8_t> payload(std::size_t bytes, bool small) {
    std::vector<std::uint8_t> made(bytes);
    for (std::uint8_t& byte : made) byte = static_cast<std::uint8_t>(below(small ? 4 : 256));
    return made;
  }

 private:
  std::mt19937_64 random_;
  Arena arena_;
};

void expect_as_naive(const MessageDef& message, const MessageCodec& codec,
                     const std::vector<std::uint8_t>& payload, DecodedMessage& values) {
  static const beltgrip::testing::GuardedBytes guarded;
  codec.decode(guarded.copy(payload), values);
  std::size_t present = 0;
  for (std::size_t i = 0; i < message.signals.size(); ++i) {
    const SignalDef& signal = message.signals[i];
    const bool expected = testing::naive_present(message, signal, payload);
    ASSERT_EQ(values.has(i), expected) << signal.name;
    if (!expected) continue;
    ++present;
    // A float of this width has its bits as its raw value, sign and all.
    SignalDef bits = signal;
    if (codec.signal(i).is_float()) bits.type = ValueType::kUnsigned;
    ASSERT_EQ(values[i].raw, testing::naive_raw(bits, payload)) << signal.name;
    const double physical = codec.signal(i).physical(values[i].raw);
    ASSERT_EQ(std::bit_cast<std::uint64_t>(values[i].physical),
              std::bit_cast<std::uint64_t>(physical))
        << signal.name;
  }
  EXPECT_EQ(values.count(), present);
  std::vector<std::size_t> visited;
  values.for_each_present([&](std::size_t i) { visited.push_back(i); });
  EXPECT_EQ(visited.size(), present);
  EXPECT_TRUE(std::is_sorted(visited.begin(), visited.end()));
}

TEST(MessageCodec, DecodesAnyMessageAsBitsPickedOneByOne) {
  for (unsigned seed = 0; seed < 600; ++seed) {
    SCOPED_TRACE(seed);
    Drawn drawn(seed);
    MessageDef message;
    const std::uint32_t bytes = seed % 3 == 0 ? 64 : 8;
    const std::size_t count = 1 + drawn.below(seed % 10 == 0 ? 150 : 20);
    for (std::size_t i = 0; i < count; ++i) message.signals.push_back(drawn.signal(i, bytes));
    // Selectors of a few bits, of a byte, and of any width with values far apart.
    if (seed % 4 != 0) drawn.select(message, seed % 4 == 1 ? 6 : seed % 4 == 2 ? 200 : 1ULL << 40);
    const MessageCodec codec(message);
    codec.bring_near();  // changes nothing
    DecodedMessage values(count);
    for (std::size_t length = 0; length <= bytes; length += length < 9 ? 1 : 11) {
      expect_as_naive(message, codec, drawn.payload(length, seed % 2 == 0), values);
      if (HasFatalFailure()) return;
    }
  }
}

// Nothing but whole numbers inside eight bytes, and selectors of a few bits: a way of its own.
TEST(MessageCodec, DecodesEightBytesAsBitsPickedOneByOne) {
  for (unsigned seed = 0; seed < 600; ++seed) {
    SCOPED_TRACE(seed);
    Drawn drawn(seed);
    MessageDef message;
    const std::size_t count = 1 + drawn.below(seed % 10 == 0 ? 150 : 20);
    for (std::size_t i = 0; i < count; ++i) {
      SignalDef signal = drawn.signal(i, 8);
      const bool is_little = signal.byte_order == ByteOrder::kLittle;
      const std::uint32_t before =
          is_little ? signal.start_bit : signal.start_bit / 8 * 8 + 7 - signal.start_bit % 8;
      const std::uint64_t most = seed % 3 == 0 ? 4 : drawn.below(4) == 0 ? 63 : 6;
      signal.length =
          static_cast<std::uint32_t>(1 + drawn.below(std::min<std::uint64_t>(most, 64 - before)));
      if (signal.type == ValueType::kFloat32) signal.type = ValueType::kUnsigned;
      message.signals.push_back(signal);
    }
    if (seed % 4 != 0) drawn.select(message, seed % 4 == 1 ? 3 : 12);
    const MessageCodec codec(message);
    DecodedMessage values(count);
    for (const std::size_t length : {8U, 8U, 7U, 8U, 12U, 8U}) {
      expect_as_naive(message, codec, drawn.payload(length, seed % 2 == 0), values);
      if (HasFatalFailure()) return;
    }
  }
}

// Behind every payload there is, and behind what the bits of a step are counted in.
TEST(MessageCodec, NeverFindsWhatBeginsBehindAnyPayload) {
  MessageDef message;
  message.signals = {byte_signal("near", 0), byte_signal("far", 5'000),
                     byte_signal("farther", 70'000)};
  const MessageCodec codec(message);
  DecodedMessage values(message.signals.size());
  std::vector<std::uint8_t> payload(5'001, 7);
  codec.decode(payload, values);
  EXPECT_TRUE(values.has(0) && values.has(1));
  EXPECT_EQ(values[1].raw, 7U);
  payload.resize(70'001, 9);
  codec.decode(payload, values);
  EXPECT_TRUE(values.has(0) && values.has(1) && values.has(2));
  EXPECT_EQ(values[0].raw + values[1].raw + values[2].raw, 7U + 7U + 9U);
}

// Tables of all cases would be as long as the squares of what two selectors choose: gigabytes.
TEST(MessageCodec, DecodesManyOverlappingRangesWithoutATableOfThemAll) {
  Drawn drawn(1);
  MessageDef message;
  constexpr std::array kSelectors{"first", "second"};
  for (std::uint32_t each = 0; each < kSelectors.size(); ++each) {
    message.signals.push_back(byte_signal(kSelectors[each], 2 * each));
    message.signals.back().length = 16;
  }
  constexpr std::uint64_t kSignals = 11'000;
  std::vector<std::string> names;  // a definition only points to its texts
  for (std::uint64_t k = 0; k < kSignals; ++k) names.push_back("s" + std::to_string(k));
  for (std::uint64_t k = 0; k < kSignals; ++k) {
    message.signals.push_back(
        selected(names[k].c_str(), 5, kSelectors[k % 2], {{k * 3, 30000 + k * 3}}));
  }
  const MessageCodec codec(message);
  DecodedMessage values(message.signals.size());
  for (int i = 0; i < 20; ++i) {
    expect_as_naive(message, codec, drawn.payload(8, false), values);
    if (HasFatalFailure()) return;
  }
}

}  // namespace
}  // namespace beltgrip::can
