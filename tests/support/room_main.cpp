// The main of a room's program. Called by the name of one of its sources (e2e_test, a link beside
// it) it runs the cases of that source alone; by its own name all of them.
#include <cstdio>
#include <filesystem>
#include <set>
#include <string>

#include "tests/support/assertions.h"
#include "tests/support/run_tests.h"

namespace beltgrip::test {
namespace {

template <typename Visit>
void for_each_test(Visit visit) {
  const testing::UnitTest& tests = *testing::UnitTest::GetInstance();
  for (int i = 0; i < tests.total_test_suite_count(); ++i) {
    const testing::TestSuite& suite = *tests.GetTestSuite(i);
    for (int k = 0; k < suite.total_test_count(); ++k) visit(*suite.GetTestInfo(k));
  }
}

std::string full_name(const testing::TestInfo& test) {
  return std::string(test.test_suite_name()) + '.' + test.name();
}

// Beside the filter that was given, the cases of other sources are left out. False where that
// cannot be: no source has that name, or a case of it bears the name of another source's.
bool leave_to(const std::string& source) {
  std::set<std::string> kept, others;
  for_each_test([&](const testing::TestInfo& test) {
    const bool here = std::filesystem::path(test.file()).stem() == source;
    (here ? kept : others).insert(full_name(test));
  });
  if (kept.empty()) return !source.ends_with("_test");  // the room's own name
  std::string filter = GTEST_FLAG_GET(filter);
  for (const std::string& name : others) {
    if (kept.contains(name)) return false;
    filter += (filter.find('-') == std::string::npos ? '-' : ':') + name;
  }
  GTEST_FLAG_SET(filter, filter);
  return true;
}

}  // namespace
}  // namespace beltgrip::test

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  const std::string name = std::filesystem::path(argv[0]).filename().string();
  if (!beltgrip::test::leave_to(name)) {
    std::fprintf(stderr, "%s: no source of that name here, or two with a case of one name\n",
                 name.c_str());
    return 1;
  }
  return beltgrip::test::run_tests();
}
