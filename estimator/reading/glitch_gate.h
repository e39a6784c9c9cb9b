// A reading that jumps for a few frames and comes back is none: it is held where its course was.
// What stays away longer is true and passes. No shaft jumps: it has inertia. Real-time thread.
//
// The daemon's spike gate is another: it leaves out single frames before there are samples, so that
// no guard of a request sees them. This one judges samples, whoever reads them, and says of a jump
// that comes back within a fifth of a second that no value follows. Either one off, tests fail that
// the other does not mend (tests/FIGURES.md).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "estimator/method/reading_status.h"

namespace beltgrip::estimator {

class GlitchGate {
 public:
  explicit GlitchGate(double sample_rate_hz)
      : window_(std::clamp<std::size_t>(samples(kWindow_s, sample_rate_hz), 4, kMost)),
        hold_(samples(kHold_s, sample_rate_hz)),
        apart_(samples(kApart_s, sample_rate_hz)) {
    const double n = static_cast<double>(window_);
    step_per_moment_ = 6.0 / (n * (n - 1.0));
  }
  void reset() noexcept {
    begin_anew();
    bound_ = 0.0;
  }

  // One sample: the value, or what the line through those before it expects where the value lies
  // further from that than `share` of it, and than `least`.
  double step(double value, double share, double least) noexcept {
    ++since_;
    jumped_ = false;
    value_ = value;
    bound_ = 0.0;
    if (count_ < window_) return take(value);
    const double expected = expected_ = next_on_line();
    bound_ = std::max(share * std::abs(expected), least);
    if (std::abs(value - expected) <= bound_) {
      if (held_ > 0) since_ = 0;
      held_ = 0;
      return take(value);
    }
    // Readings that do so again and again rattle: that is for others to judge.
    const double away = value - expected;
    if (held_ < hold_ && (held_ > 0 || since_ > apart_)) {
      if (++held_ == (hold_ + 1) / 2) half_way_ = away;
      return take(expected);
    }
    jumped_ = held_ > 0 && std::abs(away - half_way_) < kSame * std::abs(half_way_);
    begin_anew();
    return take(value);
  }
  // With the last sample: it had gone to another level, within half of what is held, and stayed
  // there. What runs away goes on doing so.
  bool jumped() const noexcept { return jumped_; }
  // Of the last sample; its verdict is for others to give.
  ReadingStatus status() const noexcept {
    if (!(bound_ > 0.0)) return {};
    return {.value = value_,
            .expected = expected_,
            .test_ratio = std::abs(value_ - expected_) / bound_};
  }

 private:
  static constexpr double kWindow_s = 0.06, kHold_s = 0.05, kApart_s = 0.5;
  static constexpr double kSame = 0.3;
  static constexpr std::size_t kMost = 60;
  static std::size_t samples(double time_s, double rate_hz) {
    return static_cast<std::size_t>(std::lround(time_s * rate_hz));
  }

  void begin_anew() noexcept { count_ = held_ = since_ = 0; }
  double take(double value) noexcept {
    values_[count_++ % window_] = value;
    return value;
  }
  // Least squares over the window, one sample on.
  double next_on_line() const noexcept {
    const double middle = 0.5 * (static_cast<double>(window_) - 1.0);
    double sum = 0.0, moment = 0.0, x = -middle;
    std::size_t oldest = count_ % window_;
    for (std::size_t i = 0; i < window_; ++i, x += 1.0) {
      sum += values_[oldest];
      moment += x * values_[oldest];
      oldest = oldest + 1 == window_ ? 0 : oldest + 1;
    }
    return sum / static_cast<double>(window_) + moment * step_per_moment_;
  }

  std::array<double, kMost> values_{};
  std::size_t window_, hold_, apart_;
  double step_per_moment_;  // of the line, from the middle of the window to one sample beyond it
  std::size_t count_ = 0;
  std::size_t held_ = 0;   // samples, of a jump that may come back
  double half_way_ = 0.0;  // how far away it was then
  bool jumped_ = false;
  double value_ = 0.0, expected_ = 0.0;  // of the last sample
  double bound_ = 0.0;                   // of their distance; 0: not tested
  std::size_t since_ = 0;  // samples since the last one came back, or since the beginning
};

}  // namespace beltgrip::estimator
