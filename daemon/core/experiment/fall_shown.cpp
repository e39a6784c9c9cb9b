#include "daemon/core/experiment/fall_shown.h"
#include "estimator/physics/units.h"

#include <algorithm>
#include <cmath>

namespace beltgrip::daemon {

namespace {

using estimator::kPercent;
constexpr double kDeviations95 = 2.0;  // 95 % of a normal distribution
// Derived: of points that lie on a line evenly, a tenth of a point of slip, spread 0.1 / sqrt(12).
constexpr double kSpreadLeast_percent = 0.03;
constexpr std::size_t kPointsLeast = 10;  // chosen: fewer tell little of their own noise
// Measured: 45 slopes of one belt, in a drive of half an hour with the sensors of coast-overdrive,
// scatter by 4.1 times what their points' own scatter says: pressure and torque err for longer than
// a sample.
constexpr double kSlowNoise = 4.0;
// Chosen: a belt does not fall more steeply than it did by more than half; what it is taken for at
// the least, per unit of slip.
constexpr double kMargin = 1.5, kLeast = 0.4;
// Chosen: however still the points, the peak's place is known no better. Per unit of slip.
constexpr double kDeviationLeast = 0.05;

}  // namespace

void FallShown::add(double fall, double variance) noexcept {
  weight_ += 1.0 / variance;
  weighted_ += fall / variance;
}

FallRange FallShown::range() const noexcept {
  if (!(weight_ > 0.0)) return {};
  const double mean = weighted_ / weight_;
  const double wide = kDeviations95 / std::sqrt(weight_);
  return {std::max(0.0, mean - wide), std::max(kLeast, kMargin * std::max(0.0, mean) + wide)};
}

void LastPoints::add(double slip_percent, double mu_star) noexcept {
  points_[next_] = {slip_percent, mu_star};
  next_ = (next_ + 1) % kPoints;
  count_ = std::min(count_ + 1, kPoints);
}

void LastPoints::show(double peak_slip_percent, FallShown& to) const noexcept {
  double n = 0.0, x = 0.0, y = 0.0, xx = 0.0, xy = 0.0, yy = 0.0;
  for (std::size_t i = 0; i < count_; ++i) {
    const Point& each = points_[i];
    const double beyond_share = (each.slip_percent - peak_slip_percent) / kPercent;
    if (!(beyond_share > 0.0)) continue;
    n += 1.0;
    x += beyond_share;
    y += each.mu_star;
    xx += beyond_share * beyond_share;
    xy += beyond_share * each.mu_star;
    yy += each.mu_star * each.mu_star;
  }
  if (n < static_cast<double>(kPointsLeast)) return;
  const double sxx = xx - x * x / n, sxy = xy - x * y / n, syy = yy - y * y / n;
  if (sxx < n * std::pow(kSpreadLeast_percent / kPercent, 2)) return;
  const double slope = sxy / sxx;
  const double noise = std::max(0.0, syy - slope * sxy) / (n - 2.0);
  to.add(-slope,
         std::max(kSlowNoise * kSlowNoise * noise / sxx, kDeviationLeast * kDeviationLeast));
}

}  // namespace beltgrip::daemon
