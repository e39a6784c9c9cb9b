// Does the reading of a channel step, by itself? Means before and after a short gap, at two
// lengths, against the noise of the channel and against a share of its value. Real-time thread; no
// allocation after construction.
//
// A torque that steps while slip and clamp force stay where they were is no longer the one that the
// friction curve so far was measured with, whether the sensor steps or the engine.
#pragma once

#include <array>
#include <cstddef>

namespace beltgrip::estimator {

class StepWatch {
 public:
  explicit StepWatch(double sample_rate_hz);
  void reset() noexcept;
  // One sample. noise: density of the value's (variance of the mean over one second). True when a
  // step has just been seen; not where slip moves, which the value may follow.
  bool step(double value, double slip_percent, double clamp_force_N, double noise) noexcept;

 private:
  struct Cell {
    double value = 0.0, slip = 0.0, force = 0.0;
  };
  static constexpr std::size_t kCells = 48;  // of 50 ms
  Cell mean(std::size_t youngest, std::size_t count) const noexcept;

  std::array<Cell, kCells> cells_{};
  std::size_t count_ = 0;
  int per_cell_;
  int filled_ = 0;
  Cell sum_;
};

}  // namespace beltgrip::estimator
