// From the kernel's wall-clock receive stamp to the monotonic clock. The age of a frame is the
// difference of two wall-clock readings; where it cannot be one, because the clock was set in
// between, the frame counts as received now. Pure.
#pragma once

#include <cstdint>

#include "daemon/core/base/mono_time.h"

namespace beltgrip::daemon {

class StampConverter {
 public:
  static constexpr Duration kAgeMaximum = 5 * kSecond;
  // The wall clock may be slewed by this between two reads; more is a step.
  static constexpr Duration kSlewMaximum = 2 * kMillisecond;

  // Both clocks, read together, before the stamps of a batch.
  void read(MonoTime monotonic, std::int64_t wall) noexcept {
    const Duration offset = Duration::of_ns(wall) - monotonic.since_origin();
    const Duration moved = offset - offset_;
    stepped_ = known_ && (moved > kSlewMaximum || moved < -kSlewMaximum);
    known_ = true;
    offset_ = offset;
    monotonic_ = monotonic;
    wall_ = wall;
  }
  // Without a stamp the frame counts as received now. Never later than now, never before the one
  // before.
  MonoTime convert(bool has_stamp, std::int64_t stamp) noexcept {
    const Duration age = Duration::of_ns(wall_ - stamp);
    const bool usable = has_stamp && !stepped_ && age >= Duration{} && age <= kAgeMaximum;
    const MonoTime t = usable ? monotonic_ - age : monotonic_;
    newest_ = t > newest_ ? t : newest_;
    return newest_;
  }

 private:
  MonoTime monotonic_;
  std::int64_t wall_ = 0;
  Duration offset_;
  MonoTime newest_;
  bool known_ = false;
  bool stepped_ = false;
};

}  // namespace beltgrip::daemon
