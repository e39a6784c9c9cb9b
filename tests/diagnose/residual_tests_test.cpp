// What turns a test statistic into a p-value; the tests themselves: diagnose_program_test.
#include "tools/diagnose/residual_tests.h"

#include <gtest/gtest.h>

#include <cmath>

namespace beltgrip::diagnose {
namespace {

TEST(ChiSquare, TailsAreThoseOfTheTables) {
  EXPECT_NEAR(chi2_p(3.841459, 1), 0.05, 1e-6);
  EXPECT_NEAR(chi2_p(5.991465, 2), 0.05, 1e-6);
  EXPECT_NEAR(chi2_p(7.814728, 3), 0.05, 1e-6);
  EXPECT_NEAR(chi2_p(18.307038, 10), 0.05, 1e-6);
  EXPECT_NEAR(chi2_p(26.217, 12), 0.01, 1e-5);
  EXPECT_NEAR(chi2_p(2.0, 2), std::exp(-1.0), 1e-12);
  EXPECT_EQ(chi2_p(0.0, 4), 1.0);
  EXPECT_EQ(chi2_p(1.0, 0), 1.0);
  EXPECT_GT(chi2_p(400.0, 10), 0.0);
}

}  // namespace
}  // namespace beltgrip::diagnose
