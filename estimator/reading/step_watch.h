// Does the reading of a channel step, by itself? Means before and after a short gap, at several
// lengths, against how means of that length scatter by themselves (noise and the load's own
// variation, as the trend has learned them) and against a share of the value. Real-time thread; no
// allocation after construction.
//
// A torque that steps while slip stays where it was is no longer the one that the friction curve so
// far was measured with, whether the sensor steps or the engine. The clamp force has no say in it:
// as long as the belt holds, it carries what the engine gives and the road takes.
#pragma once

#include <array>
#include <cstddef>

#include "estimator/signal/trend.h"

namespace beltgrip::estimator {

class StepWatch {
 public:
  explicit StepWatch(double sample_rate_hz);
  void reset() noexcept;
  // One sample; slip_noise_percent2_s: a density; trend and slow_variance: of the same channel as
  // value. True when a step has just been seen; not where slip moves, which the value may follow.
  bool step(double value, double slip_percent, double slip_noise_percent2_s, const Trend& trend,
            double slow_variance) noexcept;

 private:
  struct Means {
    double value = 0.0, slip_percent = 0.0;
  };
  static constexpr std::size_t kCells = 512;  // of 50 ms
  // Over the cells from `from` to `to`, counted back from now.
  Means means(std::size_t from, std::size_t to) const noexcept;

  std::array<Means, kCells> sums_{};  // of all cells before
  std::size_t count_ = 0;
  int per_cell_;
  int filled_ = 0;
  Means sum_;
};

}  // namespace beltgrip::estimator
