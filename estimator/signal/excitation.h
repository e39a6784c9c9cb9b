// How much the slip moves: its variance over a window, equation (10), and the gate that this opens.
// Slip in percent. Real-time thread; all memory is taken by the constructor.
#pragma once

#include <cstddef>
#include <vector>

namespace beltgrip::estimator {

class SlipExcitation {
 public:
  // The window holds window_s * sample_rate_hz samples, at least 2.
  SlipExcitation(double window_s, double sample_rate_hz, double threshold);
  void reset() noexcept;
  void step(double slip_percent) noexcept;
  // v(t), (percent slip)^2; 0 until the window is full ("for t > T").
  double variance() const noexcept { return variance_; }
  bool open() const noexcept { return open_; }           // v > c_v
  bool opened() const noexcept { return just_opened_; }  // with this sample

 private:
  std::vector<double> window_;
  double threshold_;
  std::size_t next_ = 0;
  std::size_t filled_ = 0;
  double reference_ = 0.0;  // sums are of slip - reference: no loss of digits at a large slip
  double sum_ = 0.0;
  double sum_squares_ = 0.0;
  double variance_ = 0.0;
  bool open_ = false;
  bool just_opened_ = false;
};

}  // namespace beltgrip::estimator
