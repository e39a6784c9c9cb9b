// The slip of a request from the two speeds alone, without the estimator's filters and their delay:
// how far the speed ratio has moved since the start in the direction of the torque, how fast it
// moves over 60 ms, and how much of that is noise. Slip as a fraction. Real-time thread.
#pragma once

#include <array>
#include <cstddef>

#include "daemon/core/base/mono_time.h"

namespace beltgrip::daemon {

class SlipCourse {
 public:
  static constexpr Duration kRateOver = 60 * kMillisecond;

  void begin(double ratio, double torque_Nm) noexcept;
  void step(MonoTime t, double ratio) noexcept;

  double slip_share() const noexcept { return slip_share_; }  // mean of the last 15 ms
  double slip_max_share() const noexcept { return slip_max_share_; }
  double rate_1_s() const noexcept { return rate_1_s_; }  // 0: not known yet
  // One standard deviation of rate_1_s(), from the scatter of rates that share no sample; infinite
  // until that is known.
  double rate_deviation_1_s() const noexcept;
  // Slip as it would be at this ratio.
  double slip_share_at(double ratio) const noexcept;

 private:
  struct Point {
    MonoTime t = MonoTime::origin();
    double slip_share = 0.0;
    double rate_1_s = 0.0;
  };
  static constexpr std::size_t kPoints = 128;  // kRateOver at 1000 Hz, and more
  const Point& point(std::size_t age) const noexcept {
    return points_[(count_ - 1 - age) % kPoints];
  }
  void count_noise(double rate_before_1_s) noexcept;

  std::array<Point, kPoints> points_{};  // newest at count_ - 1
  std::size_t count_ = 0;
  double start_ratio_ = 1.0;
  double direction_ = 1.0;
  double slip_share_ = 0.0;
  double slip_max_share_ = 0.0;
  double rate_1_s_ = 0.0;
  double square_ = 0.0;  // mean square of the change of rate from one window to the next
  double squares_ = 0.0;
};

}  // namespace beltgrip::daemon
