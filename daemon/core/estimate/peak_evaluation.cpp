#include "daemon/core/estimate/peak_evaluation.h"

#include <algorithm>
#include <cmath>

#include "estimator/method/possible_friction.h"
#include "estimator/physics/slip.h"
#include "estimator/statistics/interval.h"

namespace beltgrip::daemon {

using estimator::PeakKind;

namespace {

constexpr double kBoundMargin = 0.97;  // of mu* carried without a ramp

// One standard deviation of mu_max by noise and the form of the curve.
double noise_std(const estimator::PeakEstimate& peak) noexcept {
  return (peak.noise_high - peak.noise_low) / (2.0 * estimator::kNormal95);
}

}  // namespace

PeakEvaluation::PeakEvaluation(const Config& config) : config_(config) {
  if (config.friction_is_assumed) {
    assumptions_.emplace(config.variator, config.sensors, config.assumed_constants);
  }
}

void PeakEvaluation::begin() noexcept {
  next_ = Next::kCurve;
  peak_ = {};
  sensor_std_ = 0.0;
}

bool PeakEvaluation::step(EstimateStage& estimate, const EndedExperiment& ended,
                          const estimator::VariatorSample& sample) noexcept {
  if (next_ == Next::kCurve) {
    if (!estimate.conclude()) return false;
    read_peak(estimate, ended, sample);
    begin_weighing(ended, peak_.kind == PeakKind::kNone ? 0.0 : peak_.mu_max, peak_.clamp_force_N,
                   peak_.kind == PeakKind::kValue ? noise_std(peak_) / peak_.mu_max : 0.0);
    next_ = Next::kPeak;
    if (weighing_) return false;
  }
  if (weighing_ && !assumptions_->step()) return false;
  if (next_ == Next::kPeak) {
    if (weighing_) weigh_peak();
    estimator::refuse_no_belt(peak_);
    begin_weighing(ended, peak_.contradictory ? top_reached(ended) : 0.0, top_force_N(ended), 0.0);
    next_ = Next::kTop;
    if (weighing_) return false;
  }
  if (next_ == Next::kTop) weigh_top(ended);
  next_ = Next::kDone;
  return true;
}

void PeakEvaluation::read_peak(const EstimateStage& estimate, const EndedExperiment& ended,
                               const estimator::VariatorSample& sample) noexcept {
  peak_ = estimate.peak();
  if (!ended.ramped) {
    bound_only(estimate.curve(), sample.omega_s_rad_s);
  } else if (!ended.passed_a_peak && peak_.kind == PeakKind::kValue) {
    peak_.kind = PeakKind::kLowerBound;
    peak_.mu_max = peak_.ci95_low;
  }
  if (peak_.kind == PeakKind::kValue) friction_as_read_ = peak_.mu_max;
}

// Without a ramp the data hold no peak, only what the belt carried.
void PeakEvaluation::bound_only(const estimator::CurveEstimate& curve,
                                double omega_s_rad_s) noexcept {
  const double carried = kBoundMargin * std::abs(curve.mu_star);
  peak_ = {};
  if (!(carried > 0.0)) return;
  peak_.kind = PeakKind::kLowerBound;
  peak_.mu_max = carried;
  peak_.clamp_force_N = curve.clamp_force_N;
  peak_.omega_s_rad_s = omega_s_rad_s;
}

// Of a friction mu, read at this clamp force; 0: there is nothing to be weighed.
void PeakEvaluation::begin_weighing(const EndedExperiment& ended, double mu, double force_N,
                                    double relative_noise) noexcept {
  weighing_ = assumptions_ && mu > 0.0 && force_N > 0.0;
  if (!weighing_) return;
  estimator::PeakReading reading = reading_at(ended, mu, force_N);
  reading.relative_noise = relative_noise;
  assumptions_->begin(reading);
}

// Points that lie on no one curve have a top all the same: the belt slipped there.
double PeakEvaluation::top_reached(const EndedExperiment& ended) const noexcept {
  if (peak_.mu_refused > 0.0) return peak_.mu_refused;
  return ended.ended_by_slip ? ended.mu_star_most : 0.0;
}

double PeakEvaluation::top_force_N(const EndedExperiment& ended) const noexcept {
  return peak_.clamp_force_N > 0.0 ? peak_.clamp_force_N : ended.clamp_force_end_N;
}

void PeakEvaluation::weigh_top(const EndedExperiment& ended) noexcept {
  const double reached = top_reached(ended);
  if (peak_.contradictory && reached > 0.0 && top_force_N(ended) > 0.0) {
    estimator::FrictionSpread top{reached, reached, reached};
    if (weighing_ && assumptions_) top = assumptions_->spread();
    peak_.impossible = top.high < estimator::kBeltLeast || top.low > estimator::kBeltMost;
    if (peak_.impossible) peak_.mu_refused = reached;
  }
  if (peak_.kind != PeakKind::kValue) return;
  const double noise = noise_std(peak_);
  sensor_std_ = std::sqrt(std::max(0.0, peak_.mu_max_std * peak_.mu_max_std - noise * noise));
}

estimator::PeakReading PeakEvaluation::reading_at(const EndedExperiment& ended, double mu,
                                                  double force_N) const noexcept {
  const bool overdrive = ended.end_stop == estimator::EndStop::kOverdrive;
  const double ratio = overdrive ? config_.variator.ratio_overdrive : config_.variator.ratio_low;
  const double sign = ended.direction == estimator::Direction::kDrive ? 1.0 : -1.0;
  const double duration_s = seconds(std::max(ended.duration, kNanosecond));
  estimator::PeakReading reading;
  reading.end_stop = ended.end_stop;
  reading.mu = mu;
  reading.clamp_force_N = force_N;
  reading.torque_Nm = estimator::torque_carried_Nm(config_.variator, ended.end_stop, force_N, mu);
  const double omega_s_rad_s = peak_.omega_s_rad_s;
  reading.omega_s_rad_s = omega_s_rad_s > 0.0 ? omega_s_rad_s : ended.omega_s_end_rad_s;
  // The primary speed itself falls or rises by slip at the end.
  reading.acceleration_rad_s2 =
      sign * (ended.omega_s_end_rad_s - ended.omega_s_start_rad_s) / (ratio * duration_s);
  return reading;
}

void PeakEvaluation::weigh_peak() noexcept {
  if (!assumptions_) return;
  const estimator::FrictionSpread& spread = assumptions_->spread();
  if (peak_.kind == PeakKind::kLowerBound) {
    peak_.mu_max = std::min(peak_.mu_max, spread.low);
    return;
  }
  const double scale = spread.median / peak_.mu_max;
  peak_.mu_max = spread.median;
  peak_.ci95_low = spread.low;
  peak_.ci95_high = spread.high;
  peak_.mu_max_std = (spread.high - spread.low) / (2.0 * estimator::kNormal95);
  peak_.noise_low *= scale;
  peak_.noise_high *= scale;
}

}  // namespace beltgrip::daemon
