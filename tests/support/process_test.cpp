#include "tests/support/process.h"

#include <gtest/gtest.h>

#include <csignal>
#include <system_error>

namespace beltgrip::test {
namespace {

constexpr Milliseconds kLong{20000};

TEST(Process, GivesStatusAndBothStreams) {
  const RunResult result = run({"sh", "-c", "echo good; echo bad >&2; exit 7"}, kLong);
  EXPECT_EQ(result.status, 7);
  EXPECT_EQ(result.out, "good\n");
  EXPECT_EQ(result.err, "bad\n");
}

TEST(Process, TakesMoreOutputThanAPipeHolds) {
  const RunResult result = run({"sh", "-c", "head -c 1000000 /dev/zero"}, kLong);
  EXPECT_EQ(result.status, 0);
  EXPECT_EQ(result.out.size(), 1000000U);
}

TEST(Process, ReadsItsInputFromAFile) {
  EXPECT_EQ(run({"wc", "-c"}, kLong, "/dev/null").out, "0\n");
}

TEST(Process, SaysNothingOfAChildThatStillRuns) {
  Process process({"sleep", "1000"});
  EXPECT_EQ(process.wait(Milliseconds{1}), std::nullopt);
  process.signal(SIGTERM);
  EXPECT_EQ(process.wait(kLong), 128 + SIGTERM);
}

TEST(Process, WaitsForOutputAndSeesThatItWillNotCome) {
  Process process({"sh", "-c", "echo one; exec cat /dev/null"});
  EXPECT_TRUE(process.wait_for_output("one", kLong));
  EXPECT_FALSE(process.wait_for_output("two", kLong));
  EXPECT_EQ(process.wait(kLong), 0);
}

TEST(Process, ThrowsWhenThereIsNoSuchProgram) {
  EXPECT_THROW(Process({"no-such-program-here"}), std::system_error);
}

}  // namespace
}  // namespace beltgrip::test
