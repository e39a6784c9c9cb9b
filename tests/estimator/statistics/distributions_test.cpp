// Against the printed tables.
#include "estimator/statistics/distributions.h"

#include <gtest/gtest.h>

#include <cmath>
#include <tuple>

namespace beltgrip::estimator {
namespace {

// t for 97.5 % and 99 %.
TEST(Student, AsInTheTables) {
  for (const auto& [degrees, t975, t99] : {std::tuple{1.0, 12.706, 31.821},
                                           {4.0, 2.776, 3.747},
                                           {8.0, 2.306, 2.896},
                                           {30.0, 2.042, 2.457},
                                           {1e6, 1.960, 2.326}}) {
    EXPECT_NEAR(student_quantile(0.975, degrees), t975, 1e-3 * t975) << degrees;
    EXPECT_NEAR(student_cdf(t99, degrees), 0.99, 2e-5) << degrees;
    EXPECT_NEAR(student_cdf(-t99, degrees), 0.01, 2e-5) << degrees;
    EXPECT_NEAR(student_p(-t99, degrees), 0.02, 4e-5) << degrees;
  }
  EXPECT_EQ(student_cdf(0.0, 3.0), 0.5);
}

// With one degree t is Cauchy's, whose tail has a closed form down to the smallest numbers.
TEST(Student, KeepsItsFarTail) {
  for (const double t : {1e3, 1e8, 1e100}) {
    EXPECT_NEAR(student_p(t, 1.0) / (2.0 / (M_PI * t)), 1.0, 1e-6) << t;
  }
}

// F for 95 %.
TEST(F, AsInTheTables) {
  for (const auto& [numerator, denominator, f] :
       {std::tuple{1.0, 5.0, 6.608}, {3.0, 10.0, 3.708}, {10.0, 20.0, 2.348}}) {
    EXPECT_NEAR(f_p(f, numerator, denominator), 0.05, 2e-5) << numerator;
  }
}

TEST(ChiSquare, AsInTheTables) {
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

TEST(ChiSquare, DecadesGoOnWhereTheProbabilityIsTooSmallForANumber) {
  EXPECT_NEAR(chi2_decades(18.307038, 10), -std::log10(0.05), 1e-5);
  EXPECT_EQ(chi2_decades(0.0, 4), 0.0);
  // With two degrees of freedom it is exp(-chi2 / 2).
  for (const double chi2 : {100.0, 1000.0, 1300.0, 2000.0, 40000.0}) {
    EXPECT_NEAR(chi2_decades(chi2, 2), 0.5 * chi2 / std::log(10.0), 1e-9 * chi2) << chi2;
  }
  // With four exp(-chi2 / 2) (1 + chi2 / 2).
  EXPECT_NEAR(chi2_decades(3000.0, 4), (1500.0 - std::log(1501.0)) / std::log(10.0), 1e-6);
  EXPECT_GT(chi2_decades(1151.0, 10), chi2_decades(1150.0, 10));
}

}  // namespace
}  // namespace beltgrip::estimator
