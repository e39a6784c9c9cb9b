// A result without a value names the reading that it failed by, and when.
#include <gtest/gtest.h>

#include <string>

#include "daemon/core/reasons/reasons.h"

namespace beltgrip::daemon {
namespace {

using estimator::Channel;
using estimator::ReadingVerdict;

ExperimentResult result_with(Channel channel, ReadingVerdict verdict) {
  ExperimentResult result;
  result.start = MonoTime{100 * kSecond};
  result.outcome = Outcome::kInconclusive;
  for (estimator::ReadingStatus& each : result.peak.readings) each.verdict = ReadingVerdict::kValid;
  estimator::ReadingStatus& reading = result.peak.readings[static_cast<std::size_t>(channel)];
  reading.verdict = verdict;
  reading.since_ns = 102'250'000'000;
  return result;
}

TEST(Why, ContradictoryPointsAreOfTheChannelThatStepped) {
  ExperimentResult result = result_with(Channel::kSecondarySpeed, ReadingVerdict::kStepped);
  result.peak.contradictory = true;
  EXPECT_EQ(why(result),
            "its points lie on no one friction curve: secondary_speed went to another level by "
            "itself, 2.25 s after the experiment began");
}

TEST(Why, ContradictoryPointsWithoutAStepAskForTheConstants) {
  ExperimentResult result = result_with(Channel::kTorque, ReadingVerdict::kFrozen);
  result.peak.contradictory = true;
  EXPECT_NE(why(result).find("is the piston area"), std::string::npos) << why(result);
}

TEST(Why, AnInputThatStoodStillIsNamed) {
  ExperimentResult result = result_with(Channel::kTorque, ReadingVerdict::kFrozen);
  result.stop_reason = estimator::StopReason::kInputs;
  EXPECT_NE(why(result).find("torque stood still, 2.25 s after the experiment began"),
            std::string::npos)
      << why(result);
  result.peak.readings = {};
  EXPECT_NE(why(result).find("an input was lost, stood still"), std::string::npos) << why(result);
}

}  // namespace
}  // namespace beltgrip::daemon
