// Has a reading that kept changing come to stand still? A sensor's never repeats itself for long: a
// signal that does so is no longer measured, though its frames still arrive. Real-time thread.
#pragma once

#include <algorithm>
#include <cmath>

namespace beltgrip::estimator {

class FrozenReading {
 public:
  explicit FrozenReading(double sample_rate_hz)
      : least_samples_(std::lround(kLeast_s * sample_rate_hz)),
        never_samples_(std::lround(kNever_s * sample_rate_hz)) {}
  void reset() noexcept {
    run_ = longest_ = values_ = 0;
    last_ = 0.0;
  }
  void step(double value) noexcept {
    if (values_ > 0 && !(value < last_) && !(value > last_)) {
      ++run_;
      return;
    }
    longest_ = std::max(longest_, run_);
    run_ = 0;
    ++values_;
    last_ = value;
  }
  // Never so where the reading has changed a few times only: it comes in coarse steps, or is held.
  bool frozen() const noexcept {
    return moves() && run_ >= std::max(least_samples_, kTimesLongest * longest_);
  }
  // One value since the beginning: frozen as well where other readings move, else data without
  // noise.
  bool never_moved() const noexcept { return values_ == 1 && run_ >= never_samples_; }
  bool moves() const noexcept { return values_ > kFewest; }

 private:
  static constexpr double kLeast_s = 0.15;
  static constexpr double kNever_s = 5.0;
  static constexpr long kFewest = 20, kTimesLongest = 5;

  long least_samples_, never_samples_;
  long run_ = 0;      // samples since the last change
  long longest_ = 0;  // the longest run before this one
  long values_ = 0;   // runs, this one included
  double last_ = 0.0;
};

}  // namespace beltgrip::estimator
