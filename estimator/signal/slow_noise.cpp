#include "estimator/signal/slow_noise.h"

#include <algorithm>
#include <cmath>

#include "estimator/statistics/square.h"

namespace beltgrip::estimator {
namespace {

// Of means over times of this length, in kSlowTime_s, whose middles are `apart` lengths apart.
double covariance(double length, int apart) {
  return square(-std::expm1(-length) / length) * std::exp(-length * (apart - 1));
}

double variance(double length) { return 2.0 / length * (1.0 + std::expm1(-length) / length); }

// Below this the expressions above lose their digits, and a mean is as good as a value.
constexpr double kShortest = 1e-4;

}  // namespace

double slow_variance_of_mean(double length_s) noexcept {
  return variance(std::max(kShortest, length_s / kSlowTime_s));
}

double slow_covariance_of_means(double a_s, double b_s, double apart_s) noexcept {
  const auto mean = [](double length_s) {
    const double half = std::max(kShortest, 0.5 * length_s / kSlowTime_s);
    return std::sinh(half) / half;
  };
  return mean(a_s) * mean(b_s) * std::exp(-apart_s / kSlowTime_s);
}

double slow_variance_of_step(double length_s, double apart_s) noexcept {
  return 2.0 * (slow_variance_of_mean(length_s) -
                slow_covariance_of_means(length_s, length_s, std::max(apart_s, length_s)));
}

double slow_variance(std::span<const Scatter> scatter, double white_density) noexcept {
  double top = 0.0, bottom = 0.0;
  for (const Scatter& each : scatter) {
    if (!(each.count > 0.0) || !(each.variance > 0.0)) continue;
    const double length = each.length_s / kSlowTime_s;
    const double share =
        variance(length) - 4.0 / 3.0 * covariance(length, 1) + covariance(length, 2) / 3.0;
    // The mean of n squares scatters by its own size times sqrt(2 / n).
    const double weight = each.count / square(each.variance);
    top += weight * share * (each.variance - white_density / each.length_s);
    bottom += weight * square(share);
  }
  return bottom > 0.0 ? std::max(0.0, top / bottom) : 0.0;
}

}  // namespace beltgrip::estimator
