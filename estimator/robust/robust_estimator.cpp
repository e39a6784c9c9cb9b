#include "estimator/robust/robust_estimator.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "estimator/method/possible_friction.h"
#include "estimator/physics/clamp_force.h"
#include "estimator/physics/sensor_error.h"
#include "estimator/physics/units.h"
#include "estimator/reading/channel_reading.h"
#include "estimator/record/experiment_record.h"
#include "estimator/robust/after_stop.h"
#include "estimator/robust/follow_on.h"
#include "estimator/robust/force_step.h"
#include "estimator/robust/peak_fit.h"
#include "estimator/robust/peak_forecast.h"
#include "estimator/robust/stop_detector.h"
#include "estimator/robust/thresholds.h"
#include "estimator/signal/excitation.h"
#include "estimator/signal/signal_chain.h"
#include "estimator/statistics/interval.h"

namespace beltgrip::estimator {
namespace {

constexpr double kPublished_hz = 8.0;  // low-pass of the published mu* and slip only
constexpr double kExcitationWindow_s = 1.0;
constexpr int kFollowedPerStep = 3;
constexpr double kNoiseKnown_s = 1.0;

class RobustEstimator final : public SlipCurveEstimator {
 public:
  RobustEstimator(const EstimatorSettings& settings, const VariatorParameters& variator,
                  const SensorAccuracies& accuracies)
      : variator_(variator),
        accuracies_(accuracies),
        sample_rate_hz_(settings.sample_rate_hz),
        reading_reach_(settings.reading_reach),
        value_width_(settings.value_width),
        confidence_width_(settings.stop_rule == StopRule::kConfidence ? settings.confidence_width
                                                                      : 0.0),
        inertia_kg_m2_(settings.torque_is_engine ? variator.primary_inertia_kg_m2 : 0.0),
        chain_(settings, variator, kPublished_hz),
        excitation_(kExcitationWindow_s, settings.sample_rate_hz, 0.0),
        record_(settings.sample_rate_hz),
        after_stop_(settings.sample_rate_hz),
        force_step_(settings.sample_rate_hz,
                    variator.secondary_piston_area_m2 * settings.pressure_step_Pa),
        peak_forecast_(settings.sample_rate_hz),
        pressure_(settings.sample_rate_hz),
        torque_(settings.sample_rate_hz, settings.torque_is_engine),
        omega_p_(settings.sample_rate_hz),
        omega_s_(settings.sample_rate_hz) {
    RobustEstimator::reset();
  }

  void reset() noexcept override {
    chain_.reset();
    excitation_.reset();
    record_.reset();
    force_step_.reset();
    for (ChannelReading* each : {&pressure_, &torque_, &omega_p_, &omega_s_}) each->reset();
    out_ = {};
    peak_ = {};
    first_t_ns_ = 0;
    after_stop_.reset();
    follow_on_.reset();
    next_after_ = 0;
    narrow_ = 0;
    first_mu_ = first_force_N_ = 0.0;
    started_ = concluding_ = concluded_ = false;
    waiting_ = stepped_ = at_the_top_ = false;
  }

  const CurveEstimate& step(const VariatorSample& read) noexcept override {
    const bool ended = out_.stop != StopReason::kNone || concluding_ || concluded_;
    const VariatorSample sample = ended ? read : without_glitches(read);
    const Measurement& now = chain_.step(sample);
    out_.t_ns = sample.t_ns;
    out_.usable = now.usable;
    if (out_.stop == StopReason::kNone) out_.stop = now.stop;
    if (!now.usable) return out_;
    publish(now);
    if (ended) {
      if (started_) {
        after_stop_.step(cell_of(sample), ahead_s(sample));
        follow_on_.step(cell_of(sample));
      }
      stepped_ = true;
      return out_;
    }
    if (!started_) {
      started_ = true;
      first_t_ns_ = sample.t_ns;
      traction_ = traction_coefficient(variator_, chain_.point(), chain_.point().sign, 1.0);
      detector_.reset(traction_, inertia_kg_m2_);
      peak_forecast_.reset(traction_, inertia_kg_m2_);
    }
    pressure_.follow(read.secondary_pressure_Pa);
    torque_.follow(read.torque_Nm);
    omega_p_.follow(read.omega_p_rad_s);
    omega_s_.follow(read.omega_s_rad_s);
    const Cell cell = cell_of(sample);
    watch_force(cell, ahead_s(sample));
    if (record_.step(cell)) decide();
    if (peak_forecast_.step()) expect();
    return out_;
  }

  void ends_at_the_top() noexcept override { at_the_top_ = true; }

  bool conclude() noexcept override {
    if (concluded_ || !started_) return true;
    const bool stepped = stepped_;
    stepped_ = false;
    if (!concluding_) {
      concluding_ = true;
      peak_ = {};
      if (out_.stop == StopReason::kConfidence) {
        take_expected();
        return conclude_with_readings();
      }
      if (out_.stop == StopReason::kNone) after_stop_.begin(record_);  // ended by the caller
      stop_s_ = record_.duration_s();
      // What the belt did next may tell what the curve up to the stop leaves open.
      waiting_ = out_.stop == StopReason::kSlope || at_the_top_;
      if (!waiting_) begin_fit();
      return false;
    }
    if (waiting_) {
      if (after_stop_.over() || !stepped) join_what_followed();
      return false;
    }
    if (!fit_.step()) return false;
    if (stepped && follow_on_.waits()) return false;
    judge();
    return conclude_with_readings();
  }

  const PeakEstimate& peak() const noexcept override { return peak_; }

 private:
  bool conclude_with_readings() noexcept {
    refuse_impossible(peak_, reading_reach_);
    const auto tell = [this](Channel channel, const ChannelReading& reading) {
      peak_.readings[static_cast<std::size_t>(channel)] =
          reading.status(first_t_ns_, record_.duration_s());
    };
    tell(Channel::kPrimarySpeed, omega_p_);
    tell(Channel::kSecondarySpeed, omega_s_);
    tell(Channel::kSecondaryPressure, pressure_);
    tell(Channel::kTorque, torque_);
    return concluded_ = true;
  }

  Cell cell_of(const VariatorSample& sample) const noexcept {
    const double sign = chain_.point().sign;
    return {
        .t_s = static_cast<double>(sample.t_ns - first_t_ns_) * kNanosecond_s,
        .slip_percent = slip_percent(chain_.point(), sample.omega_p_rad_s, sample.omega_s_rad_s),
        .torque_Nm = sign * sample.torque_Nm,
        .clamp_force_N =
            secondary_clamp_force_N(variator_, sample.secondary_pressure_Pa, sample.omega_s_rad_s),
        .omega_p_rad_s = sign * sample.omega_p_rad_s};
  }

  static double ahead_s(const VariatorSample& sample) noexcept {
    return static_cast<double>(sample.pressure_ahead_ns) * kNanosecond_s;
  }

  void publish(const Measurement& now) noexcept {
    excitation_.step(now.slip_percent);
    out_.mu_star = now.mu_star;
    out_.sigma_star_percent = now.slip_percent;
    out_.slip_variance = excitation_.variance();
    out_.clamp_force_N = now.clamp_force_N;
    out_.torque_p_Nm = now.torque_p_Nm;
    out_.slip_energy_J += std::max(0.0, now.slip_percent / kPercent) * std::abs(now.torque_p_Nm) *
                          now.omega_p_rad_s / sample_rate_hz_;
    out_.direction = chain_.point().direction;
    out_.end_stop = chain_.point().end_stop;
    omega_s_rad_s_ = now.omega_s_rad_s;
  }

  // Noise is taken as if every sample had its own, which is more than there is.
  VariatorSample without_glitches(const VariatorSample& sample) noexcept {
    if (!sample.usable || record_.duration_s() < kNoiseKnown_s) return sample;
    for (const double value : {sample.omega_p_rad_s, sample.omega_s_rad_s, sample.torque_Nm}) {
      if (!std::isfinite(value)) return sample;
    }
    const auto least = [this](double density) {
      return kInManyLooks * std::sqrt(density * sample_rate_hz_);
    };
    const double glitch_share =
        std::max(kGlitchSlip_share, least(record_.slip_noise_percent2_s()) / kPercent);
    VariatorSample clean = sample;
    clean.omega_p_rad_s = omega_p_.without_glitch(sample.omega_p_rad_s, glitch_share, 0.0);
    clean.omega_s_rad_s = omega_s_.without_glitch(sample.omega_s_rad_s, glitch_share, 0.0);
    clean.torque_Nm = torque_.without_glitch(sample.torque_Nm, kGlitchTorque,
                                             least(record_.torque_noise_Nm2_s()));
    if (omega_p_.jumped()) omega_p_.take_step(record_.duration_s());
    if (omega_s_.jumped()) omega_s_.take_step(record_.duration_s());
    return clean;
  }

  void begin_fit() noexcept { fit_.begin(record_, traction_, inertia_kg_m2_, stop_s_); }

  void watch_force(const Cell& cell, double pressure_ahead_s) noexcept {
    if (force_step_.step(cell, pressure_ahead_s, record_.slip_noise_percent2_s(),
                         record_.force())) {
      pressure_.take_step(cell.t_s);
    }
  }

  // Some of the samples after the stop join the record; after the last one the curve is fitted.
  void join_what_followed() noexcept {
    record_.slips();
    for (int i = 0; i < kFollowedPerStep && next_after_ < after_stop_.size(); ++i) {
      const Cell& cell = after_stop_[next_after_++];
      watch_force(cell, 0.0);
      record_.step(cell);
    }
    if (next_after_ < after_stop_.size()) return;
    waiting_ = false;
    begin_fit();
  }

  void decide() noexcept {
    out_.stop = detector_.step(record_);
    if (first_mu_ <= 0.0) first_mu_ = out_.mu_star;
    if (first_force_N_ <= 0.0) first_force_N_ = out_.clamp_force_N;
    // Slip that grows while neither the force is lowered nor mu* climbs: a channel stands still.
    const bool still =
        pressure_.verdict() == ReadingVerdict::kFrozen ||
        (out_.mu_star < kClimb * first_mu_ && out_.clamp_force_N > kUnmoved * first_force_N_);
    if ((out_.stop == StopReason::kSlope && still) ||
        (out_.stop != StopReason::kNone &&
         (stands_still() || !is_possible(out_.mu_star, reading_reach_)))) {
      out_.stop = StopReason::kInputs;
    }
    out_.friction_slope = detector_.slope();
    if (out_.stop != StopReason::kNone) {
      after_stop_.begin(record_);
      follow_on_.begin(record_);
      out_.phase = Phase::kMacroSlip;
    } else if (detector_.level()) {
      out_.phase = Phase::kPeak;
    } else {
      out_.phase = detector_.rising() ? Phase::kExcited : Phase::kQuiet;
    }
    peak_forecast_.collect(record_);
  }

  // A torque that never moved is none where the shafts move. Slip and inertia torque that are not
  // there come in the place of a speed that stands still.
  bool stands_still() const noexcept {
    const ReadingVerdict torque = torque_.verdict();
    return torque == ReadingVerdict::kFrozen ||
           (torque == ReadingVerdict::kNeverMoved && omega_p_.moves()) ||
           omega_p_.verdict() == ReadingVerdict::kFrozen ||
           omega_s_.verdict() == ReadingVerdict::kFrozen;
  }

  // What the curve may still rise by beyond the data, up to where friction counts; 1.96 deviations.
  // It rises with probability 1 - inside, else not at all: by a slope that the data do not show,
  // and as a power law of the slope that they show. In drive what the clamp force deforms is read
  // as slip: the belt may slip by less.
  double further_rise(const PeakFitResult& fit) const noexcept {
    const bool drive = chain_.point().direction == Direction::kDrive;
    const double deformed =
        drive ? kPercent * kDeformationMost_1_N * record_.force_line().at(record_.duration_s())
              : 0.0;
    const double to_come = std::max(0.0, kFrictionTo_percent - (fit.end_slip_percent - deformed));
    const double unseen = kNormal95 * std::sqrt(1.0 - fit.inside) * kUnseenRise * fit.mu * to_come;
    // Of all slips that it may be, the one from which a power law rises most.
    const double slip_percent =
        std::min(fit.end_slip_percent,
                 std::max(fit.end_slip_percent - deformed, kFrictionTo_percent / std::numbers::e));
    if (!(slip_percent > 0.0)) return unseen;
    const double seen =
        fit.end_rise * slip_percent * std::max(0.0, std::log(kFrictionTo_percent / slip_percent));
    return std::hypot(unseen, seen);
  }

  // A value is an interval that is narrow enough, whether friction turned down or lies level.
  bool is_value(double mu, double noise_low, double noise_high) const noexcept {
    return 0.5 * (noise_high - noise_low) <= value_width_ * mu;
  }

  // What the curve so far says of its top, with the sensors' constant errors; enough for a stop?
  void expect() noexcept {
    const Forecast& forecast = peak_forecast_.forecast();
    if (!forecast.valid) {
      out_.mu_max_expected = out_.mu_max_low = out_.mu_max_high = 0.0;
      narrow_ = 0;
      return;
    }
    const double mu = forecast.mu_max;
    const double alike = alike_variance(record_.duration_s(), 1.0);
    const double F = record_.force_line().at(record_.duration_s());
    const double common = kNormal95 * mu * std::sqrt(alike + sensor_variance(mu, F));
    const double noise = kNormal95 * mu * std::sqrt(alike);
    expected_noise_low_ = mu - std::hypot(mu - forecast.low, noise);
    expected_noise_high_ = mu + std::hypot(forecast.high - mu, noise);
    out_.mu_max_expected = mu;
    out_.mu_max_low = mu - std::hypot(mu - forecast.low, common);
    out_.mu_max_high = mu + std::hypot(forecast.high - mu, common);
    // A single narrow interval may be a matter of luck.
    const bool narrow = out_.mu_max_high - out_.mu_max_low < confidence_width_ * mu &&
                        is_value(mu, expected_noise_low_, expected_noise_high_);
    narrow_ = narrow ? narrow_ + 1 : 0;
    if (out_.stop == StopReason::kNone && narrow_ >= kNarrowInARow) {
      out_.stop = StopReason::kConfidence;
    }
  }

  // Ended before the peak: what was to be expected then is the result.
  void take_expected() noexcept {
    peak_.kind = PeakKind::kValue;
    peak_.mu_max = out_.mu_max_expected;
    peak_.ci95_low = out_.mu_max_low;
    peak_.ci95_high = out_.mu_max_high;
    peak_.mu_max_std = (out_.mu_max_high - out_.mu_max_low) / (2.0 * kNormal95);
    peak_.noise_low = expected_noise_low_;
    peak_.noise_high = expected_noise_high_;
    peak_.clamp_force_N = traction_ * std::abs(out_.torque_p_Nm) / out_.mu_max_expected;
    peak_.omega_s_rad_s = omega_s_rad_s_;
    peak_.sigma_peak_percent = peak_forecast_.forecast().slip_peak_percent;
    peak_.samples = std::lround(record_.duration_s() * sample_rate_hz_);
  }

  // What turning oil adds to the clamp force goes with its square: a belt that slips on after its
  // peak takes the shaft with it, or leaves it.
  double omega_s_at(double t_s) const noexcept {
    const History& history = record_.history();
    for (std::size_t level = 0; level < History::kLevels; ++level) {
      for (std::size_t age = 0; age < history.size(level); ++age) {
        const Cell& cell = history.cell(level, age);
        if (cell.t_s > t_s) continue;
        const OperatingPoint& point = chain_.point();
        const double ratio = point.ratio_g0 * (1.0 - point.sign * cell.slip_percent / kPercent);
        return std::abs(cell.omega_p_rad_s) * ratio;
      }
    }
    return omega_s_rad_s_;
  }

  // Relative variance of mu* that all samples near t share, the sensors' constant errors left out:
  // the lines of force and torque, and the form of the curve.
  double alike_variance(double t_s, double held_share) const noexcept {
    const Line& force = record_.force_line();
    const double F = force.at(t_s);
    double relative = force.variance_at(t_s) / (F * F);
    if (inertia_kg_m2_ > 0.0) {
      const Line& torque = record_.torque_line();
      relative +=
          held_share * held_share * torque.variance_at(t_s) / (torque.at(t_s) * torque.at(t_s));
    }
    return relative + kFormDeviation * kFormDeviation;
  }

  // And of those errors.
  double sensor_variance(double mu, double F) const noexcept {
    const double sensors =
        relative_sensor_deviation(variator_, accuracies_, mu * F / traction_, F, omega_s_rad_s_);
    return sensors * sensors;
  }

  void judge() noexcept {
    if (out_.stop == StopReason::kRatio || stands_still()) return;
    if (out_.stop == StopReason::kInputs) {
      peak_.impossible = !is_possible(out_.mu_star, reading_reach_);
      peak_.mu_refused = peak_.impossible ? out_.mu_star : 0.0;
      return;
    }
    const PeakFitResult& fit = fit_.result();
    peak_ = {};
    // Torque that fades is no friction that falls.
    // Ended at the top from outside: whether it was passed or not, what the curve may still rise
    // by is in the interval.
    const bool slips_on =
        out_.stop == StopReason::kSlip || out_.stop == StopReason::kSlipRate || at_the_top_;
    const bool seen = out_.stop == StopReason::kSlope ||
                      (slips_on && first_mu_ < kTopFrom * fit.mu) ||
                      (out_.stop != StopReason::kTorque && fit.inside >= kInsideWithoutStop &&
                       fit.passed && fit.fall > kEvident * std::sqrt(fit.fall_variance));
    peak_.samples = std::lround(fit.duration_s * sample_rate_hz_);
    peak_.contradictory = contradictory(fit);
    if (peak_.contradictory) {
      // What its top would be, if it is one: no belt's friction is the likelier cause then.
      if (fit.valid && fit.inside >= kInsideWithoutStop && fit.slip_percent > kSlipOfATop_percent) {
        peak_.mu_refused = fit.mu;
        peak_.clamp_force_N = record_.force_line().at(fit.t_s);
        peak_.omega_s_rad_s = omega_s_at(fit.t_s);
      }
      return;
    }
    const double F = record_.force_line().at(fit.t_s);
    const double square = fit.mu * fit.mu;
    const double noise_variance = fit.variance + square * alike_variance(fit.t_s, fit.held_share);
    const double noise = kNormal95 * std::max(std::sqrt(noise_variance), kSmallestStd);
    const double low = fit.mu - noise;
    const double high = fit.mu + std::hypot(noise, further_rise(fit));
    if (fit.valid && seen && is_value(fit.mu, low, high)) {
      const double sensors = kNormal95 * fit.mu * std::sqrt(sensor_variance(fit.mu, F));
      peak_.kind = PeakKind::kValue;
      peak_.mu_max = fit.mu;
      peak_.noise_low = low;
      peak_.noise_high = high;
      peak_.ci95_low = fit.mu - std::hypot(fit.mu - low, sensors);
      peak_.ci95_high = fit.mu + std::hypot(high - fit.mu, sensors);
      peak_.mu_max_std = (peak_.ci95_high - peak_.ci95_low) / (2.0 * kNormal95);
      peak_.clamp_force_N = F;
      peak_.omega_s_rad_s = omega_s_at(fit.t_s);
      peak_.sigma_peak_percent = fit.slip_percent;
    } else if (fit.reached > 0.0) {
      take_lower_bound(fit);
    }
  }

  // Surely reached in some window; or the fit, which leans on all of the curve. The larger.
  void take_lower_bound(const PeakFitResult& fit) noexcept {
    const double F = record_.force_line().at(record_.duration_s());
    const double sensors = relative_sensor_deviation(
        variator_, accuracies_, fit.reached * F / traction_, F, omega_s_rad_s_);
    const double surely =
        fit.reached *
        (1.0 - std::hypot(kReachedDeviations * fit.reached_deviation, kNormal99Upper * sensors));
    const double fit_variance =
        fit.variance + fit.mu * fit.mu *
                           (alike_variance(fit.t_s, fit.held_share) +
                            sensor_variance(fit.mu, record_.force_line().at(fit.t_s)));
    const double fitted = fit.valid ? fit.mu - kFittedDeviations * std::sqrt(fit_variance) : 0.0;
    const bool better = fitted > surely;
    peak_.kind = PeakKind::kLowerBound;
    peak_.mu_max = better ? fitted : surely;
    peak_.sigma_peak_percent = better ? fit.slip_percent : fit.reached_slip_percent;
    peak_.clamp_force_N = F;
    peak_.omega_s_rad_s = omega_s_at(record_.duration_s());
  }

  bool contradictory(const PeakFitResult& fit) noexcept {
    if (record_.torque_stepped_s() < record_.torque_counts_until_s()) {
      torque_.take_step(record_.torque_stepped_s());
    }
    return torque_.has_stepped() || pressure_.has_stepped() || omega_p_.has_stepped() ||
           omega_s_.has_stepped() || after_stop_.swung_back() ||
           (fit.valid && follow_on_.stood_still(fit.mu, traction_, inertia_kg_m2_)) ||
           fit.below_chord > kChordDeviations || fit.residuals.innovation > kInManyLooks ||
           fit.residuals.runs > kRuns;
  }

  VariatorParameters variator_;
  SensorAccuracies accuracies_;
  double sample_rate_hz_;
  double reading_reach_;
  double value_width_;
  double confidence_width_;  // 0: never
  double inertia_kg_m2_;
  SignalChain chain_;
  SlipExcitation excitation_;
  ExperimentRecord record_;
  StopDetector detector_;
  AfterStop after_stop_;
  ForceStep force_step_;
  FollowOn follow_on_;
  std::size_t next_after_ = 0;  // to join the record
  PeakFit fit_;
  PeakForecast peak_forecast_;
  ChannelReading pressure_, torque_, omega_p_, omega_s_;
  CurveEstimate out_;
  PeakEstimate peak_;
  double traction_ = 0.0;  // mu* = traction T_p / F_s
  double omega_s_rad_s_ = 0.0;
  std::int64_t first_t_ns_ = 0;
  double first_mu_ = 0.0, first_force_N_ = 0.0;
  double stop_s_ = 0.0;
  double expected_noise_low_ = 0.0, expected_noise_high_ = 0.0;
  int narrow_ = 0;  // forecasts in a row within confidence_width
  bool started_ = false, concluding_ = false, concluded_ = false;
  bool waiting_ = false;  // for what comes after the stop
  bool at_the_top_ = false;
  bool stepped_ = false;  // since the last conclude()
};

}  // namespace

std::unique_ptr<SlipCurveEstimator> make_robust_estimator(const EstimatorSettings& settings,
                                                          const VariatorParameters& variator,
                                                          const SensorAccuracies& accuracies) {
  return std::make_unique<RobustEstimator>(settings, variator, accuracies);
}

}  // namespace beltgrip::estimator
