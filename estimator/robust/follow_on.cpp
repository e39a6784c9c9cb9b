#include "estimator/robust/follow_on.h"

#include <algorithm>
#include <cmath>

#include "estimator/robust/thresholds.h"
#include "estimator/statistics/square.h"

namespace beltgrip::estimator {
namespace {

// Before the stop, in cells of the finest level. Chosen, as the least weight: a fifth less or more
// of kCellsBefore or kWeightLeast changes no result, value or stop of 120 drawn traces.
constexpr std::size_t kBeforeCell = 10, kCellsBefore = 5;
constexpr double kWeightLeast = 5.0;

}  // namespace

void FollowOn::Mean::add(double after_s, const Cell& cell) noexcept {
  n += 1.0;
  t_s += after_s;
  slip_percent += cell.slip_percent;
  clamp_force_N += cell.clamp_force_N;
}

void FollowOn::begin(const ExperimentRecord& record) noexcept {
  const History& history = record.history();
  if (begun_ || history.size(0) < kBeforeCell + kCellsBefore) return;
  begun_ = true;
  stop_t_s_ = record.duration_s();
  slip_noise_percent2_s_ = record.slip_noise_percent2_s();
  force_variance_N2_ = record.force().density(kMean_s) / kMean_s;
  before_cells_s_ = history.cell_s(0) * static_cast<double>(kCellsBefore);
  for (std::size_t i = kBeforeCell; i < kBeforeCell + kCellsBefore; ++i) {
    const Cell& cell = history.cell(0, i);
    before_.add(cell.t_s - stop_t_s_, cell);
  }
}

void FollowOn::step(const Cell& sample) noexcept {
  after_s_ = sample.t_s - stop_t_s_;
  if (!begun_ || after_s_ > kTo_s) return;
  if (std::abs(after_s_ - kMiddle_s) < 0.5 * kMean_s) middle_.add(after_s_, sample);
  if (after_s_ > kTo_s - kMean_s) late_.add(after_s_, sample);
  if (after_s_ < kMiddle_s) return;
  const double t = after_s_ - kMiddle_s;
  n_ += 1.0;
  t_ += t;
  tt_ += t * t;
  omega_ += sample.omega_p_rad_s;
  omega_t_ += sample.omega_p_rad_s * t;
  torque_ += sample.torque_Nm;
  force_ += sample.clamp_force_N;
}

// Whoever lowers the clamp force lets it stand or lowers it on: beyond noise it only rises when it
// is given back.
bool FollowOn::clamped_again() const noexcept {
  const double lowest_N = std::min(before_.force_N(), middle_.force_N());
  return late_.force_N() - lowest_N > kEvident * std::sqrt(2.0 * force_variance_N2_);
}

double FollowOn::carried(double traction_per_Nm_N, double inertia_kg_m2) const noexcept {
  const double acceleration = (omega_t_ - omega_ * t_ / n_) / (tt_ - square(t_) / n_);
  return traction_per_Nm_N * (torque_ - n_ * inertia_kg_m2 * acceleration) / force_;
}

bool FollowOn::stood_still(double mu, double traction_per_Nm_N,
                           double inertia_kg_m2) const noexcept {
  if (middle_.n < kWeightLeast || late_.n < kWeightLeast || !(force_ > 0.0)) return false;
  if (clamped_again()) return false;
  if (carried(traction_per_Nm_N, inertia_kg_m2) < kUnmoved * mu) return false;
  // Slip gained around the stop, less what the later pace, so many times over, would have gained.
  const double times =
      kSlower * (middle_.at_s() - before_.at_s()) / (late_.at_s() - middle_.at_s());
  const double gained = middle_.mean_slip_percent() - before_.mean_slip_percent();
  const double later = late_.mean_slip_percent() - middle_.mean_slip_percent();
  const double variance = slip_noise_percent2_s_ *
                          (1.0 / before_cells_s_ + (square(1.0 + times) + square(times)) / kMean_s);
  return gained - times * later > kEvident * std::sqrt(variance);
}

}  // namespace beltgrip::estimator
