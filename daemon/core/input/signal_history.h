// The last values of one signal with their stamps, and the value at an instant near the newest.
// Stamps strictly increase. Fixed size, no allocation. Real-time thread.
//
// No ring is shared with its neighbours, since none holds the same values: here are those that were
// taken; value_course has what was received, spikes too, but of equal ones the first alone, 32 of
// them, which may reach back over minutes; spike_gate has five, those left out replaced by a line.
#pragma once

#include <array>
#include <cstddef>

#include "daemon/core/base/mono_time.h"

namespace beltgrip::daemon {

class SignalHistory {
 public:
  // A value at the newest stamp, or before it, replaces the newest value: time never runs backwards
  // here.
  void add(MonoTime t, double value) noexcept;
  void clear() noexcept { size_ = 0; }
  bool empty() const noexcept { return size_ == 0; }
  MonoTime newest() const noexcept { return at(0).t; }
  double newest_value() const noexcept { return at(0).value; }

  // The value at t by linear interpolation. Beyond the newest stamp the value goes on with the
  // least-squares slope of the last kLine values for at most `reach`, and stays level from there:
  // holding the last value instead would lag a ramp of 300 N/s by 5 N at 20 Hz and 13 N at 10 Hz.
  // False when t lies before the oldest stamp, or beyond the only one.
  bool value_at(MonoTime t, Duration reach, double& value) const noexcept;

 private:
  static constexpr std::size_t kCapacity = 128;  // 100 ms of a signal that comes every millisecond
  static constexpr std::size_t kLine = 4;
  struct Point {
    MonoTime t = MonoTime::origin();
    double value = 0.0;
  };
  const Point& at(std::size_t age) const noexcept {
    return points_[(newest_ + kCapacity - age) % kCapacity];
  }

  std::array<Point, kCapacity> points_{};
  std::size_t newest_ = 0;
  std::size_t size_ = 0;
};

}  // namespace beltgrip::daemon
