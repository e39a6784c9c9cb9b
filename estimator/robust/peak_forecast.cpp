#include "estimator/robust/peak_forecast.h"

#include <algorithm>
#include <cmath>

#include "estimator/robust/thresholds.h"
#include "estimator/statistics/interval.h"
#include "estimator/statistics/square.h"

namespace beltgrip::estimator {
namespace {

constexpr double kLargestU = 4.0;
constexpr double kFirstPeak_percent = 0.6;
constexpr double kPeakFactor = 1.16;
constexpr double kDeformationStep_percent = 0.5;  // at the first force
// Widths of the linear parameters, 1 deviation: half a step of the grids.
constexpr double kDeformation_percent = 0.25;
constexpr double kPeakShift = 0.08;
constexpr double kScale = 3.0;  // of m, in units of the largest mu* so far
// A point is complete when force or slip has moved on.
constexpr double kForceStep = 0.02;  // relative
constexpr double kSlipStep_percent = 0.08;
constexpr double kShortestPoint_s = 0.05;
// Chosen: 4 and 6 change no result, value or stop of 120 drawn traces.
constexpr std::size_t kForecastPoints = 5;
constexpr double kLeastPossible = 1e-3;
// Curves that are less likely than the best by more than this do not count (of the logarithm), and
// beyond the second are never looked at again: evidence does not turn round by so much.
constexpr double kCounts = 25.0;
constexpr double kForgotten = 40.0;
// Work, in instructions as callgrind counts them in a release build over the ramp of
// tests/instructions: that of one second, and of one curve.
constexpr double kWork_per_s = 0.82e6;
constexpr int kWorkLook = 30, kWorkAdd = 140, kWorkFit = 350, kWorkSum = 380;

constexpr double kNone = -1e300;  // of a logarithm
constexpr double kSmallWeights = 1e-100;
constexpr double kLowest = -0.7, kHighest = 1.8;  // of the histogram

double tanh_form(double u, double a) { return std::tanh(a * u) / std::tanh(a); }
double brush_form(double u, double n) { return 1.0 - std::pow(1.0 - u, n); }
double magic_form(double u, double C) {
  return std::sin(C * std::atan(std::tan(1.5707963267948966 / C) * u));
}
double exponential_form(double u, double p) { return std::pow(u * std::exp(1.0 - u), p); }

struct Form {
  double (*function)(double u, double parameter);
  double parameter;
};
constexpr Form kFormTable[] = {{tanh_form, 1.5},        {tanh_form, 2.0},       {tanh_form, 2.6},
                               {brush_form, 2.0},       {brush_form, 3.0},      {brush_form, 4.5},
                               {magic_form, 1.15},      {magic_form, 1.3},      {magic_form, 1.6},
                               {exponential_form, 1.0}, {exponential_form, 0.6}};

}  // namespace

PeakForecast::PeakForecast(double sample_rate_hz)
    : curves_(kCurves),
      order_(kCurves),
      bins_(kBins),
      work_per_step_(static_cast<int>(kWork_per_s / sample_rate_hz)) {
  static_assert(std::size(kFormTable) == kForms);
  std::size_t index = 0;
  for (std::size_t form = 0; form < kForms; ++form) {
    for (std::size_t i = 0; i <= kTable; ++i) {
      const double u = kLargestU * static_cast<double>(i) / kTable;
      value_[form][i] = u <= 1.0 ? kFormTable[form].function(u, kFormTable[form].parameter)
                                 : 1.0 - kFallBeyond * (u - 1.0);
    }
    double slip_peak_percent = kFirstPeak_percent;
    for (std::size_t k = 0; k < kPeaks; ++k, slip_peak_percent *= kPeakFactor) {
      for (std::size_t d = 0; d < kDeformations; ++d) {
        curves_[index].form = form;
        curves_[index].slip_peak_percent = slip_peak_percent;
        curves_[index].deformation =
            kDeformationStep_percent * (static_cast<double>(d) - 0.5 * (kDeformations - 1));
        ++index;
      }
    }
  }
}

void PeakForecast::reset(double traction_per_Nm_N, double inertia_kg_m2) noexcept {
  c_ = traction_per_Nm_N;
  inertia_kg_m2_ = inertia_kg_m2;
  sum_s_ = sum_slip_percent_s_ = sum_torque_ = sum_force_ = 0.0;
  last_slip_percent_ = last_force_N_ = top_mu_ = reached_ = 0.0;
  means_.fill({0.0, 0.0});
  first_force_N_ = 0.0;
  points_ = 0;
  stage_ = Stage::kIdle;
  forecast_ = {};
}

void PeakForecast::collect(const ExperimentRecord& record) noexcept {
  if (!record.force_line().valid || !record.torque_line().valid) return;
  const Cell& cell = record.history().cell(0, 0);
  const double cell_s = record.history().cell_s(0);
  if (sum_s_ == 0.0) {
    begin_s_ = cell.t_s;
    begin_omega_rad_s_ = cell.omega_p_rad_s;
  }
  sum_s_ += cell_s;
  sum_slip_percent_s_ += cell_s * cell.slip_percent;
  sum_torque_ += cell_s * cell.torque_Nm;
  sum_force_ += cell_s * record.clamp_force_N(cell);
  if (sum_s_ < kShortestPoint_s || stage_ != Stage::kIdle) return;
  double torque = sum_torque_ / sum_s_;
  double torque_variance = record.torque_noise_Nm2_s() / sum_s_;
  if (inertia_kg_m2_ > 0.0) {
    const double span_s = cell.t_s - begin_s_;
    torque -= inertia_kg_m2_ * (cell.omega_p_rad_s - begin_omega_rad_s_) / span_s;
    torque_variance += square(inertia_kg_m2_ / span_s) * 2.0 * record.omega_noise_rad2_s() / cell_s;
  }
  const double force = sum_force_ / sum_s_;
  const double slip_percent = sum_slip_percent_s_ / sum_s_;
  const double mu = c_ * torque / force;
  const double mu_deviation = c_ / force * std::sqrt(torque_variance);
  const double slip_variance_percent2 = record.slip_noise_percent2_s() / sum_s_;
  // By force, not by mu*: points that ended where noise lifts mu* would be too high.
  const bool moved = std::abs(force - last_force_N_) > kForceStep * last_force_N_ ||
                     std::abs(slip_percent - last_slip_percent_) >
                         std::max(kSlipStep_percent, 3.0 * std::sqrt(slip_variance_percent2));
  if (!moved || !(mu > 0.0) || !(force > 0.0)) return;
  if (points_ == 0) first_force_N_ = force;
  point_ = {slip_percent, mu, force / first_force_N_, square(mu_deviation), slip_variance_percent2};
  last_force_N_ = force;
  last_slip_percent_ = slip_percent;
  top_mu_ = std::max(top_mu_, mu);
  sum_s_ = sum_slip_percent_s_ = sum_torque_ = sum_force_ = 0.0;
  ++points_;
  stage_ = Stage::kTakeIn;
  next_ = kept_ = 0;
  raise_reached(record.force_line().variance_at(cell.t_s) / square(force));
  if (points_ == 1) left_ = kCurves;
  best_before_ = best_;
  best_ = kNone;
}

// Largest mean over 1, 2, 4, ... neighbouring points, less what its noise and that of the force's
// line may have lifted it by.
void PeakForecast::raise_reached(double force_variance) noexcept {
  for (std::size_t scale = 0; scale < kReachedScales; ++scale) {
    auto& [weight, weighted] = means_[scale];
    const double w = 1.0 / (point_.variance_mu + 1e-12);
    weight += w;
    weighted += w * point_.mu;
    if (points_ % (std::size_t{1} << scale) != 0) continue;
    const double mu = weighted / weight;
    const double deviation = std::sqrt(1.0 / weight + square(mu) * force_variance);
    reached_ = std::max(reached_, mu - kForecastReached * deviation);
    means_[scale] = {0.0, 0.0};
  }
}

// The point into the normal equations of one curve.
void PeakForecast::add_point(Curve& curve) const noexcept {
  if (points_ == 1) {
    curve.A.fill(0.0);
    curve.b.fill(0.0);
    curve.yy = curve.log_weights = 0.0;
    curve.weights = 1.0;
  }
  const auto& table = value_[curve.form];
  const double u =
      (point_.slip_percent - curve.deformation * point_.force_share) / curve.slip_peak_percent;
  const double place = std::min(std::abs(u) / kLargestU, 1.0 - 1e-9) * kTable;
  const auto i = static_cast<std::size_t>(static_cast<int>(place));
  const double step = table[i + 1] - table[i];
  const double g = std::copysign(table[i] + (place - static_cast<double>(i)) * step, u);
  const double slope = step * kTable / kLargestU;
  const double per_percent =
      point_.mu * slope / (std::max(0.3, std::abs(g)) * curve.slip_peak_percent);
  const double form_variance = square(kForecastFormError * point_.mu);
  const double w = 1.0 / (point_.variance_mu + square(per_percent) * point_.variance_slip_percent2 +
                          form_variance);
  const std::array<double, kTerms> phi{slope, slope * point_.force_share, -u * slope, g};
  std::size_t at = 0;
  for (std::size_t row = 0; row < kTerms; ++row) {
    const double weighted = w * phi[row];
    for (std::size_t column = 0; column <= row; ++column) {
      curve.A[at++] += weighted * phi[column];
    }
    curve.b[row] += weighted * point_.mu;
  }
  curve.yy += w * square(point_.mu);
  // Of the logarithm of all weights only what differs between curves; seldom taken.
  curve.weights *= w * form_variance;
  if (curve.weights < kSmallWeights) {
    curve.log_weights += std::log(curve.weights);
    curve.weights = 1.0;
  }
}

// Weighted least squares by elimination; m comes last, so that it needs no substitution back.
void PeakForecast::fit(Curve& curve) const noexcept {
  const double per_shift = square(curve.slip_peak_percent / top_mu_);
  const double per_top = 1.0 / square(top_mu_);
  const std::array<double, kTerms> prior{per_shift * (1.0 / square(kEndStop_percent)),
                                         per_shift * (1.0 / square(kDeformation_percent)),
                                         per_top * (1.0 / square(kPeakShift)),
                                         per_top * (1.0 / square(kScale))};
  std::array<double, 10> R = curve.A;
  std::array<double, kTerms> z = curve.b;
  R[0] += prior[0];
  R[2] += prior[1];
  R[5] += prior[2];
  R[9] += prior[3];
  double explained = 0.0, det = 1.0;
  // Row i, column j of the lower triangle lies at i (i + 1) / 2 + j.
  const auto at = [](std::size_t i, std::size_t j) { return i * (i + 1) / 2 + j; };
  for (std::size_t k = 0; k < kTerms; ++k) {
    const double pivot = R[at(k, k)];
    const double inverse = 1.0 / pivot;
    explained += z[k] * z[k] * inverse;
    det *= pivot;
    for (std::size_t i = k + 1; i < kTerms; ++i) {
      const double factor = R[at(i, k)] * inverse;
      z[i] -= factor * z[k];
      for (std::size_t j = k + 1; j <= i; ++j) R[at(i, j)] -= factor * R[at(j, k)];
    }
  }
  curve.variance = 1.0 / R[9];
  curve.mu = z[3] * curve.variance;
  const double volume = prior[0] * prior[1] * prior[2] * prior[3] / det;
  curve.log_likelihood =
      0.5 * (curve.log_weights + std::log(curve.weights * volume) - (curve.yy - explained));
}

void PeakForecast::take_in() noexcept {
  const bool enough = points_ >= kForecastPoints;
  for (int work = 0; work < work_per_step_ && next_ < left_; ++next_) {
    const std::size_t index = points_ == 1 ? next_ : order_[next_];
    Curve& curve = curves_[index];
    work += kWorkLook;
    if (points_ > kForecastPoints && !(curve.log_likelihood >= best_before_ - kForgotten)) continue;
    order_[kept_++] = static_cast<std::uint16_t>(index);
    add_point(curve);
    work += kWorkAdd;
    if (!enough) continue;
    fit(curve);
    work += kWorkFit;
    if (curve.mu > 0.0 && curve.log_likelihood > best_) best_ = curve.log_likelihood;
  }
  if (next_ < left_) return;
  left_ = kept_;
  stage_ = enough ? Stage::kSum : Stage::kIdle;
  next_ = 0;
  std::fill(bins_.begin(), bins_.end(), 0.0);
  sum_ = sum_all_ = sum_slip_peak_percent_ = 0.0;
}

// Into a histogram over ln(mu_max / top so far), each fit as a normal distribution: three places
// with its mean, variance and kurtosis.
void PeakForecast::sum_up() noexcept {
  const double per_top = 1.0 / top_mu_;
  const auto add = [&](double mu, double weight) {
    sum_all_ += weight;
    if (mu < reached_) return;  // no longer possible
    const double place =
        (std::log(std::max(per_top * mu, 1e-6)) - kLowest) * (kBins / (kHighest - kLowest));
    bins_[static_cast<std::size_t>(std::clamp(place, 0.0, kBins - 1.0))] += weight;
    sum_ += weight;
  };
  for (int work = 0; work < work_per_step_ && next_ < left_; ++next_) {
    const Curve& curve = curves_[order_[next_]];
    work += kWorkLook;
    if (!(curve.mu > 0.0) || !(curve.log_likelihood > best_ - kCounts)) continue;
    work += kWorkSum;
    const double weight = std::exp(kOwnEvidence * (curve.log_likelihood - best_));
    const double away = std::sqrt(3.0 * curve.variance);
    add(curve.mu, weight * 2.0 / 3.0);
    add(curve.mu + away, weight / 6.0);
    add(curve.mu - away, weight / 6.0);
    sum_slip_peak_percent_ +=
        weight * (curve.slip_peak_percent + curve.deformation * point_.force_share);
  }
  if (next_ == left_) stage_ = Stage::kQuantiles;
}

void PeakForecast::conclude() noexcept {
  forecast_ = {};
  // Where next to nothing of them is possible any more, no form is the curve's.
  if (!(sum_ > kLeastPossible * sum_all_)) return;
  const std::array<double, 3> shares{kTail95, 0.5, kUpper95};
  std::array<double, 3> quantiles{};
  quantiles.fill(top_mu_ * std::exp(kHighest));
  double below = 0.0;
  std::size_t wanted = 0;
  for (std::size_t i = 0; i < kBins && wanted < shares.size(); ++i) {
    while (wanted < shares.size() && below + bins_[i] >= shares[wanted] * sum_) {
      const double part = (shares[wanted] * sum_ - below) / bins_[i];
      const double place = (static_cast<double>(i) + part) / kBins;
      quantiles[wanted++] = top_mu_ * std::exp(kLowest + (kHighest - kLowest) * place);
    }
    below += bins_[i];
  }
  forecast_ = {true, quantiles[1], quantiles[0], quantiles[2], sum_slip_peak_percent_ / sum_all_};
}

bool PeakForecast::step() noexcept {
  switch (stage_) {
    case Stage::kIdle:
      return false;
    case Stage::kTakeIn:
      take_in();
      return false;
    case Stage::kSum:
      sum_up();
      return false;
    case Stage::kQuantiles:
      conclude();
      stage_ = Stage::kIdle;
      return true;
  }
  return false;
}

}  // namespace beltgrip::estimator
