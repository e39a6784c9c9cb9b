// Least squares over data that come in clusters (visits, events) whose errors hang together: the
// spread is taken from how far whole clusters lie off, not from single values. Tools only.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace beltgrip::calibrate {

struct Observations {
  std::vector<double> y;
  std::vector<Eigen::VectorXd> x;
  std::vector<int> cluster;  // 0, 1, ... in ascending order
  std::size_t size() const { return y.size(); }
  void add(double value, const Eigen::VectorXd& regressors, int of);
};

struct ClusterFit {
  bool solved = false;
  Eigen::VectorXd value;
  // So that value +- kNormal95 std is a 95 % interval also for few clusters.
  Eigen::VectorXd std;
  double residual_std = 0.0;
  int clusters = 0;
  std::vector<double> residual;
};

// prior: mean and standard deviation of each coefficient; a std that is not finite: none.
// noise: what the errors of the regressors add to sum x x^T, taken off again; may be empty.
ClusterFit fit(const Observations& data, const Eigen::VectorXd& prior_mean,
               const Eigen::VectorXd& prior_std, const Eigen::MatrixXd& noise = {});

}  // namespace beltgrip::calibrate
