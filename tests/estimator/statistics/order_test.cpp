#include "estimator/statistics/order.h"

#include <gtest/gtest.h>

#include <vector>

namespace beltgrip::estimator {
namespace {

TEST(Order, RanksAndMedian) {
  std::vector<double> values{5.0, 1.0, 4.0, 2.0, 3.0};
  EXPECT_EQ(median(values), 3.0);
  EXPECT_EQ(at_rank(values, 0), 1.0);
  EXPECT_EQ(at_rank(values, 4), 5.0);
  std::vector<double> even{2.0, 1.0};
  EXPECT_EQ(median(even), 2.0);
  std::vector<double> one{7.0};
  EXPECT_EQ(median(one), 7.0);
}

}  // namespace
}  // namespace beltgrip::estimator
