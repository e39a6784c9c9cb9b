// What a test program's exit status says: nothing passes unnoticed.
#include "tests/support/process.h"

namespace beltgrip::test {
namespace {

std::optional<int> status_of(const std::string& filter) {
  return run({BELTGRIP_SUBJECT, "--gtest_filter=" + filter}, Milliseconds{20000}).status;
}

TEST(Main, PassesWhatHolds) {
  EXPECT_EQ(status_of("*.Holds"), 0);
  EXPECT_EQ(status_of("*.Throws"), 0);
}
TEST(Main, FailsWhereOneFails) { EXPECT_EQ(status_of("*.Holds:*.Fails"), 1); }
TEST(Main, FailsATestThatAssertsNothing) {
  EXPECT_EQ(status_of("*.Holds:*.AssertsNothing"), 1);
  EXPECT_NE(run({BELTGRIP_SUBJECT, "--gtest_filter=*.AssertsNothing"}, Milliseconds{20000})
                .out.find("Subject.AssertsNothing asserts nothing"),
            std::string::npos);
}
TEST(Main, FailsWhereNothingIsRun) { EXPECT_EQ(status_of("*.NoSuchTest"), 1); }
TEST(Main, TellsASkippedTestFromAPassedOne) { EXPECT_EQ(status_of("*.Holds:*.IsSkipped"), 77); }
TEST(Main, AFailureIsNotHiddenByASkippedTest) { EXPECT_EQ(status_of("*.Fails:*.IsSkipped"), 1); }
TEST(Main, ListsWithoutRunning) {
  EXPECT_EQ(run({BELTGRIP_SUBJECT, "--gtest_list_tests"}, Milliseconds{20000}).status, 0);
}

}  // namespace
}  // namespace beltgrip::test
