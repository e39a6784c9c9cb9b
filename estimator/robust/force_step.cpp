#include "estimator/robust/force_step.h"

#include <algorithm>
#include <cmath>

#include "estimator/robust/thresholds.h"
#include "estimator/statistics/square.h"

namespace beltgrip::estimator {
namespace {

constexpr double kCell_s = 0.05;
constexpr std::size_t kGapCells = 2;
constexpr std::size_t kShortest = 2, kLongest = 64;  // cells in each of four groups
// The scatter is read off a number of squares that share half of what they say: Student's quantile
// is (z^2 + 1) / 4 nu larger than the normal one.
double student() noexcept { return 2.0 * (square(kInManyLooks) + 1.0) / 4.0; }
constexpr double kFewestSquares = 6.0;
// Chosen: longer means have few squares, and the density is that of the shorter ones as well.
constexpr double kKnownScale_s = 0.2;
// Chosen: a ramp may change its rate within a second or two, which are four such means.
constexpr double kStraight_s = 0.4;
}  // namespace

ForceStep::ForceStep(double sample_rate_hz, double resolution_N)
    : stair_N_(kStairs * resolution_N),
      per_cell_(static_cast<int>(std::max(1.0, std::ceil(kCell_s * sample_rate_hz - 1e-6)))) {}

void ForceStep::reset() noexcept {
  count_ = 0;
  filled_ = 0;
  foretold_s_ = 0.0;
  sum_ = {};
  sums_[0] = {};
}

ForceStep::Means ForceStep::means(std::size_t from, std::size_t to) const noexcept {
  const Means& late = sums_[(count_ - from) % kCells];
  const Means& early = sums_[(count_ - to) % kCells];
  const double share = 1.0 / static_cast<double>(to - from);
  return {share * (late.force_N - early.force_N), share * (late.torque_Nm - early.torque_Nm),
          share * (late.slip_percent - early.slip_percent)};
}

bool ForceStep::steps(std::size_t length, double slip_noise_percent2_s,
                      const Trend& force) const noexcept {
  const double length_s = kCell_s * static_cast<double>(length);
  const std::size_t before_from = 2 * length + kGapCells;
  const Means earlier = means(before_from + length, before_from + 2 * length);
  const Means before = means(before_from, before_from + length);
  const Means after = means(length, 2 * length);
  const Means later = means(0, length);
  // The lines through the two groups on either side, at the middle of the gap.
  const double on = 0.5 * (1.0 + static_cast<double>(kGapCells) / static_cast<double>(length));
  const double spread = std::sqrt(2.0 * (square(1.0 + on) + square(on)));
  const double drift_N = before.force_N - earlier.force_N;
  const double drift_after_N = later.force_N - after.force_N;
  const double jump_N = after.force_N - before.force_N - on * (drift_N + drift_after_N);
  if (std::abs(jump_N) < std::max(kStepShare * std::abs(before.force_N), stair_N_)) return false;
  // A corner of the force's course, in one of the groups, looks like a step of less than this.
  if (std::abs(jump_N) < std::abs(drift_after_N - drift_N)) return false;
  // What means scatter by without the corners and steps themselves, and at least the white noise;
  // where they are so long that the true course bends in them, with them.
  const double density = length_s > kStraight_s
                             ? force.density(length_s)
                             : std::max(force.quiet_density(length_s),
                                        force.density(std::min(length_s, kKnownScale_s)));
  const double force_deviation_N = std::sqrt(density / length_s);
  if (std::abs(jump_N) < kInManyLooks * spread * force_deviation_N) return false;
  const double mu_after = after.torque_Nm / after.force_N;
  // Relative to mu*.
  const double rise =
      1.0 - earlier.torque_Nm * before.force_N / (before.torque_Nm * earlier.force_N);
  const double jump = -jump_N / after.force_N;
  const double slip_deviation_percent = std::sqrt(slip_noise_percent2_s / length_s);
  const double surely = kSlopeDeviations * std::sqrt(2.0) * slip_deviation_percent;
  const double creep = before.slip_percent - earlier.slip_percent;
  const double slip_jump_percent = after.slip_percent - before.slip_percent -
                                   on * (creep + later.slip_percent - after.slip_percent);
  const double slip_noise_percent = kSlipDeviations * spread * slip_deviation_percent;
  // No ramp is as quick as that, and slip shows nothing of it. A clamp that is given back is as
  // quick: then the force goes on falling no more.
  const double surely_falls_N = kSlopeDeviations * std::sqrt(2.0) * force_deviation_N;
  const bool falls_on =
      drift_N < 0.0 && drift_after_N < std::min(kFallsOn * drift_N, -surely_falls_N);
  const double squares = force.squares(std::min(length_s, kKnownScale_s));
  const double large_N = std::max(
      kInManyLooks * (1.0 + student() / std::max(squares, 1.0)) * spread * force_deviation_N,
      kLargeStepShare * std::abs(before.force_N));
  if (falls_on && squares >= kFewestSquares && std::abs(jump_N) > large_N &&
      -slip_jump_percent * jump_N < slip_noise_percent * std::abs(jump_N)) {
    return true;
  }
  if (!(rise > 0.0) || !(creep > surely)) return false;
  // The curve is concave: on the way up slip moves by more than along its tangent; on the way down
  // by what it has moved since mu* was last as low.
  double expected = (creep - surely) * std::abs(jump) / rise;
  if (jump < -rise) {
    expected = creep - surely;
    const std::size_t reach = std::min(count_, kCells - 1);
    for (std::size_t from = before_from + 2 * length; from + length <= reach; from += length) {
      const Means past = means(from, from + length);
      if (std::abs(past.torque_Nm) < std::abs(mu_after) * past.force_N) break;
      expected = std::max(expected, before.slip_percent - past.slip_percent - surely);
    }
  }
  return std::abs(slip_jump_percent) + slip_noise_percent < kSlipFollows * expected;
}

bool ForceStep::step(const Cell& sample, double pressure_ahead_s, double slip_noise_percent2_s,
                     const Trend& force) noexcept {
  foretold_s_ = std::max(foretold_s_, pressure_ahead_s);
  sum_.force_N += sample.clamp_force_N / per_cell_;
  sum_.torque_Nm += sample.torque_Nm / per_cell_;
  sum_.slip_percent += sample.slip_percent / per_cell_;
  if (++filled_ < per_cell_) return false;
  const Means before_now = sums_[count_ % kCells];
  ++count_;
  sums_[count_ % kCells] = {before_now.force_N + sum_.force_N,
                            before_now.torque_Nm + sum_.torque_Nm,
                            before_now.slip_percent + sum_.slip_percent};
  filled_ = 0;
  sum_ = {};
  for (std::size_t length = kShortest; length <= kLongest; length *= 2) {
    if (count_ < 4 * length + kGapCells) break;
    if (kCell_s * static_cast<double>(length) < kReadings * foretold_s_) continue;
    if (steps(length, slip_noise_percent2_s, force)) return true;
  }
  return false;
}

}  // namespace beltgrip::estimator
