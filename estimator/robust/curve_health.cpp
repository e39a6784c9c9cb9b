#include "estimator/robust/curve_health.h"

#include <algorithm>
#include <cmath>

#include "estimator/statistics/square.h"

namespace beltgrip::estimator {
namespace {

constexpr double kFormTolerance = 0.003;  // of mu: friction that is not quite a curve
constexpr double kLeastShare = 0.1;       // of the chord, on either side
constexpr double kLeastGap_percent = 0.02;
constexpr std::size_t kFewest = 12;  // residuals

struct Group {  // means
  double slip, mu, force_N;
  double variance, slip_variance;
};

Group group(const CurveSums& begin, const CurveSums& end, double slip_noise) {
  const double weight = end.weight - begin.weight;
  return {.slip = (end.slip - begin.slip) / weight,
          .mu = (end.mu - begin.mu) / weight,
          .force_N = (end.force_N - begin.force_N) / weight,
          .variance = 1.0 / weight,
          .slip_variance = slip_noise / (end.duration_s - begin.duration_s)};
}

double below(const Group& a, const Group& b, const Group& c) {
  const double span = c.slip - a.slip;
  if (!(span > kLeastGap_percent)) return 0.0;
  const double share = (b.slip - a.slip) / span;
  if (share < kLeastShare || share > 1.0 - kLeastShare) return 0.0;
  const auto combined = [share](double at_a, double at_b, double at_c) {
    return square(1.0 - share) * at_a + square(share) * at_c + at_b;
  };
  const double lacks = (1.0 - share) * a.mu + share * c.mu - b.mu;
  const double slope = (c.mu - a.mu) / span;
  const double force = b.force_N - (1.0 - share) * a.force_N - share * c.force_N;
  const double variance =
      combined(a.variance, b.variance, c.variance) + square(kFormTolerance * b.mu) +
      square(slope) * (combined(a.slip_variance, b.slip_variance, c.slip_variance) +
                       square(kDeformation_percent_per_N * force));
  return lacks / std::sqrt(variance);
}

}  // namespace

double below_chord(std::span<const CurveSums> sums, std::size_t length,
                   double slip_noise) noexcept {
  double largest = 0.0;
  const std::size_t step = std::max<std::size_t>(1, length / 2);
  for (std::size_t i = 0; i + 3 * length < sums.size(); i += step) {
    const CurveSums& first = sums[i];
    const CurveSums& second = sums[i + length];
    const CurveSums& third = sums[i + 2 * length];
    const CurveSums& last = sums[i + 3 * length];
    largest =
        std::max(largest, below(group(first, second, slip_noise), group(second, third, slip_noise),
                                group(third, last, slip_noise)));
  }
  return largest;
}

ResidualTests test_residuals(std::span<const double> residuals) noexcept {
  ResidualTests out;
  if (residuals.size() < kFewest) return out;
  for (std::size_t length = 2; length <= residuals.size() / 2; length *= 2) {
    double sum = 0.0;
    for (std::size_t i = 0; i < residuals.size(); ++i) {
      sum += residuals[i];
      if (i >= length) sum -= residuals[i - length];
      if (i + 1 >= length) {
        out.innovation =
            std::max(out.innovation, std::abs(sum) / std::sqrt(static_cast<double>(length)));
      }
    }
  }
  // Wald and Wolfowitz.
  double above = 0.0, runs = 1.0;
  for (std::size_t i = 0; i < residuals.size(); ++i) {
    above += residuals[i] > 0.0 ? 1.0 : 0.0;
    if (i > 0 && (residuals[i] > 0.0) != (residuals[i - 1] > 0.0)) runs += 1.0;
  }
  const double n = static_cast<double>(residuals.size());
  const double pairs = 2.0 * above * (n - above);
  const double expected = pairs / n + 1.0;
  const double variance = pairs * (pairs - n) / (n * n * (n - 1.0));
  if (variance > 0.0) out.runs = (expected - runs) / std::sqrt(variance);
  return out;
}

}  // namespace beltgrip::estimator
