// How steeply friction falls behind the peak of a belt, as its own experiments show it: per unit of
// slip, with its uncertainty. One experiment sees half a point of slip behind the peak under the
// noise of its sensors, so what it shows is a reading among others. Real-time thread, no
// allocation.
#pragma once

#include <array>
#include <cstddef>

namespace beltgrip::daemon {

// What a belt falls by, with 95 %; per unit of slip.
struct FallRange {
  double least = 0.0;
  double most = 0.0;  // 0: nothing was shown
};

class FallShown {
 public:
  // variance > 0.
  void add(double fall, double variance) noexcept;
  FallRange range() const noexcept;

 private:
  double weight_ = 0.0;
  double weighted_ = 0.0;
};

// The last points of one experiment's friction curve, as they came.
class LastPoints {
 public:
  void clear() noexcept { count_ = 0; }
  // Magnitudes: slip in percent, mu*.
  void add(double slip_percent, double mu_star) noexcept;
  // Adds the slope of the points behind the peak; nothing where they span too little slip.
  void show(double peak_slip_percent, FallShown& to) const noexcept;

 private:
  struct Point {
    double slip_percent = 0.0, mu_star = 0.0;
  };
  static constexpr std::size_t kPoints =
      128;  // at 200 Hz more than the crossing of a point of slip
  std::array<Point, kPoints> points_{};
  std::size_t next_ = 0, count_ = 0;
};

}  // namespace beltgrip::daemon
