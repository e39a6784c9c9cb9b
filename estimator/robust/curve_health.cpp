#include "estimator/robust/curve_health.h"

#include <algorithm>
#include <cmath>

#include "estimator/robust/thresholds.h"
#include "estimator/signal/slow_noise.h"
#include "estimator/statistics/square.h"

namespace beltgrip::estimator {
namespace {

constexpr double kLeastShare = 0.1;  // of the chord, on either side
constexpr double kLeastGap_percent = 0.02;
constexpr std::size_t kFewest = 12;  // residuals

struct Group {  // means
  double slip_percent, mu, force_N;
  double variance, slip_variance_percent2;
  double t_s, duration_s;
};

Group group(const CurveSums& begin, const CurveSums& end, double slip_noise_percent2_s) {
  const double weight = end.weight - begin.weight;
  const double duration_s = end.duration_s - begin.duration_s;
  return {.slip_percent = (end.slip_percent - begin.slip_percent) / weight,
          .mu = (end.mu - begin.mu) / weight,
          .force_N = (end.force_N - begin.force_N) / weight,
          .variance = 1.0 / weight,
          .slip_variance_percent2 = slip_noise_percent2_s / duration_s,
          .t_s = (end.t_s - begin.t_s) / duration_s,
          .duration_s = duration_s};
}

// Variance of the slow error, of variance 1, in b less the chord of a and c at this share.
double slow_in_lack(const Group& a, const Group& b, const Group& c, double share) {
  const double spread = square(1.0 - share) * slow_variance_of_mean(a.duration_s) +
                        slow_variance_of_mean(b.duration_s) +
                        square(share) * slow_variance_of_mean(c.duration_s);
  const auto shared = [](const Group& early, const Group& late) {
    return slow_covariance_of_means(early.duration_s, late.duration_s, late.t_s - early.t_s);
  };
  return spread + 2.0 * share * (1.0 - share) * shared(a, c) - 2.0 * (1.0 - share) * shared(a, b) -
         2.0 * share * shared(b, c);
}

double below(const Group& a, const Group& b, const Group& c, double slow_relative, double largest) {
  const double span = c.slip_percent - a.slip_percent;
  if (!(span > kLeastGap_percent)) return 0.0;
  const double share = (b.slip_percent - a.slip_percent) / span;
  if (share < kLeastShare || share > 1.0 - kLeastShare) return 0.0;
  const auto combined = [share](double at_a, double at_b, double at_c) {
    return square(1.0 - share) * at_a + square(share) * at_c + at_b;
  };
  const double lacks = (1.0 - share) * a.mu + share * c.mu - b.mu;
  const double slope = (c.mu - a.mu) / span;
  const double force = b.force_N - (1.0 - share) * a.force_N - share * c.force_N;
  double variance = combined(a.variance, b.variance, c.variance) + square(kChordTolerance * b.mu) +
                    square(slope) * (combined(a.slip_variance_percent2, b.slip_variance_percent2,
                                              c.slip_variance_percent2) +
                                     square(kDeformation_percent_per_N * force));
  if (!(lacks > largest * std::sqrt(variance))) return 0.0;
  variance += slow_relative * square(b.mu) * slow_in_lack(a, b, c, share);
  return lacks / std::sqrt(variance);
}

}  // namespace

double below_chord(std::span<const CurveSums> sums, std::size_t length,
                   const SharedErrors& errors) noexcept {
  double largest = 0.0;
  const std::size_t step = std::max<std::size_t>(1, length / 2);
  for (std::size_t i = 0; i + 3 * length < sums.size(); i += step) {
    const CurveSums& first = sums[i];
    const CurveSums& second = sums[i + length];
    const CurveSums& third = sums[i + 2 * length];
    const CurveSums& last = sums[i + 3 * length];
    const Group a = group(first, second, errors.slip_noise_percent2_s);
    const Group b = group(second, third, errors.slip_noise_percent2_s);
    const Group c = group(third, last, errors.slip_noise_percent2_s);
    largest = std::max(largest, below(a, b, c, errors.slow_relative, largest));
  }
  return largest;
}

void whiten(std::span<Residual> residuals) noexcept {
  double slow = 0.0, spread = 1.0;  // its variance, in that of the slow error
  double last_s = residuals.empty() ? 0.0 : residuals.front().t_s;
  for (Residual& each : residuals) {
    const double faded = std::exp(-std::max(0.0, each.t_s - last_s) / kSlowTime_s);
    last_s = each.t_s;
    slow *= faded;
    spread = 1.0 - square(faded) * (1.0 - spread);
    const double variance = each.variance + each.slow_variance * spread;
    const double innovation = each.value - slow;
    const double gain = each.slow_variance * spread / variance;
    slow += gain * innovation;
    spread *= 1.0 - gain;
    each.value = innovation / std::sqrt(variance);
  }
}

ResidualTests test_residuals(std::span<const Residual> residuals) noexcept {
  ResidualTests out;
  if (residuals.size() < kFewest) return out;
  for (std::size_t length = 2; length <= residuals.size() / 2; length *= 2) {
    double sum = 0.0;
    for (std::size_t i = 0; i < residuals.size(); ++i) {
      sum += residuals[i].value;
      if (i >= length) sum -= residuals[i - length].value;
      if (i + 1 >= length) {
        out.innovation =
            std::max(out.innovation, std::abs(sum) / std::sqrt(static_cast<double>(length)));
      }
    }
  }
  // Wald and Wolfowitz.
  double above = 0.0, runs = 1.0;
  for (std::size_t i = 0; i < residuals.size(); ++i) {
    above += residuals[i].value > 0.0 ? 1.0 : 0.0;
    if (i > 0 && (residuals[i].value > 0.0) != (residuals[i - 1].value > 0.0)) runs += 1.0;
  }
  const double n = static_cast<double>(residuals.size());
  const double pairs = 2.0 * above * (n - above);
  const double expected = pairs / n + 1.0;
  const double variance = pairs * (pairs - n) / (n * n * (n - 1.0));
  if (variance > 0.0) out.runs = (expected - runs) / std::sqrt(variance);
  return out;
}

}  // namespace beltgrip::estimator
