// Slope of the friction curve at the end of the data, with an uncertainty that knows which errors
// neighbouring points share. Slip in percent. Real-time thread; sums only.
//
// A straight line over the last stretch of slip, a parabola before it:
//   mu(s) = a + k x + q max(0, -x - length)^2,   x = s - last slip,
// by weighted least squares. The slope is then a weighted sum of the points, and the errors go
// through these weights: a point's own; those of the speeds at the boundaries of two points, which
// enter both with opposite signs; the slow error of the torque; those of the lines of torque and
// force. So the points are gone through twice.
#pragma once

#include <Eigen/Core>

#include "estimator/signal/trend.h"

namespace beltgrip::estimator {

struct EndPoint {  // means over a stretch of time
  double t_s, slip_percent, mu;
  double weight;        // 1 / variance of mu
  double own_variance;  // of mu, shared with no other point
  double mu_per_Nm;
  double slow_share;  // of the torque's slow error that is in this point
  double speed_gain;  // of mu, by an error of the speed at its ends
  double begin_speed_variance, end_speed_variance;
};

class EndSlope {
 public:
  // slow_variance: of the torque; torque_line: in the rest of the points' torque.
  void begin(double last_slip_percent, double slow_variance, const Line& torque_line,
             const Line& force_line) noexcept;
  // All points, oldest first; then solve, then the same points once more.
  void collect(const EndPoint& point) noexcept;
  void solve() noexcept;
  void spread(const EndPoint& point) noexcept;

  bool valid() const noexcept { return valid_; }
  double slope() const noexcept { return slope_; }  // 1/percent
  double variance() const noexcept;

 private:
  struct LineError {  // weighted sums of a line's errors: of its value, of its slope
    double value = 0.0, slope = 0.0;
    double variance(const Line& line) const noexcept;
  };
  Eigen::Vector3d terms(double slip_percent) const noexcept;

  double last_slip_percent_ = 0.0, length_percent_ = 0.0;
  double slow_variance_ = 0.0;
  Line torque_line_, force_line_;
  Eigen::Matrix3d normal_ = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d row_ = Eigen::Vector3d::Zero();  // of the inverse, for the slope
  int in_line_ = 0;                                // points
  bool valid_ = false;
  double slope_ = 0.0;
  double own_ = 0.0;
  double slow_ = 0.0, shared_ = 0.0, last_s_ = 0.0;
  double edge_ = 0.0, edge_variance_ = 0.0;  // of the last point, at its end
  LineError torque_error_, force_error_;
};

}  // namespace beltgrip::estimator
