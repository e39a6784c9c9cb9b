// ISO-TP against frames written down by hand from ISO 15765-2, and every frame there can be.
#include "can_dbc/uds/iso_tp.h"

#include <gtest/gtest.h>

#include <vector>

namespace beltgrip::can {
namespace {

using Event = IsoTpReceiver::Event;
using Bytes = std::vector<std::uint8_t>;

constexpr std::int64_t kMs = 1'000'000;

CanFrame frame_of(const Bytes& bytes) {
  CanFrame frame;
  frame.id = {0x7E9, false};
  frame.length = static_cast<std::uint8_t>(bytes.size());
  std::copy(bytes.begin(), bytes.end(), frame.data.begin());
  return frame;
}

Bytes message_of(const IsoTpReceiver& receiver) {
  return {receiver.message().begin(), receiver.message().end()};
}

class IsoTp : public testing::Test {
 protected:
  Event take(const Bytes& bytes) { return receiver_.on_frame(t_ns_ += kMs, frame_of(bytes)); }
  void ignores(const Bytes& bytes) {
    const bool before = receiver_.receiving();
    EXPECT_EQ(take(bytes), Event::kIgnored);
    EXPECT_EQ(receiver_.receiving(), before);
  }

  IsoTpReceiver receiver_;
  std::int64_t t_ns_ = 0;
};

TEST_F(IsoTp, ASingleFrameIsAMessage) {
  EXPECT_EQ(take({0x05, 0x62, 0x11, 0x01, 0x09, 0xC4, 0xAA, 0xAA}), Event::kMessage);
  EXPECT_EQ(message_of(receiver_), (Bytes{0x62, 0x11, 0x01, 0x09, 0xC4}));
  EXPECT_EQ(receiver_.first_ns(), kMs);
  EXPECT_EQ(take({0x07, 1, 2, 3, 4, 5, 6, 7}), Event::kMessage);
  EXPECT_EQ(message_of(receiver_), (Bytes{1, 2, 3, 4, 5, 6, 7}));
  EXPECT_EQ(take({0x01, 0x3E}), Event::kMessage);  // not filled up
  EXPECT_EQ(message_of(receiver_), (Bytes{0x3E}));
}

// 0x00 and the length in the next byte: frames of CAN FD with more than 8 bytes.
TEST_F(IsoTp, ASingleFrameOfCanFd) {
  EXPECT_EQ(take({0x00, 0x09, 1, 2, 3, 4, 5, 6, 7, 8, 9, 0xCC}), Event::kMessage);
  EXPECT_EQ(message_of(receiver_), (Bytes{1, 2, 3, 4, 5, 6, 7, 8, 9}));
  Bytes whole{0x00, 62};
  for (std::uint8_t i = 0; i < 62; ++i) whole.push_back(i);
  EXPECT_EQ(take(whole), Event::kMessage);
  EXPECT_EQ(receiver_.message().size(), 62U);
  ignores({0x00, 0x0B, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10});  // more than it holds
  ignores({0x00, 0x07, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10});  // would fit in 8 bytes
  ignores({0x09, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11});    // the short form
}

// A first frame of 64 bytes holds 62, a consecutive one 63; the last may be shorter.
TEST_F(IsoTp, FramesOfCanFdMakeOneMessage) {
  Bytes first{0x10, 0x96};  // 150
  Bytes second{0x21}, last{0x22};
  for (std::uint8_t i = 0; i < 62; ++i) first.push_back(i);
  for (std::uint8_t i = 62; i < 125; ++i) second.push_back(i);
  for (std::uint8_t i = 125; i < 150; ++i) last.push_back(i);
  last.resize(32, 0xCC);
  EXPECT_EQ(take(first), Event::kFirst);
  ignores({0x21, 1, 2, 3, 4, 5, 6, 7});  // shorter, and not the last
  EXPECT_EQ(take(second), Event::kContinued);
  EXPECT_EQ(take(last), Event::kMessage);
  ASSERT_EQ(receiver_.message().size(), 150U);
  for (std::size_t i = 0; i < 150; ++i) EXPECT_EQ(receiver_.message()[i], i);
  // What would have fit in one frame needs no first one.
  first[1] = 62;
  first[0] = 0x10;
  ignores(first);
}

TEST_F(IsoTp, ASingleFrameThatSaysMoreThanItHoldsIsIgnored) {
  ignores({0x00, 1, 2, 3, 4, 5, 6, 7});
  ignores({0x08, 1, 2, 3, 4, 5, 6, 7});
  ignores({0x0F, 1, 2, 3, 4, 5, 6, 7});
  ignores({0x03, 1, 2});
  ignores({0x01});
  ignores({});
}

// The answer to 22 F1 90 with a vehicle identification number of 17 characters: 20 bytes = 0x014.
TEST_F(IsoTp, AVehicleIdentificationNumber) {
  EXPECT_EQ(take({0x10, 0x14, 0x62, 0xF1, 0x90, 'W', '0', 'L'}), Event::kFirst);
  EXPECT_TRUE(receiver_.receiving());
  EXPECT_EQ(take({0x21, '0', '0', '0', '0', '4', '3', 'M'}), Event::kContinued);
  EXPECT_EQ(take({0x22, 'B', '5', '4', '1', '3', '2', '6'}), Event::kMessage);
  EXPECT_FALSE(receiver_.receiving());
  const Bytes message = message_of(receiver_);
  EXPECT_EQ(std::string(message.begin() + 3, message.end()), "W0L000043MB541326");
  EXPECT_EQ(receiver_.first_ns(), kMs);
}

// 125 bytes: 6, and 17 times 7; the sequence number is 1 to 15, 0, 1.
TEST_F(IsoTp, TheSequenceNumberGoesRound) {
  EXPECT_EQ(take({0x10, 125, 0, 1, 2, 3, 4, 5}), Event::kFirst);
  std::uint8_t value = 6;
  for (const unsigned sequence :
       {1U, 2U, 3U, 4U, 5U, 6U, 7U, 8U, 9U, 10U, 11U, 12U, 13U, 14U, 15U, 0U, 1U}) {
    Bytes bytes{static_cast<std::uint8_t>(0x20 + sequence)};
    for (int i = 0; i < 7; ++i) bytes.push_back(value++);
    EXPECT_EQ(take(bytes), value == 125 ? Event::kMessage : Event::kContinued);
  }
  ASSERT_EQ(receiver_.message().size(), 125U);
  for (std::size_t i = 0; i < 125; ++i) EXPECT_EQ(receiver_.message()[i], i);
}

TEST_F(IsoTp, TheLongestMessage) {
  EXPECT_EQ(take({0x1F, 0xFF, 7, 7, 7, 7, 7, 7}), Event::kFirst);
  for (int i = 1; i <= 584; ++i) {
    EXPECT_EQ(take({static_cast<std::uint8_t>(0x20 + i % 16), 7, 7, 7, 7, 7, 7, 7}),
              Event::kContinued);
  }
  EXPECT_EQ(take({0x20 + 585 % 16, 9, 0xCC, 0xCC, 0xCC, 0xCC, 0xCC, 0xCC}), Event::kMessage);
  EXPECT_EQ(receiver_.message().size(), 4095U);
  EXPECT_EQ(receiver_.message().back(), 9);
}

TEST_F(IsoTp, FirstFramesThatAreNone) {
  ignores({0x10, 0x07, 1, 2, 3, 4, 5, 6});        // fits a single frame
  ignores({0x10, 0x14, 1, 2, 3, 4, 5});           // shorter than 8 bytes
  ignores({0x10, 0x00, 0, 0, 0x0F, 0xFF, 1, 2});  // long form of a short length
  EXPECT_EQ(take({0x10, 0x00, 0, 0, 0x10, 0x00, 1, 2}), Event::kTooLong);  // 4096
  EXPECT_EQ(take({0x10, 0x00, 0x80, 0, 0, 0, 1, 2}), Event::kTooLong);
  EXPECT_FALSE(receiver_.receiving());
  EXPECT_EQ(take({0x10, 0x08, 1, 2, 3, 4, 5, 6}), Event::kFirst);
  EXPECT_EQ(take({0x10, 0x00, 1, 0, 0, 0, 1, 2}), Event::kTooLong);  // ends what was under way
  EXPECT_FALSE(receiver_.receiving());
}

TEST_F(IsoTp, AWrongSequenceNumberEndsTheMessage) {
  for (const std::uint8_t wrong : Bytes{0x20, 0x22, 0x2F}) {
    EXPECT_EQ(take({0x10, 0x14, 1, 2, 3, 4, 5, 6}), Event::kFirst);
    EXPECT_EQ(take({wrong, 1, 2, 3, 4, 5, 6, 7}), Event::kBroken);
    ignores({0x21, 1, 2, 3, 4, 5, 6, 7});
    ignores({0x22, 1, 2, 3, 4, 5, 6, 7});
  }
  EXPECT_EQ(take({0x10, 0x14, 1, 2, 3, 4, 5, 6}), Event::kFirst);
  EXPECT_EQ(take({0x21, 1, 2, 3, 4, 5, 6, 7}), Event::kContinued);
  EXPECT_EQ(take({0x21, 1, 2, 3, 4, 5, 6, 7}), Event::kBroken);  // twice the same
}

TEST_F(IsoTp, TheNextFrameComesWithinASecond) {
  for (const bool late : {false, true}) {
    EXPECT_EQ(take({0x10, 0x14, 1, 2, 3, 4, 5, 6}), Event::kFirst);
    EXPECT_EQ(take({0x21, 1, 2, 3, 4, 5, 6, 7}), Event::kContinued);
    const std::int64_t due_ns = t_ns_ + 1000 * kMs;
    EXPECT_FALSE(receiver_.expire(due_ns));
    t_ns_ = due_ns - kMs + (late ? 1 : 0);
    EXPECT_EQ(take({0x22, 1, 2, 3, 4, 5, 6, 7}), late ? Event::kBroken : Event::kMessage);
  }
  EXPECT_EQ(take({0x10, 0x14, 1, 2, 3, 4, 5, 6}), Event::kFirst);
  EXPECT_TRUE(receiver_.expire(t_ns_ + 1000 * kMs + 1));
  EXPECT_FALSE(receiver_.receiving());
  EXPECT_FALSE(receiver_.expire(t_ns_ + 5000 * kMs));
}

TEST_F(IsoTp, ANewMessageEndsTheOldOne) {
  EXPECT_EQ(take({0x10, 0x14, 1, 2, 3, 4, 5, 6}), Event::kFirst);
  EXPECT_EQ(take({0x10, 0x08, 9, 8, 7, 6, 5, 4}), Event::kFirst);
  EXPECT_EQ(take({0x21, 3, 2}), Event::kMessage);
  EXPECT_EQ(message_of(receiver_), (Bytes{9, 8, 7, 6, 5, 4, 3, 2}));
  EXPECT_EQ(take({0x10, 0x14, 1, 2, 3, 4, 5, 6}), Event::kFirst);
  EXPECT_EQ(take({0x02, 0x3E, 0x00}), Event::kMessage);
  ignores({0x21, 1, 2, 3, 4, 5, 6, 7});
}

TEST_F(IsoTp, ConsecutiveFramesThatAreTooShortAreIgnored) {
  EXPECT_EQ(take({0x10, 0x10, 1, 2, 3, 4, 5, 6}), Event::kFirst);  // 10 bytes more
  ignores({0x21, 1, 2, 3, 4, 5, 6});
  EXPECT_EQ(take({0x21, 1, 2, 3, 4, 5, 6, 7}), Event::kContinued);
  ignores({0x22, 1, 2});
  EXPECT_EQ(take({0x22, 8, 9, 10}), Event::kMessage);
  EXPECT_EQ(receiver_.message().size(), 16U);
}

TEST_F(IsoTp, WhatIsNoFrameOfAMessageIsIgnored) {
  ignores({0x21, 1, 2, 3, 4, 5, 6, 7});  // nothing under way
  EXPECT_EQ(take({0x10, 0x0D, 1, 2, 3, 4, 5, 6}), Event::kFirst);
  ignores({0x30, 0, 0});
  for (unsigned kind = 4; kind <= 15; ++kind) {
    ignores({static_cast<std::uint8_t>(kind << 4U), 1, 2, 3, 4, 5, 6, 7});
  }
  CanFrame odd = frame_of({0x21, 1, 2, 3, 4, 5, 6, 7});
  odd.error = true;
  EXPECT_EQ(receiver_.on_frame(t_ns_, odd), Event::kIgnored);
  odd.error = false;
  odd.remote = true;
  EXPECT_EQ(receiver_.on_frame(t_ns_, odd), Event::kIgnored);
  EXPECT_EQ(take({0x21, 1, 2, 3, 4, 5, 6, 7}), Event::kMessage);
}

// Every first byte and length, with nothing and with a message under way.
TEST_F(IsoTp, EveryFrameThereCanBe) {
  for (unsigned first = 0; first < 256; ++first) {
    for (std::size_t length = 0; length <= 8; ++length) {
      for (const bool under_way : {false, true}) {
        receiver_.reset();
        if (under_way) take({0x10, 0x14, 1, 2, 3, 4, 5, 6});
        Bytes bytes(length, 0xFF);
        if (length > 0) bytes[0] = static_cast<std::uint8_t>(first);
        const Event event = take(bytes);
        const unsigned kind = first >> 4U, low = first & 15U;
        Event expected = Event::kIgnored;
        if (length > 0 && kind == 0 && low >= 1 && low <= 7 && low < length) {
          expected = Event::kMessage;
        } else if (length == 8 && kind == 1) {
          expected = Event::kFirst;  // low * 256 + 255 bytes
        } else if (length == 8 && kind == 2 && under_way) {
          expected = low == 1 ? Event::kContinued : Event::kBroken;
        }
        EXPECT_EQ(event, expected) << first << " " << length << " " << under_way;
      }
    }
  }
}

TEST(IsoTpSending, TheFramesOfAReceiver) {
  const Bytes request{0x22, 0x11, 0x01};
  CanFrame frame = iso_tp_single({0x7E1, false}, request);
  CanFrame expected = frame_of({0x03, 0x22, 0x11, 0x01, 0xCC, 0xCC, 0xCC, 0xCC});
  expected.id = {0x7E1, false};
  EXPECT_EQ(frame, expected);
  frame = iso_tp_flow_control({0x18DA10F1, true}, FlowStatus::kContinue);
  EXPECT_EQ(frame.id, (CanId{0x18DA10F1, true}));
  EXPECT_EQ(Bytes(frame.payload().begin(), frame.payload().end()),
            (Bytes{0x30, 0x00, 0x00, 0xCC, 0xCC, 0xCC, 0xCC, 0xCC}));
  EXPECT_EQ(iso_tp_flow_control({1, false}, FlowStatus::kOverflow).data[0], 0x32);
}

}  // namespace
}  // namespace beltgrip::can
