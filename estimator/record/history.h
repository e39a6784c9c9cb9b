// What an experiment has measured so far, in bounded memory: means over cells whose length grows
// with their age. Level 0 keeps the last cells of kFinestCell_s, each next level twice as long
// ones; so every look back is resolved to some hundredth of its own length. Real-time thread; all
// memory is taken by the constructor.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <vector>

namespace beltgrip::estimator {

struct Cell {  // means
  double t_s = 0.0;
  double slip_percent = 0.0;
  double torque_Nm = 0.0;  // as measured, in the direction of the torque
  double clamp_force_N = 0.0;
  double omega_p_rad_s = 0.0;
};

class History {
 public:
  static constexpr std::size_t kLevels = 16;  // 5 min at 10 ms and more
  static constexpr std::size_t kCells = 128;  // per level
  History(double sample_rate_hz, double finest_cell_s);
  void reset() noexcept;
  // True when a cell of the finest level was completed.
  bool step(const Cell& sample) noexcept;
  double cell_s(std::size_t level) const noexcept {
    return cell_s_ * static_cast<double>(std::size_t{1} << level);
  }
  std::size_t size(std::size_t level) const noexcept {
    return std::min(levels_[level].count, kCells);
  }
  // age 0: the newest full cell of the level.
  const Cell& cell(std::size_t level, std::size_t age) const noexcept {
    const Level& l = levels_[level];
    return l.ring[(l.count - 1 - age) % kCells];
  }

 private:
  struct Level {
    std::vector<Cell> ring;
    std::size_t count = 0;
    Cell sum;
    int filled = 0;
  };
  std::array<Level, kLevels> levels_;
  int per_cell_;
  double cell_s_;
};

}  // namespace beltgrip::estimator
