// One step of the Kalman filter for the line mu* = k sigma* + mu_0 with parameters that walk at
// random: equations (11) to (19). Free functions on fixed-size matrices; any thread.
#pragma once

#include <Eigen/Core>

namespace beltgrip::estimator {

struct LineFilter {
  Eigen::Vector2d x;  // k (1 / percent slip), mu_0
  Eigen::Matrix2d P;
};

// Equations (16) to (19). Equation (19) is written in its symmetric form (Joseph), which is equal
// to the paper's (I - K H) S for the gain of equation (17) and stays positive after rounding.
inline void kalman_step(LineFilter& filter, double slip_percent, double mu_star,
                        const Eigen::Vector2d& process_variance, double measurement_variance) {
  const Eigen::Vector2d H(slip_percent, 1.0);
  Eigen::Matrix2d S = filter.P;
  S.diagonal() += process_variance;
  const Eigen::Vector2d SH = S * H;
  const Eigen::Vector2d K = SH / (H.dot(SH) + measurement_variance);
  filter.x += K * (mu_star - H.dot(filter.x));
  const Eigen::Matrix2d I_KH = Eigen::Matrix2d::Identity() - K * H.transpose();
  const Eigen::Matrix2d P = I_KH * S * I_KH.transpose() + measurement_variance * K * K.transpose();
  filter.P = 0.5 * (P + P.transpose());
}

}  // namespace beltgrip::estimator
