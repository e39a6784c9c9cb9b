#include "estimator/signal/input_filter.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace beltgrip::estimator {
namespace {
constexpr double kDamping = std::numbers::sqrt2;  // 1/Q of a Butterworth low-pass
}

LowPass::LowPass(double cutoff_hz, double sample_rate_hz)
    : g_(std::tan(std::numbers::pi * std::min(cutoff_hz / sample_rate_hz, 0.45))),
      cutoff_rad_(2.0 * sample_rate_hz * g_) {}

void LowPass::reset(double value) noexcept {
  band_ = 0.0;
  low_ = value_ = value;
  derivative_ = 0.0;
}

double LowPass::step(double input) noexcept {
  const double band = (band_ + g_ * (input - low_)) / (1.0 + g_ * (g_ + kDamping));
  value_ = low_ + g_ * band;
  band_ = 2.0 * band - band_;
  low_ = 2.0 * value_ - low_;
  derivative_ = cutoff_rad_ * band;
  return value_;
}

}  // namespace beltgrip::estimator
