// What is done to whole columns of samples, in lanes: by the widest registers there are. The order
// of the sums is the same by any: the same bits.
#pragma once

#include <Eigen/Core>

namespace beltgrip::diagnose {

using Columns = Eigen::Ref<const Eigen::MatrixXd, 0, Eigen::OuterStride<>>;

// Of every column of a with every one of b: the sum of their products over the rows.
Eigen::MatrixXd products(const Columns& a, const Columns& b);
Eigen::MatrixXd products(const Columns& a);
// The same by registers that any processor has.
Eigen::MatrixXd products_in_pairs(const Columns& a, const Columns& b);

inline constexpr int kFilterOrder = 6;
struct PredictionFilter {
  const double* coefficient;  // kFilterOrder
  double sigma;
};
// out[i]: the error of in[i] predicted from the kFilterOrder before it, in units of sigma,
// weighted.
void predict(const PredictionFilter& filter, const double* in, const double* weight,
             Eigen::Index count, double* out);

}  // namespace beltgrip::diagnose
