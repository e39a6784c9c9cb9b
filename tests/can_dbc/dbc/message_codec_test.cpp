#include "can_dbc/dbc/message_codec.h"

#include <gtest/gtest.h>

#include <array>

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
                   std::vector<std::pair<std::uint64_t, std::uint64_t>> ranges) {
  SignalDef signal = byte_signal(name, byte);
  signal.multiplexed_by = MuxRule{selector, std::move(ranges)};
  return signal;
}

using Values = std::array<DecodedSignal, 8>;

TEST(MessageCodec, LeavesOutWhatLiesOutsideThePayload) {
  MessageDef message;
  message.signals = {byte_signal("a", 0), byte_signal("b", 1), byte_signal("c", 7)};
  const MessageCodec codec(message);
  Values values;
  EXPECT_EQ(codec.decode(std::array<std::uint8_t, 2>{5, 6}, values), 2U);
  EXPECT_TRUE(values[0].present);
  EXPECT_EQ(values[1].raw, 6U);
  EXPECT_FALSE(values[2].present);
  EXPECT_EQ(codec.decode({}, values), 0U);
}

TEST(MessageCodec, SelectsByRangesAlsoWhenTheSelectorComesLater) {
  MessageDef message;
  message.signals = {selected("low", 1, "mux", {{0, 3}, {7, 7}}),
                     selected("high", 1, "mux", {{4, 6}}), byte_signal("mux", 0)};
  const MessageCodec codec(message);
  Values values;
  for (std::uint8_t mux = 0; mux < 9; ++mux) {
    codec.decode(std::array<std::uint8_t, 2>{mux, 9}, values);
    EXPECT_EQ(values[0].present, mux <= 3 || mux == 7) << int{mux};
    EXPECT_EQ(values[1].present, mux >= 4 && mux <= 6) << int{mux};
    EXPECT_TRUE(values[2].present);
  }
}

TEST(MessageCodec, CascadesThroughSelectorsThatAreThemselvesSelected) {
  MessageDef message;
  message.signals = {selected("leaf", 2, "inner", {{1, 1}}),
                     selected("inner", 1, "outer", {{5, 5}}), byte_signal("outer", 0)};
  const MessageCodec codec(message);
  Values values;
  codec.decode(std::array<std::uint8_t, 3>{5, 1, 42}, values);
  EXPECT_TRUE(values[0].present);
  EXPECT_EQ(values[0].physical, 42.0);
  codec.decode(std::array<std::uint8_t, 3>{4, 1, 42}, values);
  EXPECT_FALSE(values[0].present);
  EXPECT_FALSE(values[1].present);
}

TEST(MessageCodec, NeverSelectsThroughACircleOrAnUnknownSelector) {
  MessageDef message;
  message.signals = {
      selected("a", 0, "b", {{0, 255}}),         selected("b", 1, "a", {{0, 255}}),
      selected("below", 2, "a", {{0, 255}}),     selected("self", 3, "self", {{0, 255}}),
      selected("lost", 4, "nobody", {{0, 255}}), byte_signal("plain", 5)};
  const MessageCodec codec(message);
  Values values;
  EXPECT_EQ(codec.decode(std::array<std::uint8_t, 8>{}, values), 1U);
  EXPECT_TRUE(values[5].present);
}

TEST(MessageCodec, SelectsByTheBitsOfASignedSelector) {
  MessageDef message;
  SignalDef mux = byte_signal("mux", 0);
  mux.type = ValueType::kSigned;
  message.signals = {mux, selected("a", 1, "mux", {{128, 255}})};
  const MessageCodec codec(message);
  Values values;
  codec.decode(std::array<std::uint8_t, 2>{0x7F, 0}, values);
  EXPECT_FALSE(values[1].present);
  codec.decode(std::array<std::uint8_t, 2>{0x80, 0}, values);
  EXPECT_TRUE(values[1].present);
}

}  // namespace
}  // namespace beltgrip::can
