// Work on columns in lanes is what a matrix library makes of it, and the same bits by any
// registers.
#include "tools/diagnose/infer/column_work.h"

#include <gtest/gtest.h>

#include <random>

#include "tools/diagnose/infer/remembered.h"

namespace beltgrip::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

class RandomDraw {
 public:
  MatrixXd matrix(Index rows, Index columns) {
    return MatrixXd::NullaryExpr(rows, columns, [&] { return normal_(random_); });
  }
  Index count(Index most) { return std::uniform_int_distribution<Index>(0, most)(random_); }

 private:
  std::mt19937_64 random_{7};
  std::normal_distribution<double> normal_;
};

TEST(ColumnWork, ProductsAreTheLibrarysAndTheSameBitsByAnyRegisters) {
  RandomDraw draw;
  for (int i = 0; i < 300; ++i) {
    const Index rows = draw.count(40);
    const MatrixXd whole = draw.matrix(rows, draw.count(14) + 1);
    const auto a = whole.leftCols(whole.cols() - 1);  // of a larger one
    const MatrixXd b = draw.matrix(rows, draw.count(9));
    const MatrixXd expected = a.transpose() * b;
    const MatrixXd found = products(a, b);
    EXPECT_LT((found - expected).cwiseAbs().sum(), 1e-11);
    EXPECT_EQ(found, products_in_pairs(a, b));
    EXPECT_EQ(products(a), products_in_pairs(a, a));
  }
}

TEST(ColumnWork, PredictsEachFromTheSixBefore) {
  RandomDraw draw;
  const MatrixXd in = draw.matrix(57, 1), weight = draw.matrix(57, 1), a = draw.matrix(6, 1);
  const PredictionFilter filter{a.data(), 0.7};
  MatrixXd out(51, 1);
  predict(filter, in.data() + kFilterOrder, weight.data(), out.rows(), out.data());
  for (Index i = 0; i < out.rows(); ++i) {
    double error = in(i + 6);
    for (Index lag = 1; lag <= 6; ++lag) error -= a(lag - 1) * in(i + 6 - lag);
    EXPECT_NEAR(out(i), error / 0.7 * weight(i), 1e-12);
  }
}

TEST(Remembered, AsksOnceAndForgetsTheOldest) {
  const Remembered<int> memory(2);
  int asked = 0;
  const auto ask = [&](double question) { return memory.of({question}, [&] { return ++asked; }); };
  EXPECT_EQ(ask(1.0), 1);
  EXPECT_EQ(ask(1.0), 1);
  EXPECT_EQ(ask(2.0), 2);
  const Remembered<int> copy = memory;
  EXPECT_EQ(copy.of({2.0}, [] { return -1; }), 2);
  EXPECT_EQ(ask(3.0), 3);
  EXPECT_EQ(ask(1.0), 4);
}

TEST(Remembered, AsksAnewWhereWhatItKnowsWillNotDo) {
  const Remembered<int> memory(4);
  const auto ask = [&](int answer, int least) {
    return memory.of(
        {1.0}, [&] { return answer; }, [&](int known) { return known >= least; });
  };
  EXPECT_EQ(ask(5, 0), 5);
  EXPECT_EQ(ask(9, 5), 5);
  EXPECT_EQ(ask(9, 6), 9);
  EXPECT_EQ(ask(7, 6), 9);
}

}  // namespace
}  // namespace beltgrip::diagnose
