// The checker of published frames finds what it is there to find.
#include "tests/system/vcan/published_frames.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace beltgrip::test {
namespace {

ReceivedFrame frame(canid_t id, const std::vector<std::uint8_t>& data) {
  ReceivedFrame seen;
  seen.frame.can_id = id;
  seen.frame.len = static_cast<std::uint8_t>(data.size());
  std::copy(data.begin(), data.end(), seen.frame.data);
  return seen;
}

// The examples of the interface, worked out by others.
const std::vector<std::uint8_t> kEstimate{0xF4, 0x03, 0, 0, 0, 0, 0, 0};
const std::vector<std::uint8_t> kClamp{0x0E, 0x05, 0x01, 0xA6, 0x0B, 0, 0, 0};

TEST(PublishedFrames, TakesTheExample) {
  PublishedFrames published;
  EXPECT_TRUE(published.take(frame(0x6A0, kEstimate)));
  EXPECT_TRUE(published.problems().empty());
  EXPECT_EQ(published.last("BeltGripEstimate").signals.at("Counter"), 3.0);
}

TEST(PublishedFrames, PassesOverOtherNodes) {
  PublishedFrames published;
  EXPECT_FALSE(published.take(frame(0x123, kEstimate)));
  EXPECT_FALSE(published.take(frame(0x6A0 | CAN_EFF_FLAG, kEstimate)));
  EXPECT_TRUE(published.of("BeltGripEstimate").empty());
}

TEST(PublishedFrames, FindsEveryFlippedBit) {
  for (unsigned bit = 0; bit < 64; ++bit) {
    PublishedFrames published;
    std::vector<std::uint8_t> data = kEstimate;
    data[bit / 8] ^= static_cast<std::uint8_t>(1U << (bit % 8));
    published.take(frame(0x6A0, data));
    EXPECT_FALSE(published.problems().empty()) << bit;
  }
}

TEST(PublishedFrames, FindsARepeatedCounterAndWrongLength) {
  PublishedFrames published;
  published.take(frame(0x6A0, kEstimate));
  published.take(frame(0x6A0, kEstimate));
  published.take(frame(0x6A0, {1, 2}));
  EXPECT_EQ(published.problems().size(), 2U);
  published.forget_counters();
  published.take(frame(0x6A0, kEstimate));
  EXPECT_EQ(published.problems().size(), 2U);
}

TEST(PublishedFrames, FindsAClampFrameThoughItsProtectionIsRight) {
  PublishedFrames published;
  published.take(frame(0x6A2, kClamp));
  EXPECT_EQ(published.problems(), std::vector<std::string>{"BeltGripClamp no. 0: sent in observe"});
  EXPECT_EQ(published.last("BeltGripClamp").signals.at("SecondaryForce"), 0x0BA6);
}

}  // namespace
}  // namespace beltgrip::test
