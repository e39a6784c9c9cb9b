#include "estimator/robust/end_slope.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "estimator/robust/thresholds.h"
#include "estimator/signal/slow_noise.h"
#include "estimator/statistics/square.h"

namespace beltgrip::estimator {
namespace {

constexpr int kFewest = 4;  // points in the line

}  // namespace

void EndSlope::begin(double last_slip_percent, double slow_variance, const Line& torque_line,
                     const Line& force_line) noexcept {
  *this = {};
  last_slip_percent_ = last_slip_percent;
  length_percent_ = std::max(kEndLeast_percent, kEndShare * last_slip_percent);
  slow_variance_ = slow_variance;
  torque_line_ = torque_line;
  force_line_ = force_line;
}

Eigen::Vector3d EndSlope::terms(double slip_percent) const noexcept {
  const double x = slip_percent - last_slip_percent_;
  return {1.0, x, square(std::max(0.0, -x - length_percent_))};
}

void EndSlope::collect(const EndPoint& point) noexcept {
  const Eigen::Vector3d f = terms(point.slip_percent);
  normal_ += point.weight * f * f.transpose();
  right_ += point.weight * point.mu * f;
  if (!(f(2) > 0.0)) ++in_line_;
}

void EndSlope::solve() noexcept {
  // No point before the line: no parabola.
  if (!(normal_(2, 2) > 0.0)) normal_(2, 2) = 1.0;
  const Eigen::LDLT<Eigen::Matrix3d> factors(normal_);
  if (in_line_ < kFewest || factors.info() != Eigen::Success || !factors.isPositive()) return;
  slope_ = factors.solve(right_)(1);
  row_ = factors.solve(Eigen::Vector3d::UnitY());
  valid_ = std::isfinite(slope_) && row_(1) > 0.0;
}

void EndSlope::spread(const EndPoint& point) noexcept {
  const double g = point.weight * row_.dot(terms(point.slip_percent));
  own_ += square(g) * point.own_variance;
  const double edge = g * point.speed_gain;
  own_ += edge_variance_ > 0.0 ? square(edge - edge_) * edge_variance_
                               : square(edge) * point.begin_speed_variance;
  edge_ = edge;
  edge_variance_ = point.end_speed_variance;
  const double slow = g * point.mu_per_Nm * point.slow_share;
  shared_ *= std::exp(-std::max(0.0, point.t_s - last_s_) / kSlowTime_s);
  slow_ += square(slow) + 2.0 * slow * shared_;
  shared_ += slow;
  last_s_ = point.t_s;
  const double held = g * point.mu_per_Nm * (1.0 - point.slow_share);
  torque_error_.value += held;
  torque_error_.slope += held * (point.t_s - torque_line_.t_s);
  if (point.t_s < force_line_.begin_s) return;
  const double force = g * point.mu / force_line_.at(point.t_s);
  force_error_.value += force;
  force_error_.slope += force * (point.t_s - force_line_.t_s);
}

double EndSlope::LineError::variance(const Line& line) const noexcept {
  return square(value) * line.value_variance + square(slope) * line.slope_variance;
}

double EndSlope::variance() const noexcept {
  return own_ + square(edge_) * edge_variance_ + slow_variance_ * slow_ +
         torque_error_.variance(torque_line_) + force_error_.variance(force_line_);
}

}  // namespace beltgrip::estimator
