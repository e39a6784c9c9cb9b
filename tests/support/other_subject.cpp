// The second source of the program that main_test.cpp starts.
namespace {

TEST(OtherSubject, Holds) { EXPECT_EQ(2 + 2, 4); }
TEST(OtherSubject, FailsToo) { EXPECT_EQ(2 + 2, 5); }

}  // namespace
