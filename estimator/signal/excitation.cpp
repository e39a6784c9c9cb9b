#include "estimator/signal/excitation.h"

#include <algorithm>
#include <cmath>

namespace beltgrip::estimator {

SlipExcitation::SlipExcitation(double window_s, double sample_rate_hz, double threshold)
    : window_(static_cast<std::size_t>(std::max(2L, std::lround(window_s * sample_rate_hz)))),
      threshold_(threshold) {}

void SlipExcitation::reset() noexcept {
  next_ = filled_ = 0;
  sum_ = sum_squares_ = variance_ = 0.0;
  open_ = just_opened_ = false;
}

void SlipExcitation::step(double slip_percent) noexcept {
  if (filled_ == 0) reference_ = slip_percent;
  const double value = slip_percent - reference_;
  if (filled_ == window_.size()) {
    const double oldest = window_[next_];
    sum_ -= oldest;
    sum_squares_ -= oldest * oldest;
  } else {
    ++filled_;
  }
  window_[next_] = value;
  next_ = next_ + 1 == window_.size() ? 0 : next_ + 1;
  sum_ += value;
  sum_squares_ += value * value;
  if (filled_ == window_.size()) {
    const double count = static_cast<double>(window_.size());
    const double mean = sum_ / count;
    variance_ = std::max(0.0, sum_squares_ / count - mean * mean);
  }
  const bool open = variance_ > threshold_;
  just_opened_ = open && !open_;
  open_ = open;
}

}  // namespace beltgrip::estimator
