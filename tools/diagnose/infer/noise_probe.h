// The noise of one grid sample, by samples beside it.
#pragma once

#include <Eigen/Core>
#include <cmath>

#include "tools/diagnose/infer/residuals.h"

namespace beltgrip::diagnose {

// Of noise alone, with its sigma: a fourth difference. Of a motion that swings with 0.4 Hz a
// hundredth is left, where a second difference over as long takes all of it for noise.
struct NoiseProbe {
  int lag;             // samples
  double correlation;  // of two that lie so far apart: they share samples of the local fit

  constexpr int reach() const { return 2 * lag; }
  double at(const Eigen::ArrayXd& y, int k) const {
    const double fourth =
        y[k - 2 * lag] - 4.0 * y[k - lag] + 6.0 * y[k] - 4.0 * y[k + lag] + y[k + 2 * lag];
    // Gaussian weights: at twice the distance the fourth power.
    return fourth / std::sqrt(70.0 - 112.0 * correlation + 56.0 * std::pow(correlation, 4.0));
  }
  // The mean of what a variance is at each of these samples, as the difference counts them.
  double mean_at(const Eigen::ArrayXd& variance, int k) const {
    return (variance[k - 2 * lag] + 16.0 * variance[k - lag] + 36.0 * variance[k] +
            16.0 * variance[k + lag] + variance[k + 2 * lag]) /
           70.0;
  }
};
inline constexpr NoiseProbe kFastProbe{2, 0.13};             // 0.2 s, weights of 0.07 s
inline constexpr NoiseProbe kSlowProbe{kBalanceStep, 0.37};  // 0.5 s, weights of 0.25 s

}  // namespace beltgrip::diagnose
