#include "estimator/record/experiment_record.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace beltgrip::estimator {
namespace {

constexpr double kFinestCell_s = 0.01;
constexpr std::size_t kTrendCells = 4096;  // 205 s
// Cells of the torque's trend. Derived: the slow error shows in means of that many and more.
constexpr std::size_t kSlowEvery = 8;
constexpr double kLowered = 0.99;  // of the first clamp force
constexpr double kSmooth_s = 0.1;
constexpr double kRaised = 1.05;  // of the lowest clamp force, and beyond so many deviations
constexpr double kRaisedDeviations = 5.0;

}  // namespace

ExperimentRecord::ExperimentRecord(double sample_rate_hz)
    : history_(sample_rate_hz, kFinestCell_s),
      force_(sample_rate_hz, kTrendCells, Course::kBends),
      torque_(sample_rate_hz, kTrendCells),
      omega_p_(sample_rate_hz, kTrendCells),
      slip_speed_(sample_rate_hz, kTrendCells),
      torque_estimates_(kTrendCells),
      torque_watch_(sample_rate_hz) {}

void ExperimentRecord::reset() noexcept {
  history_.reset();
  force_.reset();
  torque_.reset();
  omega_p_.reset();
  slip_speed_.reset();
  force_line_ = torque_line_ = {};
  torque_slow_variance_ = 0.0;
  torque_watch_.reset();
  torque_estimate_count_ = 0;
  last_held_s_ = 0.0;
  first_force_N_ = 0.0;
  slips_ = lowered_ = false;
  torque_stepped_s_ = std::numeric_limits<double>::infinity();
  smooth_force_N_ = lowest_force_N_ = lowest_force_s_ = 0.0;
  last_t_s_ = 0.0;
  last_omega_rad_s_ = 1.0;
}

double ExperimentRecord::lowered_until_s() const noexcept {
  const double noise = std::sqrt(force_.density(kNoiseScale_s) / kSmooth_s);
  const bool raised = smooth_force_N_ > kRaised * lowest_force_N_ + kRaisedDeviations * noise;
  return raised ? lowest_force_s_ : std::numeric_limits<double>::infinity();
}

void ExperimentRecord::follow_force(const Cell& sample) noexcept {
  const double share = std::min(1.0, (sample.t_s - last_t_s_) / kSmooth_s);
  if (smooth_force_N_ <= 0.0) smooth_force_N_ = sample.clamp_force_N;
  smooth_force_N_ += share * (sample.clamp_force_N - smooth_force_N_);
  if (lowest_force_N_ <= 0.0 || smooth_force_N_ < lowest_force_N_) {
    lowest_force_N_ = smooth_force_N_;
    lowest_force_s_ = sample.t_s;
  }
}

bool ExperimentRecord::step(const Cell& sample) noexcept {
  follow_force(sample);
  last_t_s_ = sample.t_s;
  const double slip_percent = sample.slip_percent;
  if (force_.step(sample.t_s, sample.clamp_force_N, 0.0)) force_line_ = force_.line();
  if (torque_.step(sample.t_s, sample.torque_Nm, slip_percent)) {
    torque_line_ = torque_.line();
    if (torque_estimate_count_ % kSlowEvery == 0) torque_slow_variance_ = torque_.slow_variance();
    last_held_s_ = sample.t_s;
    torque_estimates_[torque_estimate_count_++ % torque_estimates_.size()] = {
        torque_line_.at(last_held_s_), torque_line_.variance_at(last_held_s_), torque_line_.valid};
  }
  // Before the force falls, the load is being taken up. From then on no sample is left out, also
  // where noise lifts the force again: across a gap a torque that swings seems to step.
  if (!lowered_ && force_line_.valid) {
    const double force_N = force_line_.at(sample.t_s);
    if (first_force_N_ <= 0.0) first_force_N_ = force_N;
    lowered_ = force_N < kLowered * first_force_N_;
  }
  if (lowered_ && torque_watch_.step(sample.torque_Nm, slip_percent, slip_noise_percent2_s(),
                                     torque_, torque_slow_variance_)) {
    torque_stepped_s_ = std::min(torque_stepped_s_, sample.t_s);
  }
  if (!slips_) {
    omega_p_.step(sample.t_s, sample.omega_p_rad_s, 0.0);
    slip_speed_.step(sample.t_s, slip_percent * sample.omega_p_rad_s, 0.0);
  }
  last_omega_rad_s_ = sample.omega_p_rad_s;
  return history_.step(sample);
}

ExperimentRecord::TorqueEstimate ExperimentRecord::torque_estimate_at(double t_s) const noexcept {
  const double ago = std::ceil((last_held_s_ - t_s) / torque_.cell_s());
  const auto cells = static_cast<std::size_t>(std::max(0.0, ago));
  if (cells >= std::min(torque_estimate_count_, torque_estimates_.size())) return {};
  return torque_estimates_[(torque_estimate_count_ - 1 - cells) % torque_estimates_.size()];
}

}  // namespace beltgrip::estimator
