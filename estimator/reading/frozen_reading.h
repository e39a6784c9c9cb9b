// Has a reading that kept changing come to stand still? A sensor's never repeats itself for long: a
// signal that does so is no longer measured, though its frames still arrive. But one that is
// rounded, and goes to and fro between two neighbouring steps, lies near their edge: in the middle
// of a step it may rest for ever. Real-time thread.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace beltgrip::estimator {

class FrozenReading {
 public:
  explicit FrozenReading(double sample_rate_hz)
      : least_samples_(std::lround(kLeast_s * sample_rate_hz)),
        never_samples_(std::lround(kNever_s * sample_rate_hz)) {}
  void reset() noexcept {
    run_ = longest_ = values_ = 0;
    last_ = step_ = 0.0;
    rests_ = 0;
  }
  void step(double value) noexcept {
    if (values_ > 0 && !(value < last_) && !(value > last_)) {
      ++run_;
      return;
    }
    longest_ = std::max(longest_, run_);
    if (run_ > 0) rest();
    run_ = 0;
    ++values_;
    last_ = value;
  }
  // Never so where the reading has changed a few times only: it comes in coarse steps, or is held.
  bool frozen() const noexcept {
    return moves() && run_ >= std::max(least_samples_, kTimesLongest * longest_) && !near_edge();
  }
  // One value since the beginning: frozen as well where other readings move, else data without
  // noise.
  bool never_moved() const noexcept { return values_ == 1 && run_ >= never_samples_; }
  bool moves() const noexcept { return values_ > kFewest; }
  long still_samples() const noexcept { return run_; }  // since the last change
  double value() const noexcept { return last_; }

 private:
  static constexpr double kLeast_s = 0.15;
  static constexpr double kNever_s = 5.0;
  static constexpr long kFewest = 20, kTimesLongest = 5;
  // Of neighbouring steps. Derived: more than one apart, less than two.
  static constexpr double kNeighbours = 1.5;
  // Chosen: where a signal that moves has rested so often, it has left two steps; also one of 10
  // kPa a step on a ramp of 12 kPa/s. Measured on 125 traces of other make with a reading that
  // stops: with 10 rests five wrong values under a pressure that stood still, with 30 or 60 two.
  static constexpr std::size_t kRests = 30;

  // A value that came twice or more is one of the signal's steps; others may lie between two.
  void rest() noexcept {
    if (rests_ > 0) {
      const double apart = std::abs(last_ - rested_[(rests_ - 1) % kRests]);
      if (apart > 0.0) step_ = step_ > 0.0 ? std::min(step_, apart) : apart;
    }
    rested_[rests_++ % kRests] = last_;
  }
  bool near_edge() const noexcept {
    if (rests_ < kRests) return false;
    const auto [low, high] = std::minmax_element(rested_.begin(), rested_.end());
    return *high - *low < kNeighbours * step_;
  }

  long least_samples_, never_samples_;
  long run_ = 0;      // samples since the last change
  long longest_ = 0;  // the longest run before this one
  long values_ = 0;   // runs, this one included
  double last_ = 0.0;
  std::array<double, kRests> rested_{};  // at the last values where it rested
  std::size_t rests_ = 0;
  double step_ = 0.0;  // the least between two of them; 0: not known
};

}  // namespace beltgrip::estimator
