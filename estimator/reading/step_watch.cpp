#include "estimator/reading/step_watch.h"

#include <algorithm>
#include <cmath>

#include "estimator/signal/slow_noise.h"

namespace beltgrip::estimator {
namespace {

constexpr double kCell_s = 0.05;
constexpr std::size_t kGapCells = 2;
constexpr std::size_t kShortest = 4, kLongest = 128;  // cells on either side
// A trace has some 500 places and lengths where a step may be seen: by chance in one of 300. The
// scatter itself is read off a number of squares, and neighbouring ones share half of what they
// say: Student's quantile is (z^2 + 1) / 4 nu larger than the normal one.
constexpr double kDeviations = 4.5;
constexpr double kStudent = 2.0 * (kDeviations * kDeviations + 1.0) / 4.0;
constexpr double kFewestSquares = 6.0;
// Chosen: well below the time constant of the slow error, by which longer means scatter too.
constexpr double kWhite_s = 0.2;
constexpr double kShare = 0.03;              // of the value
constexpr double kQuietSlip_percent = 0.15;  // slip that moves by less carries no other torque,
constexpr double kFaster = 3.0;  // unless it grows faster by so many deviations: some inertia is
                                 // being sped up by what the belt no longer carries

}  // namespace

StepWatch::StepWatch(double sample_rate_hz)
    : per_cell_(static_cast<int>(std::max(1.0, std::ceil(kCell_s * sample_rate_hz - 1e-6)))) {}

void StepWatch::reset() noexcept {
  count_ = 0;
  filled_ = 0;
  sum_ = {};
  sums_[0] = {};
}

StepWatch::Means StepWatch::means(std::size_t from, std::size_t to) const noexcept {
  const Means& late = sums_[(count_ - from) % kCells];
  const Means& early = sums_[(count_ - to) % kCells];
  const double share = 1.0 / static_cast<double>(to - from);
  return {share * (late.value - early.value), share * (late.slip_percent - early.slip_percent)};
}

bool StepWatch::step(double value, double slip_percent, double slip_noise_percent2_s,
                     const Trend& trend, double slow_variance) noexcept {
  sum_.value += value / per_cell_;
  sum_.slip_percent += slip_percent / per_cell_;
  if (++filled_ < per_cell_) return false;
  const Means& before_now = sums_[count_ % kCells];
  ++count_;
  sums_[count_ % kCells] = {before_now.value + sum_.value,
                            before_now.slip_percent + sum_.slip_percent};
  filled_ = 0;
  sum_ = {};
  const double squares = trend.squares(kCell_s * kShortest);
  const double deviations = kDeviations * (1.0 + kStudent / squares);
  for (std::size_t cells = kShortest; cells <= kLongest; cells *= 2) {
    const std::size_t apart = cells + kGapCells;
    const double length_s = kCell_s * static_cast<double>(cells);
    if (count_ < 2 * apart + cells || trend.squares(length_s) < kFewestSquares) break;
    const Means after = means(0, cells);
    const Means before = means(apart, apart + cells);
    const Means earlier = means(2 * apart, 2 * apart + cells);
    if (std::abs(after.slip_percent - before.slip_percent) > kQuietSlip_percent) continue;
    // What has been drifting already may go on doing so.
    const double drift = before.value - earlier.value;
    const double expected = before.value + std::clamp(after.value - before.value,
                                                      std::min(drift, 0.0), std::max(drift, 0.0));
    const double change = after.value - expected;
    const double faster =
        (after.slip_percent - before.slip_percent) - (before.slip_percent - earlier.slip_percent);
    if (change * before.value < 0.0 &&
        faster > kFaster * std::sqrt(6.0 * slip_noise_percent2_s / length_s)) {
      continue;
    }
    if (!(std::abs(change) > kShare * std::abs(before.value))) continue;
    const double apart_s = kCell_s * static_cast<double>(apart);
    const double variance = std::max(2.0 * trend.density(length_s) / length_s,
                                     2.0 * trend.density(kWhite_s) / length_s +
                                         slow_variance * slow_variance_of_step(length_s, apart_s));
    if (std::abs(change) > deviations * std::sqrt(variance)) return true;
  }
  return false;
}

}  // namespace beltgrip::estimator
