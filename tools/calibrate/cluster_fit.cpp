#include "tools/calibrate/cluster_fit.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "estimator/statistics/distributions.h"
#include "estimator/statistics/interval.h"

namespace beltgrip::calibrate {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

void Observations::add(double value, const VectorXd& regressors, int of) {
  y.push_back(value);
  x.push_back(regressors);
  cluster.push_back(of);
}

ClusterFit fit(const Observations& data, const VectorXd& prior_mean, const VectorXd& prior_std,
               const MatrixXd& noise) {
  ClusterFit result;
  const Index size = prior_mean.size();
  const auto n = static_cast<double>(data.size());
  if (n < static_cast<double>(size) + 2.0) return result;
  MatrixXd xx = MatrixXd::Zero(size, size);
  VectorXd xy = VectorXd::Zero(size);
  for (std::size_t i = 0; i < data.size(); ++i) {
    xx += data.x[i] * data.x[i].transpose();
    xy += data.x[i] * data.y[i];
  }
  if (noise.size() > 0) xx -= noise;
  MatrixXd precision = MatrixXd::Zero(size, size);
  for (Index i = 0; i < size; ++i) {
    if (std::isfinite(prior_std[i])) precision(i, i) = 1.0 / (prior_std[i] * prior_std[i]);
  }
  // The weight of the priors follows from the scatter, which follows from the fit.
  double variance = 1e-6;
  MatrixXd inverse;
  constexpr int kRounds = 4;
  for (int round = 0; round < kRounds; ++round) {
    const Eigen::FullPivLU<MatrixXd> solver(xx / variance + precision);
    if (!solver.isInvertible()) return result;
    inverse = solver.inverse();
    result.value = inverse * (xy / variance + precision * prior_mean);
    result.residual.resize(data.size());
    double squares = 0.0;
    for (std::size_t i = 0; i < data.size(); ++i) {
      result.residual[i] = data.y[i] - data.x[i].dot(result.value);
      squares += result.residual[i] * result.residual[i];
    }
    variance = std::max(squares / (n - static_cast<double>(size)), 1e-18);
  }
  if (!result.value.allFinite()) return result;
  result.residual_std = std::sqrt(variance);
  MatrixXd meat = MatrixXd::Zero(size, size);
  for (std::size_t begin = 0; begin < data.size();) {
    VectorXd score = VectorXd::Zero(size);
    std::size_t end = begin;
    for (; end < data.size() && data.cluster[end] == data.cluster[begin]; ++end) {
      score += data.x[end] * (result.residual[end] / variance);
    }
    meat += score * score.transpose();
    ++result.clusters;
    begin = end;
  }
  if (result.clusters < 2) return result;
  const double clusters = result.clusters;
  const VectorXd clustered =
      (inverse * (meat * clusters / (clusters - 1.0) + precision) * inverse).diagonal();
  const VectorXd plain = inverse.diagonal();
  const double few =
      estimator::student_quantile(estimator::kUpper95, clusters - 1.0) / estimator::kNormal95;
  result.std = few * clustered.cwiseMax(plain).cwiseMax(0.0).cwiseSqrt();
  result.solved = true;
  return result;
}

}  // namespace beltgrip::calibrate
