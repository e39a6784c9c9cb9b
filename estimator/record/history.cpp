#include "estimator/record/history.h"

#include <algorithm>
#include <cmath>

namespace beltgrip::estimator {

History::History(double sample_rate_hz, double finest_cell_s)
    : per_cell_(static_cast<int>(std::max(1L, std::lround(sample_rate_hz * finest_cell_s)))),
      cell_s_(per_cell_ / sample_rate_hz) {
  for (Level& level : levels_) level.ring = std::vector<Cell>(kCells);
}

void History::reset() noexcept {
  for (Level& level : levels_) {
    level.count = 0;
    level.sum = {};
    level.filled = 0;
  }
}

bool History::step(const Cell& sample) noexcept {
  Cell carry = sample;
  for (std::size_t i = 0; i < kLevels; ++i) {
    Level& level = levels_[i];
    level.sum.t_s += carry.t_s;
    level.sum.slip_percent += carry.slip_percent;
    level.sum.torque_Nm += carry.torque_Nm;
    level.sum.clamp_force_N += carry.clamp_force_N;
    level.sum.omega_p_rad_s += carry.omega_p_rad_s;
    const int wanted = i == 0 ? per_cell_ : 2;
    if (++level.filled < wanted) return i > 0;
    const double share = 1.0 / wanted;
    carry = {level.sum.t_s * share, level.sum.slip_percent * share, level.sum.torque_Nm * share,
             level.sum.clamp_force_N * share, level.sum.omega_p_rad_s * share};
    level.ring[level.count % kCells] = carry;
    ++level.count;
    level.sum = {};
    level.filled = 0;
  }
  return true;
}

}  // namespace beltgrip::estimator
