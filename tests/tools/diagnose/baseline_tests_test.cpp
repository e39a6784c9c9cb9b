// Of many tests one has a small p by chance alone.
#include "tools/diagnose/data/baseline_tests.h"

#include <gtest/gtest.h>

#include <string>

namespace beltgrip::diagnose {
namespace {

std::map<std::string, BaselineSignal> signals(double least_p) {
  std::map<std::string, BaselineSignal> out;
  for (int i = 0; i < 13; ++i) {
    out["secondary_speed"].tests["test_" + std::to_string(i)] = 0.1 + 0.05 * i;
    out["secondary_torque"].tests["test_" + std::to_string(i)] = i == 4 ? least_p : 0.5;
  }
  return out;
}

TEST(BaselineTests, TheLeastOfManyIsJudgedAmongAllOfThem) {
  const BaselineTests all = baseline_tests(signals(7e-4));
  EXPECT_EQ(all.count, 26);
  EXPECT_EQ(all.signal, "secondary_torque");
  EXPECT_EQ(all.test, "test_4");
  EXPECT_NEAR(all.by_chance(all.least_p), 0.018, 0.0005);  // 1 - (1 - 7e-4)^26
  EXPECT_FALSE(all.fails(all.least_p));
  EXPECT_TRUE(baseline_tests(signals(1e-6)).fails(1e-6));
}

TEST(BaselineTests, NoTestFailsWhereThereIsNone) {
  const BaselineTests none = baseline_tests({});
  EXPECT_EQ(none.count, 0);
  EXPECT_EQ(none.by_chance(none.least_p), 1.0);
}

}  // namespace
}  // namespace beltgrip::diagnose
