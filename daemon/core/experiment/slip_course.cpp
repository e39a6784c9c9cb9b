#include "daemon/core/experiment/slip_course.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace beltgrip::daemon {

namespace {
// Chosen: three periods at 200 Hz. A fifth less or more: not run.
constexpr Duration kRecent = 15 * kMillisecond;
constexpr double kWhole = 0.8;          // of kRateOver: a rate is known
constexpr double kSquares = 100.0;      // half a second at 200 Hz
constexpr double kSquaresLeast = 20.0;  // before these a deviation is not known
}  // namespace

void SlipCourse::begin(double ratio, double torque_Nm) noexcept {
  start_ratio_ = ratio;
  direction_ = -std::copysign(1.0, torque_Nm);
  count_ = 0;
  slip_share_ = slip_max_share_ = rate_1_s_ = square_ = squares_ = 0.0;
}

double SlipCourse::slip_share_at(double ratio) const noexcept {
  return direction_ * (ratio / start_ratio_ - 1.0);
}

void SlipCourse::step(MonoTime t, double ratio) noexcept {
  Point& newest = points_[count_++ % kPoints];
  newest = {t, slip_share_at(ratio), 0.0};
  double recent = 0.0, recent_n = 0.0, oldest_s = 0.0;
  double n = 0.0, sum_t = 0.0, sum_x = 0.0, sum_tt = 0.0, sum_tx = 0.0;
  const std::size_t points = std::min(count_, kPoints);
  std::size_t age = 0;
  for (; age < points; ++age) {
    const Point& each = point(age);
    const Duration before = t - each.t;
    if (before > kRateOver) break;
    const double at_s = -seconds(before);
    const double slip_share = each.slip_share;
    oldest_s = at_s;
    n += 1.0;
    sum_t += at_s;
    sum_x += slip_share;
    sum_tt += at_s * at_s;
    sum_tx += at_s * slip_share;
    if (before > kRecent) continue;
    recent += slip_share;
    recent_n += 1.0;
  }
  slip_share_ = recent / recent_n;
  slip_max_share_ = std::max(slip_max_share_, slip_share_);
  const bool whole = -oldest_s > kWhole * seconds(kRateOver);
  rate_1_s_ = whole ? (n * sum_tx - sum_t * sum_x) / (n * sum_tt - sum_t * sum_t) : 0.0;
  newest.rate_1_s = rate_1_s_;
  // The rate of the window before: noise apart, slip hardly changes its rate from one to the next.
  if (whole && age < points) count_noise(point(age).rate_1_s);
}

void SlipCourse::count_noise(double rate_before_1_s) noexcept {
  if (rate_before_1_s == 0.0) return;
  const double change = rate_1_s_ - rate_before_1_s;
  squares_ = std::min(squares_ + 1.0, kSquares);
  square_ += (change * change - square_) / squares_;
}

double SlipCourse::rate_deviation_1_s() const noexcept {
  if (squares_ < kSquaresLeast) return std::numeric_limits<double>::infinity();
  return std::sqrt(0.5 * square_);
}

}  // namespace beltgrip::daemon
