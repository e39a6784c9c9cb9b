// What a test program's exit status says: nothing passes unnoticed.
#include "tests/support/process.h"

namespace beltgrip::test {
namespace {

RunResult called(const std::string& name, const std::string& argument) {
  return run({BELTGRIP_SUBJECTS + name, argument}, Milliseconds{20000});
}

std::optional<int> status_of(const std::string& filter) {
  return called("subjects", "--gtest_filter=" + filter).status;
}

TEST(Main, PassesWhatHolds) {
  EXPECT_EQ(status_of("*.Holds"), 0);
  EXPECT_EQ(status_of("*.Throws"), 0);
}
TEST(Main, FailsWhereOneFails) { EXPECT_EQ(status_of("*.Holds:*.Fails"), 1); }
TEST(Main, FailsATestThatAssertsNothing) {
  EXPECT_EQ(status_of("*.Holds:*.AssertsNothing"), 1);
  EXPECT_NE(called("subjects", "--gtest_filter=*.AssertsNothing")
                .out.find("Subject.AssertsNothing asserts nothing"),
            std::string::npos);
}
TEST(Main, FailsWhereNothingIsRun) { EXPECT_EQ(status_of("*.NoSuchTest"), 1); }
TEST(Main, TellsASkippedTestFromAPassedOne) { EXPECT_EQ(status_of("*.Holds:*.IsSkipped"), 77); }
TEST(Main, AFailureIsNotHiddenByASkippedTest) { EXPECT_EQ(status_of("*.Fails:*.IsSkipped"), 1); }
TEST(Main, ListsWithoutRunning) { EXPECT_EQ(called("subjects", "--gtest_list_tests").status, 0); }

// A room's program by the names of its sources.
TEST(RoomMain, RunsAllByItsOwnName) {
  const std::string list = "\n" + called("subjects", "--gtest_list_tests").out;
  EXPECT_NE(list.find("\nSubject."), std::string::npos);
  EXPECT_NE(list.find("OtherSubject."), std::string::npos);
}
TEST(RoomMain, RunsOneSourceByItsName) {
  const std::string listed = called("other_subject", "--gtest_list_tests").out;
  EXPECT_EQ(("\n" + listed).find("\nSubject."), std::string::npos) << listed;
  const RunResult one = called("main_subject", "--gtest_filter=*Holds");
  EXPECT_EQ(one.status, 0);
  EXPECT_NE(one.out.find("[  PASSED  ] 1 test."), std::string::npos) << one.out;
  EXPECT_EQ(called("main_subject", "--gtest_filter=*.FailsToo").status, 1) << "no test was run";
  EXPECT_EQ(called("other_subject", "--gtest_filter=*Holds").status, 0);
  EXPECT_EQ(called("other_subject", "--gtest_filter=-*FailsToo").status, 0);
}
TEST(RoomMain, FailsByTheNameOfATestThatItDoesNotHold) {
  EXPECT_EQ(called("third_test", "--gtest_filter=*Holds").status, 1);
}

}  // namespace
}  // namespace beltgrip::test
