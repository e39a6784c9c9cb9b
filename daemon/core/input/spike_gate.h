// Does a value go on from the ones before it? A few wild values in a row (a flipped bit, a gateway
// that sends zeros, a missed tooth) are spikes and are left out; what stays away for longer is real
// and is followed. Values count as equally spaced. No allocation; work does not depend on the
// values. Real-time thread.
//
// A straight line through the last values is followed ahead; how far values usually lie from it is
// learned from them. What runs away does so from value to value, which the line follows: a shaft
// that falls free gains 500 rad/s^2, in 10 ms less than half a percent of its speed.
#pragma once

#include <array>
#include <cstddef>

#include "estimator/method/reading_status.h"

namespace beltgrip::daemon {

class SpikeGate {
 public:
  enum class Verdict { kTaken, kLeftOut, kTakenAfterSpike };

  SpikeGate() = default;
  // step: the smallest by which the value can change.
  explicit SpikeGate(double step) : step_(step) {}
  void reset() noexcept;
  // kTakenAfterSpike: what was left out before it was more than noise now and then is.
  // most: how many values in a row may be left out.
  Verdict judge(double value, std::size_t most) noexcept;
  // Of the last value; its verdict is for others to give.
  estimator::ReadingStatus status() const noexcept;

 private:
  static constexpr std::size_t kLine = 5;
  double ahead(double steps) const noexcept;
  void push(double value) noexcept;

  double step_ = 0.0;
  std::array<double, kLine> line_{};  // oldest first
  std::size_t filled_ = 0;
  std::size_t left_out_ = 0;  // in a row
  double furthest_ = 0.0;     // of those left out, in bounds
  double usual_ = 0.0;        // distance from the line, mean
  double learned_ = 0.0;      // values that it rests on
  // Of the last value.
  double value_ = 0.0, expected_ = 0.0;
  double bound_ = 0.0;  // of their distance; 0: not tested
};

}  // namespace beltgrip::daemon
