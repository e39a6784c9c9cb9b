#include "estimator/paper/paper_estimator.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "estimator/method/possible_friction.h"
#include "estimator/paper/kalman.h"
#include "estimator/physics/sensor_error.h"
#include "estimator/physics/units.h"
#include "estimator/signal/excitation.h"
#include "estimator/signal/signal_chain.h"
#include "estimator/statistics/interval.h"

namespace beltgrip::estimator {
namespace {

constexpr double kMeasurementVariance = 1.0;  // R, equation (20)
constexpr double kTableRate_hz = 200.0;       // at which Table I was chosen

class PaperEstimator final : public SlipCurveEstimator {
 public:
  PaperEstimator(const EstimatorSettings& settings, const VariatorParameters& variator,
                 const SensorAccuracies& accuracies)
      : settings_(settings),
        variator_(variator),
        accuracies_(accuracies),
        chain_(settings, variator, settings.lowpass_hz),
        excitation_(settings.window_s, settings.sample_rate_hz, settings.excitation_threshold),
        process_variance_(Eigen::Vector2d(settings.slope_variance, settings.offset_variance) *
                          (kTableRate_hz / settings.sample_rate_hz)) {
    PaperEstimator::reset();
  }

  void reset() noexcept override {
    chain_.reset();
    excitation_.reset();
    filter_ = {Eigen::Vector2d(settings_.initial_slope, 0.0), Eigen::Matrix2d::Zero()};
    began_ = near_peak_ = false;
    out_ = {};
    peak_ = {};
    forget_samples();
    largest_mu_ = largest_slip_percent_ = 0.0;
  }

  const CurveEstimate& step(const VariatorSample& sample) noexcept override {
    const Measurement& now = chain_.step(sample);
    out_.t_ns = sample.t_ns;
    out_.usable = now.usable;
    if (out_.stop == StopReason::kNone) out_.stop = now.stop;
    if (!now.usable) return out_;

    excitation_.step(now.slip_percent);
    const bool pause_ends = began_ && settings_.reopening == Reopening::kPaused;
    if (excitation_.opened() && !pause_ends) {
      begin(now);
    } else if (excitation_.open()) {
      kalman_step(filter_, now.slip_percent, now.mu_star, process_variance_, kMeasurementVariance);
    }
    publish(now);
    if (now.mu_star > largest_mu_) {
      largest_mu_ = now.mu_star;
      largest_slip_percent_ = now.slip_percent;
      largest_mu_force_N_ = now.clamp_force_N;
      largest_mu_omega_s_rad_s_ = now.omega_s_rad_s;
    }
    if (out_.stop != StopReason::kNone || !excitation_.open()) return out_;
    const bool was_near_peak =
        std::exchange(near_peak_, std::abs(out_.friction_slope) < settings_.peak_slope);
    if (near_peak_) {
      if (!was_near_peak && settings_.peak_samples == PeakSamples::kLast) forget_samples();
      collect(now);
    }
    if (out_.friction_slope < settings_.stop_slope) out_.stop = StopReason::kSlope;
    return out_;
  }

  bool conclude() noexcept override {
    if (peak_samples_ > 0) {
      conclude_value();
    } else if (largest_mu_ > 0.0) {
      // No sample near a peak: all that is known is the largest mu* that was seen. The method
      // itself says nothing of its noise.
      peak_ = {.kind = PeakKind::kLowerBound,
               .mu_max = largest_mu_,
               .sigma_peak_percent = largest_slip_percent_,
               .samples = 1,
               .clamp_force_N = largest_mu_force_N_,
               .omega_s_rad_s = largest_mu_omega_s_rad_s_};
    } else {
      peak_ = {};
    }
    refuse_impossible(peak_, settings_.reading_reach);
    return true;
  }

  const PeakEstimate& peak() const noexcept override { return peak_; }

 private:
  // The line through this sample, with an initial or the held slope.
  void begin(const Measurement& now) noexcept {
    const bool anew = !began_ || settings_.reopening == Reopening::kInitialSlope;
    const double slope = anew ? settings_.initial_slope : filter_.x[0];
    filter_ = {Eigen::Vector2d(slope, now.mu_star - slope * now.slip_percent),
               settings_.initial_variance * Eigen::Matrix2d::Identity()};
    began_ = true;
  }

  void forget_samples() noexcept {
    peak_samples_ = 0;
    mean_ = squares_ = slip_mean_percent_ = force_mean_ = torque_mean_ = omega_s_mean_ = 0.0;
  }

  void publish(const Measurement& now) noexcept {
    out_.mu_star = now.mu_star;
    out_.sigma_star_percent = now.slip_percent;
    out_.slip_variance = excitation_.variance();
    out_.friction_slope = filter_.x[0];
    out_.clamp_force_N = now.clamp_force_N;
    out_.torque_p_Nm = now.torque_p_Nm;
    out_.slip_energy_J += std::max(0.0, now.slip_percent / kPercent) * std::abs(now.torque_p_Nm) *
                          now.omega_p_rad_s / settings_.sample_rate_hz;
    out_.direction = chain_.point().direction;
    out_.end_stop = chain_.point().end_stop;
    // Bands of Figures 7 to 9. Between -c_m and c_k, where the peak has been passed but the stop
    // has not come (empty with Table I), the phase is still the peak's.
    if (!excitation_.open()) {
      out_.phase = Phase::kQuiet;
    } else if (out_.friction_slope > settings_.peak_slope) {
      out_.phase = Phase::kExcited;
    } else if (out_.friction_slope < settings_.stop_slope) {
      out_.phase = Phase::kMacroSlip;
    } else {
      out_.phase = Phase::kPeak;
    }
  }

  void collect(const Measurement& now) noexcept {
    ++peak_samples_;
    const double weight = 1.0 / static_cast<double>(peak_samples_);
    const double before = now.mu_star - mean_;
    mean_ += before * weight;
    squares_ += before * (now.mu_star - mean_);
    slip_mean_percent_ += (now.slip_percent - slip_mean_percent_) * weight;
    force_mean_ += (now.clamp_force_N - force_mean_) * weight;
    torque_mean_ += (std::abs(now.torque_p_Nm) - torque_mean_) * weight;
    omega_s_mean_ += (now.omega_s_rad_s - omega_s_mean_) * weight;
  }

  void conclude_value() noexcept {
    const double deviation = std::sqrt(squares_ / static_cast<double>(peak_samples_));
    const double sensors = mean_ * relative_sensor_deviation(variator_, accuracies_, torque_mean_,
                                                             force_mean_, omega_s_mean_);
    peak_ = {.kind = PeakKind::kValue,
             .mu_max = mean_,
             .mu_max_std = std::hypot(std::max(deviation, kSmallestStd), sensors),
             .sigma_peak_percent = slip_mean_percent_,
             .samples = peak_samples_};
    peak_.ci95_low = mean_ - kNormal95 * peak_.mu_max_std;
    peak_.ci95_high = mean_ + kNormal95 * peak_.mu_max_std;
    const double noise = kNormal95 * std::max(deviation, kSmallestStd);
    peak_.noise_low = mean_ - noise;
    peak_.noise_high = mean_ + noise;
    peak_.clamp_force_N = force_mean_;
    peak_.omega_s_rad_s = omega_s_mean_;
  }

  EstimatorSettings settings_;
  VariatorParameters variator_;
  SensorAccuracies accuracies_;
  SignalChain chain_;
  SlipExcitation excitation_;
  Eigen::Vector2d process_variance_;
  LineFilter filter_;
  bool began_ = false;      // the gate has been open
  bool near_peak_ = false;  // the last sample with the gate open
  CurveEstimate out_;
  PeakEstimate peak_;
  std::int64_t peak_samples_ = 0;
  double mean_ = 0.0, squares_ = 0.0;  // of mu* over the samples near the peak
  double slip_mean_percent_ = 0.0, force_mean_ = 0.0, torque_mean_ = 0.0, omega_s_mean_ = 0.0;
  double largest_mu_ = 0.0, largest_slip_percent_ = 0.0, largest_mu_force_N_ = 0.0;
  double largest_mu_omega_s_rad_s_ = 0.0;
};

}  // namespace

std::unique_ptr<SlipCurveEstimator> make_paper_estimator(const EstimatorSettings& settings,
                                                         const VariatorParameters& variator,
                                                         const SensorAccuracies& accuracies) {
  return std::make_unique<PaperEstimator>(settings, variator, accuracies);
}

}  // namespace beltgrip::estimator
