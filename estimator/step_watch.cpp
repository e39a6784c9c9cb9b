#include "estimator/step_watch.h"

#include <algorithm>
#include <cmath>

namespace beltgrip::estimator {
namespace {

constexpr double kCell_s = 0.05;
constexpr std::size_t kGapCells = 2;
constexpr double kDeviations = 6.0;
constexpr double kDrift = 2.5;
constexpr double kQuietSlip_percent = 0.15;  // slip that moves by less carries no other torque
constexpr double kQuietForce = 0.05;         // relative

struct Scale {
  std::size_t cells;  // on either side
  double share;       // of the value: the load of a car varies by itself
};
constexpr Scale kScales[] = {{4, 0.03}, {12, 0.05}};

}  // namespace

StepWatch::StepWatch(double sample_rate_hz)
    : per_cell_(static_cast<int>(std::max(1.0, std::ceil(kCell_s * sample_rate_hz - 1e-6)))) {}

void StepWatch::reset() noexcept {
  count_ = 0;
  filled_ = 0;
  sum_ = {};
}

StepWatch::Cell StepWatch::mean(std::size_t youngest, std::size_t count) const noexcept {
  Cell out;
  const double share = 1.0 / static_cast<double>(count);
  for (std::size_t i = 0; i < count; ++i) {
    const Cell& cell = cells_[(count_ - 1 - youngest - i) % kCells];
    out.value += share * cell.value;
    out.slip += share * cell.slip;
    out.force += share * cell.force;
  }
  return out;
}

bool StepWatch::step(double value, double slip_percent, double clamp_force_N,
                     double noise) noexcept {
  sum_.value += value;
  sum_.slip += slip_percent;
  sum_.force += clamp_force_N;
  if (++filled_ < per_cell_) return false;
  cells_[count_ % kCells] = {sum_.value / filled_, sum_.slip / filled_, sum_.force / filled_};
  ++count_;
  filled_ = 0;
  sum_ = {};
  for (const Scale& scale : kScales) {
    if (count_ < 2 * scale.cells + kGapCells) break;
    const Cell after = mean(0, scale.cells);
    const Cell before = mean(scale.cells + kGapCells, scale.cells);
    if (std::abs(after.slip - before.slip) > kQuietSlip_percent ||
        std::abs(after.force - before.force) > kQuietForce * std::abs(before.force)) {
      continue;
    }
    const double change = std::abs(after.value - before.value);
    // What has been drifting already goes on doing so.
    const std::size_t earlier = 2 * (scale.cells + kGapCells);
    if (count_ < earlier + scale.cells) continue;
    if (change < kDrift * std::abs(before.value - mean(earlier, scale.cells).value)) continue;
    const double deviation = std::sqrt(2.0 * noise / (kCell_s * static_cast<double>(scale.cells)));
    if (change > kDeviations * deviation && change > scale.share * std::abs(before.value)) {
      return true;
    }
  }
  return false;
}

}  // namespace beltgrip::estimator
