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
  const MonoTime begin{10 * kSecond}, end = MonoTime{11 * kSecond};
  RecordedRequests recorded({request(begin, end), request(MonoTime{20 * kSecond}, {})});
  const auto stands_at = [&](MonoTime t) {
    recorded.step(t);
    return recorded.standing() != nullptr;
  };
  EXPECT_FALSE(stands_at(begin - kNanosecond));
  EXPECT_TRUE(stands_at(begin));
  EXPECT_TRUE(stands_at(end - kNanosecond));
  EXPECT_FALSE(stands_at(end));
  EXPECT_FALSE(stands_at(MonoTime{19 * kSecond}));
  EXPECT_TRUE(stands_at(MonoTime{20 * kSecond}));
  EXPECT_TRUE(stands_at(MonoTime{1000 * kSecond}));  // the log ends before the request
}

TEST(RecordedRequests, ForceIsALineBetweenTheFrames) {
  RecordedRequests recorded({request(MonoTime{kSecond}, MonoTime{2 * kSecond})});
  recorded.step(MonoTime{kSecond} - kNanosecond);
  EXPECT_EQ(recorded.force_N(), 0.0);
  recorded.step(MonoTime{kSecond});
  EXPECT_EQ(recorded.force_N(), 4000.0);
  recorded.step(MonoTime{kSecond + 4 * kMillisecond});
  EXPECT_NEAR(recorded.force_N(), 3996.0, 1e-9);
  recorded.step(MonoTime{kSecond + 10 * kMillisecond});
  EXPECT_EQ(recorded.force_N(), 3990.0);
  recorded.step(MonoTime{kSecond + 40 * kMillisecond});
  EXPECT_EQ(recorded.force_N(), 3990.0);
}

TEST(RecordedRequests, BeginForATenthOfASecondAndAreNearASecondBefore) {
  RecordedRequests recorded({request(MonoTime{10 * kSecond}, MonoTime{11 * kSecond})});
  recorded.step(MonoTime{9 * kSecond - kMillisecond});
  EXPECT_FALSE(recorded.near());
  recorded.step(MonoTime{9 * kSecond});
  EXPECT_TRUE(recorded.near());
  EXPECT_FALSE(recorded.begins());
  recorded.step(MonoTime{10 * kSecond});
  EXPECT_TRUE(recorded.begins());
  recorded.step(MonoTime{10 * kSecond + 100 * kMillisecond});
  EXPECT_TRUE(recorded.begins());
  recorded.step(MonoTime{10 * kSecond + 105 * kMillisecond});
  EXPECT_FALSE(recorded.begins());
  EXPECT_TRUE(recorded.near());
  recorded.step(MonoTime{11 * kSecond});
  EXPECT_FALSE(recorded.near());
}

}  // namespace
}  // namespace beltgrip::daemon
