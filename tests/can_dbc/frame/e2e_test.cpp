#include "can_dbc/frame/e2e.h"

#include <gtest/gtest.h>

#include <array>
#include <optional>
#include <random>
#include <vector>

namespace beltgrip::can::e2e {
namespace {

// Bit by bit, as the polynomial division is written down.
std::uint8_t naive_crc(std::uint16_t data_id, std::span<const std::uint8_t> bytes) {
  std::vector<std::uint8_t> all{static_cast<std::uint8_t>(data_id),
                                static_cast<std::uint8_t>(data_id >> 8)};
  all.insert(all.end(), bytes.begin(), bytes.end());
  unsigned crc = 0;
  for (const std::uint8_t byte : all) {
    for (int bit = 7; bit >= 0; --bit) {
      const unsigned in = (byte >> bit) & 1U;
      const unsigned out = (crc >> 7) & 1U;
      crc = (crc << 1) & 0xFFU;
      if ((in ^ out) != 0) crc ^= 0x1DU;
    }
  }
  return static_cast<std::uint8_t>(crc);
}

CanFrame frame_of(std::uint16_t data_id, std::uint8_t counter) {
  CanFrame frame;
  frame.id = {data_id, false};
  frame.length = 8;
  frame.data = {0, 0x50, 0x11, 0x22, 0x33, 0x44, 0x55, 0x66};
  protect(frame, data_id, counter);
  return frame;
}

TEST(E2e, CrcOfTheWrittenExamples) {
  const std::array<std::uint8_t, 7> estimate{0x03, 0, 0, 0, 0, 0, 0};
  const std::array<std::uint8_t, 7> clamp{0x05, 0x01, 0xA6, 0x0B, 0, 0, 0};
  EXPECT_EQ(crc_profile1(0x6A0, estimate), 0xF4);
  EXPECT_EQ(crc_profile1(0x6A2, clamp), 0x0E);
}

TEST(E2e, CrcEqualsBitwiseDivision) {
  std::mt19937_64 random(3);
  for (int i = 0; i < 20'000; ++i) {
    std::array<std::uint8_t, 7> bytes{};
    for (auto& byte : bytes) byte = static_cast<std::uint8_t>(random());
    const auto data_id = static_cast<std::uint16_t>(random());
    ASSERT_EQ(crc_profile1(data_id, bytes), naive_crc(data_id, bytes));
  }
}

TEST(E2e, ProtectWritesCounterAndCrcAndNothingElse) {
  const CanFrame frame = frame_of(0x6A2, 5);
  EXPECT_EQ(frame.data[1], 0x55);
  EXPECT_EQ(frame.data[0], naive_crc(0x6A2, {frame.data.data() + 1, 7}));
  EXPECT_EQ(frame.data[7], 0x66);
  EXPECT_EQ(next_counter(0), 1);
  EXPECT_EQ(next_counter(13), 14);
  EXPECT_EQ(next_counter(14), 0);
}

// E1: all single, double and triple flips over the 64 bits of a protected frame. Only the 198
// triples that the polynomial cannot see pass the CRC.
TEST(E2e, BitFlipsOneToThreeExhaustively) {
  const CanFrame good = frame_of(0x6A0, 7);
  const auto passes = [&](std::initializer_list<unsigned> bits) {
    CanFrame frame = good;
    for (const unsigned bit : bits) {
      frame.data[bit / 8] = static_cast<std::uint8_t>(frame.data[bit / 8] ^ (1U << (bit % 8)));
    }
    return crc_profile1(0x6A0, {frame.data.data() + 1, 7}) == frame.data[0];
  };
  int cases = 0;
  int passed_one = 0;
  int passed_two = 0;
  int passed_three = 0;
  for (unsigned a = 0; a < 64; ++a) {
    ++cases;
    passed_one += passes({a}) ? 1 : 0;
    for (unsigned b = 0; b < a; ++b) {
      ++cases;
      passed_two += passes({a, b}) ? 1 : 0;
      for (unsigned c = 0; c < b; ++c) {
        ++cases;
        passed_three += passes({a, b, c}) ? 1 : 0;
      }
    }
  }
  EXPECT_EQ(cases, 64 + 2016 + 41664);
  EXPECT_EQ(passed_one, 0);
  EXPECT_EQ(passed_two, 0);
  EXPECT_EQ(passed_three, 198);
}

// E2: every pattern of every burst up to 8 bits long, in the order the CRC sees the bits: bytes 1
// to 7 from the top bit down, then the CRC itself.
TEST(E2e, BurstsUpToEightBitsExhaustively) {
  const CanFrame good = frame_of(0x6A2, 3);
  int accepted = 0;
  for (unsigned start = 0; start < 64; ++start) {
    for (unsigned pattern = 1; pattern < 256; ++pattern) {
      CanFrame frame = good;
      bool inside = true;
      for (unsigned i = 0; i < 8; ++i) {
        if (((pattern >> i) & 1U) == 0) continue;
        const unsigned position = start + i;
        if (position >= 64) {
          inside = false;
          break;
        }
        const unsigned byte = position < 56 ? 1 + position / 8 : 0;
        frame.data[byte] = static_cast<std::uint8_t>(frame.data[byte] ^ (0x80U >> (position % 8)));
      }
      if (inside && Checker(0x6A2, 1).check(frame) != CheckStatus::kWrongCrc) ++accepted;
    }
  }
  EXPECT_EQ(accepted, 0);
}

// E3: random payloads pass one time in 256 by the CRC alone. Seeded, so the count is one number;
// the bound is three standard deviations.
TEST(E2e, RandomFramesPassOneTimeIn256) {
  constexpr int kFrames = 10'000'000;
  std::mt19937_64 random(4);
  int passed = 0;
  for (int i = 0; i < kFrames; ++i) {
    const std::uint64_t word = random();
    std::array<std::uint8_t, 8> bytes{};
    for (std::size_t k = 0; k < 8; ++k) bytes[k] = static_cast<std::uint8_t>(word >> (8 * k));
    if (crc_profile1(0x6A0, {bytes.data() + 1, 7}) == bytes[0]) ++passed;
  }
  EXPECT_NEAR(passed, kFrames / 256.0, 3.0 * 197.3);  // sqrt(n p (1 - p))
}

// E4: the written table of counter pairs. Rows: last counter; columns: the new one; the illegal 15
// is never in sequence.
TEST(E2e, CounterPairsExhaustively) {
  for (std::uint8_t max_delta = 1; max_delta <= 4; ++max_delta) {
    for (std::uint8_t last = 0; last <= kCounterMax; ++last) {
      for (std::uint8_t now = 0; now <= 15; ++now) {
        Checker checker(0x6A0, max_delta);
        ASSERT_EQ(checker.check(frame_of(0x6A0, last)), CheckStatus::kOk);
        CanFrame frame = frame_of(0x6A0, 0);
        frame.data[1] = static_cast<std::uint8_t>((frame.data[1] & 0xF0U) | now);
        frame.data[0] = naive_crc(0x6A0, {frame.data.data() + 1, 7});
        int steps = 0;  // counted up one by one, 0 follows 14
        for (int at = last; at != now && steps <= 15; ++steps) at = at == 14 ? 0 : at + 1;
        CheckStatus wanted = CheckStatus::kWrongSequence;
        if (now == 15) {
          wanted = CheckStatus::kWrongSequence;
        } else if (steps == 0) {
          wanted = CheckStatus::kRepeated;
        } else if (steps == 1) {
          wanted = CheckStatus::kOk;
        } else if (steps <= max_delta) {
          wanted = CheckStatus::kOkSomeLost;
        }
        ASSERT_EQ(checker.check(frame), wanted)
            << "last " << int{last} << " now " << int{now} << " max_delta " << int{max_delta};
      }
    }
  }
}

// E5: all sequences of six events against a model that keeps nothing but the number of frames sent.
TEST(E2e, SequencesOfSixEventsExhaustively) {
  constexpr std::uint8_t kMaxDelta = 3;
  enum Event { kInOrder, kRepeat, kLostOne, kLostMax, kLostTooMany, kBadCrc, kEvents };
  for (int code = 0; code < 46'656; ++code) {
    Checker checker(0x6A1, kMaxDelta);
    int sent = 100;  // number of the last frame sent; counter is sent mod 15
    std::optional<int> last_accepted;
    int rest = code;
    for (int step = 0; step < 6; ++step, rest /= kEvents) {
      const int event = rest % kEvents;
      sent += std::array<int, kEvents>{
          1, 0, 2, kMaxDelta, kMaxDelta + 1, 1}[static_cast<std::size_t>(event)];
      CanFrame frame = frame_of(0x6A1, static_cast<std::uint8_t>(sent % 15));
      CheckStatus wanted = CheckStatus::kOk;
      if (event == kBadCrc) {
        frame.data[5] ^= 0x10;
        wanted = CheckStatus::kWrongCrc;
      } else {
        if (last_accepted) {
          const int delta = (sent - *last_accepted) % 15;
          wanted = delta == 0           ? CheckStatus::kRepeated
                   : delta == 1         ? CheckStatus::kOk
                   : delta <= kMaxDelta ? CheckStatus::kOkSomeLost
                                        : CheckStatus::kWrongSequence;
        }
        last_accepted = sent;
      }
      ASSERT_EQ(checker.check(frame), wanted) << "sequence " << code << " step " << step;
    }
  }
}

// E8: a correct frame of another message is not ours.
TEST(E2e, FramesOfAnotherDataIdAreRejected) {
  for (std::uint16_t other = 0x6A1; other <= 0x6A3; ++other) {
    for (std::uint8_t counter = 0; counter <= kCounterMax; ++counter) {
      EXPECT_EQ(Checker(0x6A0, 2).check(frame_of(other, counter)), CheckStatus::kWrongCrc);
    }
  }
}

TEST(E2e, FramesOfAnotherKindOrLengthAreRejected) {
  const CanFrame good = frame_of(0x6A0, 1);
  for (std::uint8_t length = 0; length <= 64; ++length) {
    CanFrame frame = good;
    frame.length = length;
    EXPECT_EQ(Checker(0x6A0, 1).check(frame) == CheckStatus::kOk, length == 8);
  }
  CanFrame remote = good;
  remote.remote = true;
  EXPECT_EQ(Checker(0x6A0, 1).check(remote), CheckStatus::kWrongCrc);
  CanFrame error = good;
  error.error = true;
  EXPECT_EQ(Checker(0x6A0, 1).check(error), CheckStatus::kWrongCrc);
}

TEST(E2e, ResetForgetsTheSequence) {
  Checker checker(0x6A0, 1);
  EXPECT_EQ(checker.check(frame_of(0x6A0, 3)), CheckStatus::kOk);
  EXPECT_EQ(checker.check(frame_of(0x6A0, 9)), CheckStatus::kWrongSequence);
  EXPECT_EQ(checker.check(frame_of(0x6A0, 10)), CheckStatus::kOk);
  checker.reset();
  EXPECT_EQ(checker.check(frame_of(0x6A0, 2)), CheckStatus::kOk);
}

}  // namespace
}  // namespace beltgrip::can::e2e
