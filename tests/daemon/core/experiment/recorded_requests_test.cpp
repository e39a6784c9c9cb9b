// The requests of a log at the times of a replay's samples: which stands, from when to when, its
// force between two frames, when an experiment may still begin with it, and when one comes.
#include "daemon/core/experiment/recorded_requests.h"

#include <gtest/gtest.h>

namespace beltgrip::daemon {
namespace {

RecordedRequest request(MonoTime begin, std::optional<MonoTime> end) {
  RecordedRequest made;
  made.begin = begin;
  made.end = end;
  made.course = {{begin, 4000.0}, {begin + 10 * kMillisecond, 3990.0}};
  return made;
}

TEST(RecordedRequests, StandFromTheirFirstFrameToTheFirstThatDoesNotAsk) {
  const MonoTime begin = 10 * kSecond, end = 11 * kSecond;
  RecordedRequests recorded({request(begin, end), request(20 * kSecond, {})});
  const auto stands_at = [&](MonoTime t) {
    recorded.step(t);
    return recorded.standing() != nullptr;
  };
  EXPECT_FALSE(stands_at(begin - 1));
  EXPECT_TRUE(stands_at(begin));
  EXPECT_TRUE(stands_at(end - 1));
  EXPECT_FALSE(stands_at(end));
  EXPECT_FALSE(stands_at(19 * kSecond));
  EXPECT_TRUE(stands_at(20 * kSecond));
  EXPECT_TRUE(stands_at(1000 * kSecond));  // the log ends before the request
}

TEST(RecordedRequests, ForceIsALineBetweenTheFrames) {
  RecordedRequests recorded({request(kSecond, 2 * kSecond)});
  recorded.step(kSecond - 1);
  EXPECT_EQ(recorded.force_N(), 0.0);
  recorded.step(kSecond);
  EXPECT_EQ(recorded.force_N(), 4000.0);
  recorded.step(kSecond + 4 * kMillisecond);
  EXPECT_NEAR(recorded.force_N(), 3996.0, 1e-9);
  recorded.step(kSecond + 10 * kMillisecond);
  EXPECT_EQ(recorded.force_N(), 3990.0);
  recorded.step(kSecond + 40 * kMillisecond);
  EXPECT_EQ(recorded.force_N(), 3990.0);
}

TEST(RecordedRequests, BeginForATenthOfASecondAndAreNearASecondBefore) {
  RecordedRequests recorded({request(10 * kSecond, 11 * kSecond)});
  recorded.step(9 * kSecond - kMillisecond);
  EXPECT_FALSE(recorded.near());
  recorded.step(9 * kSecond);
  EXPECT_TRUE(recorded.near());
  EXPECT_FALSE(recorded.begins());
  recorded.step(10 * kSecond);
  EXPECT_TRUE(recorded.begins());
  recorded.step(10 * kSecond + 100 * kMillisecond);
  EXPECT_TRUE(recorded.begins());
  recorded.step(10 * kSecond + 105 * kMillisecond);
  EXPECT_FALSE(recorded.begins());
  EXPECT_TRUE(recorded.near());
  recorded.step(11 * kSecond);
  EXPECT_FALSE(recorded.near());
}

}  // namespace
}  // namespace beltgrip::daemon
