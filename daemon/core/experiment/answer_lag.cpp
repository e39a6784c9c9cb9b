#include "daemon/core/experiment/answer_lag.h"

#include <algorithm>
#include <cmath>

namespace beltgrip::daemon {

namespace {
// Larger ones tell the lag later or not at all. What a fifth more or less of each changes has not
// been measured.
// Derived: of the configured lag; e^-3, 5 % of the first answer, is left.
constexpr double kSettle = 3.0;
// Chosen: deviation of the rates, a tenth of the default ramp: they were different.
constexpr double kContrast_N_per_s = 60.0;
constexpr double kDeviations = 2.0;  // chosen: one-sided 98 %
// Derived: samples at 200 Hz for each reading of a pressure of 50 Hz.
constexpr double kCorrelated = 4.0;
}  // namespace

void AnswerLag::begin(MonoTime t, double configured_s) noexcept {
  *this = {};
  begun_ = last_ = t;
  configured_s_ = configured_s;
}

void AnswerLag::step(MonoTime t, double rate_N_per_s, double behind_N) noexcept {
  const double step_s = seconds(t - last_);
  last_ = t;
  rate_N_per_s_ -= std::expm1(-step_s / configured_s_) * (rate_N_per_s - rate_N_per_s_);
  if (seconds(t - begun_) < kSettle * configured_s_) return;
  n_ += 1.0;
  const double rate_off = rate_N_per_s_ - rate_mean_, behind_off = behind_N - behind_mean_;
  rate_mean_ += rate_off / n_;
  behind_mean_ += behind_off / n_;
  rate_square_ += rate_off * (rate_N_per_s_ - rate_mean_);
  behind_square_ += behind_off * (behind_N - behind_mean_);
  product_ += rate_off * (behind_N - behind_mean_);
}

double AnswerLag::least_s() const noexcept {
  if (rate_square_ < n_ * kContrast_N_per_s * kContrast_N_per_s || n_ < 3.0) return 0.0;
  const double lag_s = product_ / rate_square_;
  const double rest = std::max(0.0, behind_square_ - lag_s * product_);
  return lag_s - kDeviations * std::sqrt(kCorrelated * rest / (n_ - 2.0) / rate_square_);
}

}  // namespace beltgrip::daemon
