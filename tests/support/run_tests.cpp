#include "tests/support/run_tests.h"

#include <cstdio>

#include "tests/support/assertions.h"

namespace beltgrip::test {
namespace {

constexpr int kSkipped = 77;  // as automake has it; tests/CMakeLists.txt tells ctest

class AssertsSomething : public testing::EmptyTestEventListener {
  void OnTestStart(const testing::TestInfo& /*test*/) override { before_ = assertions_begun; }
  void OnTestEnd(const testing::TestInfo& test) override {
    if (test.result()->Passed() && assertions_begun == before_) {
      ADD_FAILURE() << test.test_suite_name() << '.' << test.name() << " asserts nothing";
    }
  }
  long before_ = 0;
};

}  // namespace

int run_tests() {
  testing::UnitTest& tests = *testing::UnitTest::GetInstance();
  tests.listeners().Append(new AssertsSomething);  // GoogleTest deletes it
  if (RUN_ALL_TESTS() != 0) return 1;
  if (GTEST_FLAG_GET(list_tests)) return 0;
  if (tests.test_to_run_count() == 0) {
    std::fputs("no test was run\n", stderr);
    return 1;
  }
  return tests.skipped_test_count() > 0 ? kSkipped : 0;
}

}  // namespace beltgrip::test
