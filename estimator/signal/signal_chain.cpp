#include "estimator/signal/signal_chain.h"

#include <algorithm>
#include <cmath>

#include "estimator/method/possible_friction.h"
#include "estimator/physics/clamp_force.h"

namespace beltgrip::estimator {
namespace {

// Beyond these no variator runs: such a value is no measurement, and its square is none either.
constexpr double kSlowest_rad_s = 1.0;
constexpr double kFastest_rad_s = 1e4;
constexpr double kHighest_Pa = 1e9;
constexpr double kStrongest_Nm = 1e5;

// False for what is not a number, too.
bool possible(const VariatorSample& sample) {
  return sample.omega_p_rad_s >= kSlowest_rad_s && sample.omega_p_rad_s <= kFastest_rad_s &&
         std::abs(sample.omega_s_rad_s) <= kFastest_rad_s &&
         std::abs(sample.secondary_pressure_Pa) <= kHighest_Pa &&
         std::abs(sample.torque_Nm) <= kStrongest_Nm;
}

}  // namespace

SignalChain::SignalChain(const EstimatorSettings& settings, const VariatorParameters& variator,
                         double lowpass_hz)
    : variator_(variator),
      choice_(settings.ratio),
      inertia_kg_m2_(settings.torque_is_engine ? variator.primary_inertia_kg_m2 : 0.0),
      reading_reach_(settings.reading_reach),
      acquire_samples_(std::lround(kAcquire_s * settings.sample_rate_hz) + 1),
      omega_p_(lowpass_hz, settings.sample_rate_hz),
      omega_s_(lowpass_hz, settings.sample_rate_hz),
      pressure_(lowpass_hz, settings.sample_rate_hz),
      torque_(lowpass_hz, settings.sample_rate_hz) {}

void SignalChain::reset() noexcept {
  started_ = measured_ = false;
  acquired_ = dead_samples_ = wrong_samples_ = impossible_samples_ = 0;
  ratio_sum_ = 0.0;
  out_ = {};
}

void SignalChain::acquire(double ratio) noexcept {
  const double torque = out_.torque_p_Nm;
  const bool overrun = torque < 0.0;
  if (std::abs(torque) <= kTorqueDeadBand_Nm ||
      (acquired_ > 0 && overrun != (point_.direction == Direction::kOverrun))) {
    acquired_ = 0;
    ratio_sum_ = 0.0;
    return;
  }
  ++acquired_;
  ratio_sum_ += ratio;
  point_.direction = overrun ? Direction::kOverrun : Direction::kDrive;
  if (acquired_ < acquire_samples_) return;
  const double mean_ratio = ratio_sum_ / static_cast<double>(acquired_);
  EndStop end_stop = choice_ == RatioChoice::kLow ? EndStop::kLow : EndStop::kOverdrive;
  if (choice_ == RatioChoice::kEither) end_stop = nearest_end_stop(variator_, mean_ratio);
  point_ = operating_point(variator_, end_stop, point_.direction);
  if (std::abs(slip_percent(point_, 1.0, mean_ratio)) > kRatioTolerance_percent) {
    out_.stop = StopReason::kRatio;
  }
}

const Measurement& SignalChain::step(const VariatorSample& sample) noexcept {
  const bool in_turn = sample.usable && !(started_ && sample.t_ns <= last_t_ns_);
  if (!in_turn || !possible(sample)) {
    out_.usable = false;
    if (in_turn && ++impossible_samples_ >= acquire_samples_ && out_.stop == StopReason::kNone) {
      out_.stop = StopReason::kInputs;
    }
    return out_;
  }
  impossible_samples_ = 0;
  if (!started_) {
    omega_p_.reset(sample.omega_p_rad_s);
    omega_s_.reset(sample.omega_s_rad_s);
    pressure_.reset(sample.secondary_pressure_Pa);
    torque_.reset(sample.torque_Nm);
    started_ = true;
  }
  last_t_ns_ = sample.t_ns;
  const double omega_p = omega_p_.step(sample.omega_p_rad_s);
  const double omega_s = omega_s_.step(sample.omega_s_rad_s);
  out_.omega_p_rad_s = omega_p;
  out_.omega_s_rad_s = omega_s;
  out_.torque_p_Nm = torque_.step(sample.torque_Nm) - inertia_kg_m2_ * omega_p_.derivative();
  out_.clamp_force_N =
      secondary_clamp_force_N(variator_, pressure_.step(sample.secondary_pressure_Pa), omega_s);
  out_.usable = false;
  if (omega_p <= 0.0 || out_.clamp_force_N <= 0.0) return out_;
  if (acquired_ < acquire_samples_) acquire(omega_s / omega_p);
  if (acquired_ < acquire_samples_ || out_.stop != StopReason::kNone) return out_;

  out_.slip_percent = slip_percent(point_, omega_p, omega_s);
  out_.mu_star = traction_coefficient(variator_, point_, out_.torque_p_Nm, out_.clamp_force_N);
  if (point_.sign * out_.torque_p_Nm < -kTorqueDeadBand_Nm) {
    out_.stop = StopReason::kTorque;
  } else {
    StopReason wrong = StopReason::kNone;
    if (out_.slip_percent < -kRatioTolerance_percent ||
        (measured_ && out_.slip_percent < first_slip_percent_ - kSlipBelowFirst_percent)) {
      wrong = StopReason::kRatio;
    } else if (out_.mu_star > kMuReadMost * reading_reach_) {
      wrong = StopReason::kInputs;
    }
    // Noise at low speed or in a small clamp force does that too, for a moment.
    wrong_samples_ = wrong != StopReason::kNone ? wrong_samples_ + 1 : 0;
    if (wrong_samples_ >= acquire_samples_) out_.stop = wrong;
    out_.usable = point_.sign * out_.torque_p_Nm > kTorqueDeadBand_Nm;
    dead_samples_ = std::max<std::int64_t>(0, dead_samples_ + (out_.usable ? -1 : 1));
    if (out_.usable && !measured_) {
      measured_ = true;
      first_slip_percent_ = out_.slip_percent;
    }
    if (dead_samples_ >= acquire_samples_) out_.stop = StopReason::kTorque;
  }
  return out_;
}

}  // namespace beltgrip::estimator
