// The reference receiver of BeltGripClamp: what it takes, what it refuses, when it lets go.
#include "tools/sim/reference_receiver.h"

#include <gtest/gtest.h>

#include <array>
#include <cstdint>

namespace {

using Frame = std::array<std::uint8_t, 8>;

// An independent CRC: by table of the published examples' polynomial, bit by bit over a 72-bit
// word.
std::uint8_t crc(const Frame& frame) {
  std::array<std::uint8_t, 9> bytes{0xA2, 0x06};
  for (std::size_t i = 1; i < 8; ++i) bytes[i + 1] = frame[i];
  unsigned remainder = 0;
  for (const std::uint8_t byte : bytes) {
    for (int bit = 7; bit >= 0; --bit) {
      const unsigned in = byte >> bit & 1U;
      const unsigned out = remainder >> 7 & 1U;
      remainder = (remainder << 1 & 0xFFU) ^ ((in ^ out) != 0 ? 0x1DU : 0U);
    }
  }
  return static_cast<std::uint8_t>(remainder);
}

Frame request(unsigned counter, unsigned force_N) {
  Frame frame{};
  frame[1] = static_cast<std::uint8_t>(counter);
  frame[2] = force_N > 0 ? 1 : 0;
  frame[3] = static_cast<std::uint8_t>(force_N & 0xFFU);
  frame[4] = static_cast<std::uint8_t>(force_N >> 8);
  frame[0] = crc(frame);
  return frame;
}

class Receiver : public testing::Test {
 protected:
  void SetUp() override { beltgrip_receiver_init(&receiver_); }
  bool give(const Frame& frame, unsigned length = 8) {
    return beltgrip_receiver_frame(&receiver_, frame.data(), length, now_us_);
  }
  double force(bool permitted = true) {
    return beltgrip_receiver_force(&receiver_, &limits_, 5000.0, permitted, now_us_);
  }
  // Inactive frames with counters 0 and 1, then active from 2 on.
  void start(unsigned force_N) {
    give(request(0, 0));
    give(request(1, 0));
    EXPECT_TRUE(give(request(2, force_N)));
  }

  beltgrip_receiver receiver_;
  beltgrip_limits limits_{1500.0, 1e9};
  std::uint32_t now_us_ = 4'294'967'000u;  // wraps soon
};

TEST_F(Receiver, PublishedExample) {
  Frame frame{0x0E, 0x05, 0x01, 0xA6, 0x0B, 0, 0, 0};
  EXPECT_EQ(crc(frame), 0x0E);
  give(request(3, 0));
  give(request(4, 0));
  EXPECT_TRUE(give(frame));
  force();  // the fall begins
  now_us_ += 1000;
  EXPECT_EQ(force(), 2982.0);
}

TEST_F(Receiver, ObeysAndReturnsAfterFiftyMilliseconds) {
  EXPECT_EQ(force(), 5000.0);
  start(3000);
  EXPECT_EQ(force(), 5000.0);  // the first call starts the fall
  now_us_ += 50'000;
  EXPECT_EQ(force(), 3000.0);
  now_us_ += 1;
  EXPECT_EQ(force(), 5000.0);
}

TEST_F(Receiver, EndsAtOnceOnAnInactiveFrameWhateverItsCounter) {
  for (unsigned counter = 0; counter < 15; ++counter) {
    SetUp();
    start(3000);
    give(request(counter, 0));
    EXPECT_EQ(force(), 5000.0) << counter;
    EXPECT_FALSE(receiver_.active);
  }
}

TEST_F(Receiver, AnOldActiveFrameStartsNothing) {
  // Without an inactive frame first, and again after a time-out.
  EXPECT_FALSE(give(request(0, 3000)));
  EXPECT_FALSE(give(request(1, 3000)));
  start(3000);
  now_us_ += 50'001;
  EXPECT_FALSE(give(request(3, 3000)));
  EXPECT_FALSE(give(request(4, 3000)));
  EXPECT_EQ(force(), 5000.0);
  now_us_ += BELTGRIP_PAUSE_US;
  give(request(5, 0));
  EXPECT_TRUE(give(request(6, 3000)));
}

TEST_F(Receiver, NoRequestWithinASecondOfTheLast) {
  for (const bool by_frame : {true, false}) {
    SetUp();
    start(3000);
    now_us_ += by_frame ? 10'000 : 50'001;
    give(request(3, 0));
    force();
    const std::uint32_t ended_us = now_us_;
    EXPECT_FALSE(give(request(4, 3000)));
    now_us_ = ended_us + BELTGRIP_PAUSE_US - 1;
    EXPECT_FALSE(give(request(5, 3000)));
    now_us_ = ended_us + BELTGRIP_PAUSE_US;
    EXPECT_TRUE(give(request(6, 3000)));
  }
}

TEST_F(Receiver, EveryCounterPair) {
  for (unsigned last = 0; last < 15; ++last) {
    for (unsigned next = 0; next < 16; ++next) {
      SetUp();
      give(request((last + 13) % 15, 0));
      give(request((last + 14) % 15, 0));
      ASSERT_TRUE(give(request(last, 3000)));
      const unsigned delta = (next + 15 - last) % 15;
      EXPECT_EQ(give(request(next, 2900)), next < 15 && delta >= 1 && delta <= 3)
          << last << " " << next;
    }
  }
}

TEST_F(Receiver, ARepeatedFrameDoesNotKeepTheRequestAlive) {
  start(3000);
  force();
  for (int i = 0; i < 6; ++i) {
    now_us_ += 10'000;
    EXPECT_FALSE(give(request(2, 3000)));
  }
  EXPECT_EQ(force(), 5000.0);
}

TEST_F(Receiver, RefusesWhatIsNotAFrameOfTheInterface) {
  start(3000);
  force();
  now_us_ += 10'000;
  EXPECT_FALSE(give(request(3, 2000), 7));
  Frame reserved = request(3, 2000);
  reserved[7] = 1;
  reserved[0] = crc(reserved);
  EXPECT_FALSE(give(reserved));
  Frame contradiction = request(3, 2000);
  contradiction[2] = 0;
  contradiction[0] = crc(contradiction);
  EXPECT_FALSE(give(contradiction));
  EXPECT_EQ(force(), 3000.0);
}

TEST_F(Receiver, EverySingleAndDoubleBitErrorIsRefused) {
  const Frame right = request(3, 2000);
  for (unsigned a = 0; a < 64; ++a) {
    for (unsigned b = a; b < 64; ++b) {
      SetUp();
      start(3000);
      Frame wrong = right;
      wrong[a / 8] ^= static_cast<std::uint8_t>(1U << a % 8);
      if (b != a) wrong[b / 8] ^= static_cast<std::uint8_t>(1U << b % 8);
      ASSERT_FALSE(give(wrong)) << a << " " << b;
    }
  }
}

TEST_F(Receiver, LimitsOfTheControllerHold) {
  limits_ = {1500.0, 1000.0};
  start(100);
  EXPECT_EQ(force(), 5000.0);
  for (unsigned i = 1; i <= 60; ++i) {
    now_us_ += 10'000;
    ASSERT_TRUE(give(request((2 + i) % 15, 100)));
    const double expected = 5000.0 - 10.0 * i;
    EXPECT_NEAR(force(), expected, 1e-6);
  }
  for (unsigned i = 61; i <= 400; ++i) {
    now_us_ += 10'000;
    give(request((2 + i) % 15, 100));
    force();
  }
  EXPECT_EQ(force(), 1500.0);
}

TEST_F(Receiver, NeverAboveTheControllersOwnForce) {
  start(60'000);
  EXPECT_EQ(force(), 5000.0);
}

TEST_F(Receiver, WithoutPermissionNothingIsObeyed) {
  start(3000);
  force();
  now_us_ += 10'000;
  EXPECT_EQ(force(false), 5000.0);
  EXPECT_FALSE(give(request(3, 3000)));  // permission back: still over
  EXPECT_EQ(force(true), 5000.0);
}

// What the own law has to hold, cycle by cycle of 10 ms; expectations by hand.
TEST(OwnTorque, TheRequestedTorqueCountsBeforeTheActualOneFollows) {
  beltgrip_own_torque torque{};
  EXPECT_EQ(beltgrip_own_torque_Nm(&torque, 40.0, 20.0, 0), 40.0);
  EXPECT_EQ(beltgrip_own_torque_Nm(&torque, 20.0, 38.0, 10'000), 38.0);
  EXPECT_EQ(beltgrip_own_torque_Nm(&torque, -20.0, -21.0, 20'000), 21.0);
}

// Tip-in: -23 Nm, 90 asked for; the actual torque passes zero on its way.
TEST(OwnTorque, HoldsThroughATipIn) {
  beltgrip_own_torque torque{};
  EXPECT_EQ(beltgrip_own_torque_Nm(&torque, -23.0, -23.0, 0), 23.0);
  std::uint32_t now_us = 10'000;
  for (double actual_Nm = -23.0; actual_Nm < 90.0; actual_Nm += 7.5, now_us += 10'000) {
    EXPECT_EQ(beltgrip_own_torque_Nm(&torque, 90.0, actual_Nm, now_us), 90.0) << actual_Nm;
  }
}

// Tip-out: 60 Nm of drive, overrun of 25 asked for. Held until 0.3 s after both have one sign.
TEST(OwnTorque, HoldsThroughATipOutUntilTheNewTorqueHasSettled) {
  beltgrip_own_torque torque{};
  EXPECT_EQ(beltgrip_own_torque_Nm(&torque, 60.0, 60.0, 0), 60.0);
  EXPECT_EQ(beltgrip_own_torque_Nm(&torque, -25.0, 50.0, 10'000), 50.0);
  EXPECT_EQ(beltgrip_own_torque_Nm(&torque, -25.0, 5.0, 60'000), 50.0);
  EXPECT_EQ(beltgrip_own_torque_Nm(&torque, -25.0, -5.0, 70'000), 50.0);
  EXPECT_EQ(beltgrip_own_torque_Nm(&torque, -25.0, -25.0, 359'999), 50.0);
  EXPECT_EQ(beltgrip_own_torque_Nm(&torque, -25.0, -25.0, 360'000), 25.0);
}

}  // namespace
