// Does the reading of the clamp force step while slip stays where it was? Slip in percent.
// Real-time thread; no allocation, bounded work at the end of each cell.
//
// Below its peak a belt follows a step of the force with its slip, along the curve that it has
// just gone along, within less than the gap that is left out here. Where the force steps, and slip
// moves by much less than that, the reading has stepped (its gain, its zero), and what mu* is
// before and after do not belong to one curve. Where slip is too noisy to say whether it followed,
// a step that is large within less than that gap is the reading's as well: a ramp has its rate.
// A clamp that is given back has not; its force falls no more.
#pragma once

#include <array>
#include <cstddef>

#include "estimator/record/history.h"
#include "estimator/signal/trend.h"

namespace beltgrip::estimator {

class ForceStep {
 public:
  // resolution_N: of the clamp force, as its pressure's signal is rounded; 0: not known.
  ForceStep(double sample_rate_hz, double resolution_N);
  void reset() noexcept;
  // One sample, its pressure foretold for so long; slip_noise_percent2_s: a density, force: the
  // trend of the clamp force. True when a step has just been seen.
  bool step(const Cell& sample, double pressure_ahead_s, double slip_noise_percent2_s,
            const Trend& force) noexcept;

 private:
  struct Means {
    double force_N = 0.0, torque_Nm = 0.0, slip_percent = 0.0;
  };
  static constexpr std::size_t kCells = 512;  // of 50 ms
  // Over the cells from `from` to `to`, counted back from now.
  Means means(std::size_t from, std::size_t to) const noexcept;
  bool steps(std::size_t length, double slip_noise_percent2_s, const Trend& force) const noexcept;

  std::array<Means, kCells> sums_{};  // of all cells before
  std::size_t count_ = 0;
  double stair_N_;
  double foretold_s_ = 0.0;  // the longest: the pressure is read about as seldom
  int per_cell_;
  int filled_ = 0;
  Means sum_;
};

}  // namespace beltgrip::estimator
