#include "estimator/statistics/distributions.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <unsupported/Eigen/SpecialFunctions>

namespace beltgrip::estimator {

double student_cdf(double x, double degrees) {
  const double tail = 0.5 * student_p(x, degrees);
  return x > 0.0 ? 1.0 - tail : tail;
}

double student_p(double t, double degrees) {
  return Eigen::numext::betainc(0.5 * degrees, 0.5, degrees / (degrees + t * t));
}

double student_quantile(double probability, double degrees) {
  double low = -1.0;
  double high = 1.0;
  while (student_cdf(low, degrees) > probability) low *= 2.0;
  while (student_cdf(high, degrees) < probability) high *= 2.0;
  constexpr int kHalvings = 80;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (low + high);
    (student_cdf(middle, degrees) < probability ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

double f_p(double f, double numerator_degrees, double denominator_degrees) {
  return Eigen::numext::betainc(
      0.5 * denominator_degrees, 0.5 * numerator_degrees,
      denominator_degrees / (denominator_degrees + numerator_degrees * f));
}

double chi2_p(double chi2, int degrees) {
  if (degrees <= 0 || !(chi2 > 0.0)) return 1.0;
  return Eigen::numext::igammac(0.5 * degrees, 0.5 * chi2);
}

double chi2_decades(double chi2, int degrees) {
  // Derived: a double loses digits below 1e-308, and from 1e-100 on what the series leaves out is
  // less than 1e-5 of it, so that any number between gives the same.
  constexpr double kRight = 1e-250;
  if (const double p = chi2_p(chi2, degrees); p > kRight) return std::max(0.0, -std::log10(p));
  // The first terms of the incomplete gamma function far out (DLMF 8.11.2).
  const double a = 0.5 * degrees, x = 0.5 * chi2;
  const double series = 1.0 + (a - 1.0) / x * (1.0 + (a - 2.0) / x);
  return (x - (a - 1.0) * std::log(x) + std::lgamma(a) - std::log(series)) / std::numbers::ln10;
}

}  // namespace beltgrip::estimator
