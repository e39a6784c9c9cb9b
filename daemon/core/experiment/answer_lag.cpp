#include "daemon/core/experiment/answer_lag.h"

#include <algorithm>
#include <cmath>

namespace beltgrip::daemon {

namespace {
constexpr double kSecondsPerTick = 1e-9;
constexpr double kSettle = 3.0;             // of the configured lag: the request has taken hold
constexpr double kContrast_N_per_s = 60.0;  // deviation of the rates: they were different
constexpr double kDeviations = 2.0;
constexpr double kCorrelated = 4.0;  // samples of a pressure that comes at 100 Hz and less
}  // namespace

void AnswerLag::begin(MonoTime t, double configured_s) noexcept {
  *this = {};
  begun_ = last_ = t;
  configured_s_ = configured_s;
}

void AnswerLag::step(MonoTime t, double rate_N_per_s, double behind_N) noexcept {
  const double step_s = static_cast<double>(t - last_) * kSecondsPerTick;
  last_ = t;
  rate_N_per_s_ -= std::expm1(-step_s / configured_s_) * (rate_N_per_s - rate_N_per_s_);
  if (static_cast<double>(t - begun_) * kSecondsPerTick < kSettle * configured_s_) return;
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
