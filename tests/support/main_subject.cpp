// The tests that main_test.cpp starts one by one to see what their program makes of them.
#include <stdexcept>

namespace {

TEST(Subject, Holds) { EXPECT_EQ(1 + 1, 2); }
TEST(Subject, Throws) { EXPECT_THROW(throw std::runtime_error("x"), std::runtime_error); }
TEST(Subject, Fails) { EXPECT_EQ(1 + 1, 3); }
TEST(Subject, AssertsNothing) {}
TEST(Subject, IsSkipped) { GTEST_SKIP() << "nothing to do here"; }

}  // namespace
