#include "estimator/robust/after_stop.h"

#include <algorithm>
#include <cmath>

#include "estimator/robust/thresholds.h"

namespace beltgrip::estimator {
namespace {

// The force is judged in means over this; a group that has not risen shows that what was read
// before it had not.
constexpr double kGroup_s = 0.02;
constexpr double kSwingFrom_s = 0.02, kSwingTo_s = 0.08, kSwingShortest_s = 0.03;
constexpr std::size_t kBeforeCells = 20, kSwingCells = 10;

std::size_t samples_in(double duration_s, double sample_rate_hz) {
  return static_cast<std::size_t>(std::max(1.0, std::round(duration_s * sample_rate_hz)));
}

}  // namespace

AfterStop::AfterStop(double sample_rate_hz)
    : samples_(samples_in(kAfterStop_s, sample_rate_hz)),
      per_group_(samples_in(kGroup_s, sample_rate_hz)) {}

void AfterStop::reset() noexcept {
  count_ = read_ = kept_ = group_begin_ = read_before_group_ = 0;
  begun_ = over_ = false;
  swing_slip_percent_ = 0.0;
  swing_samples_ = 0;
}

void AfterStop::begin(const ExperimentRecord& record) noexcept {
  const History& history = record.history();
  const Line& force = record.force_line();
  stop_t_s_ = record.duration_s();
  begun_ = history.size(0) >= kBeforeCells + kSwingCells && force.valid;
  over_ = !begun_;
  if (!begun_) return;
  stop_slip_percent_ = history.cell(0, 0).slip_percent;
  slip_before_percent_ = slip_at_end_percent_ = 0.0;
  for (std::size_t i = 0; i < kSwingCells; ++i) {
    slip_before_percent_ += history.cell(0, kBeforeCells + i).slip_percent / kSwingCells;
    slip_at_end_percent_ = std::max(slip_at_end_percent_, history.cell(0, i).slip_percent);
  }
  slip_noise_percent2_s_ = record.slip_noise_percent2_s();
  force_limit_N_ =
      force.at(stop_t_s_) + kEvident * std::sqrt(force.variance_at(stop_t_s_) +
                                                 record.force().density(kGroup_s) / kGroup_s);
}

void AfterStop::step(const Cell& sample, double pressure_ahead_s) noexcept {
  if (!begun_) return;
  if (over_) return;
  samples_[count_++] = sample;
  count_read(sample.t_s - pressure_ahead_s);
  if (count_ - group_begin_ == per_group_) judge_group();
  if (count_ == samples_.size()) over_ = true;
}

void AfterStop::count_read(double read_to_s) noexcept {
  for (; read_ < count_ && samples_[read_].t_s <= read_to_s; ++read_) {
    const double after_s = samples_[read_].t_s - stop_t_s_;
    if (after_s < kSwingFrom_s || after_s > kSwingTo_s) continue;
    swing_slip_percent_ += samples_[read_].slip_percent;
    ++swing_samples_;
  }
}

void AfterStop::judge_group() noexcept {
  double force_N = 0.0, slip_percent = 0.0;
  for (std::size_t i = group_begin_; i < count_; ++i) {
    force_N += samples_[i].clamp_force_N;
    slip_percent += samples_[i].slip_percent;
  }
  const double samples = static_cast<double>(per_group_);
  if (force_N > force_limit_N_ * samples) {
    over_ = true;
    return;
  }
  kept_ = read_before_group_;
  const double most_percent = std::min(stop_slip_percent_ + kRunAway_percent, kFrictionTo_percent);
  if (slip_percent > most_percent * samples) {
    over_ = true;
    return;
  }
  group_begin_ = count_;
  read_before_group_ = read_;
}

bool AfterStop::swung_back() const noexcept {
  // The force was back too soon: that is no period of a rattle.
  const double watched_s = kAfterStop_s * swing_samples_ / static_cast<double>(samples_.size());
  if (watched_s < kSwingShortest_s) return false;
  const double gained = slip_at_end_percent_ - slip_before_percent_;
  const double noise = std::sqrt(slip_noise_percent2_s_ / watched_s);
  return gained > kSwing_percent + kEvident * noise &&
         swing_slip_percent_ / swing_samples_ < slip_before_percent_ + kSwingLeft * gained;
}

}  // namespace beltgrip::estimator
