#include "daemon/core/arming.h"

#include <algorithm>
#include <cmath>

namespace beltgrip::daemon {

namespace {

constexpr double kPedalReleased = 0.02;
constexpr double kPedalMoved = 0.05;      // in an experiment: the driver wants something
constexpr double kOilBand_K = 1.0;        // in an experiment: below what it may begin with
constexpr double kRatioTolerance = 0.03;  // slip and deformation of a clamped belt stay below this
constexpr double kKnownMargin = 1.05;     // the belt may have run in since its last value
constexpr double kPeakSlipOverdrive = 0.020;
constexpr double kPeakSlipLow = 0.035;
constexpr double kDetection_s = 0.03;  // filters and sampler
constexpr double kBeyondPeak_s = 1.0;  // acquisition at the start, and slip until it is seen
constexpr double kSlipMean = 100.0;    // samples
constexpr double kSecondsPerTick = 1e-9;

}  // namespace

Arming::Arming(const Config& config)
    : trigger_(config.trigger),
      control_(config.control),
      variator_(config.variator),
      choice_(config.estimator.ratio),
      settings_(config.experiment),
      inertia_kg_m2_(config.variator.primary_inertia_kg_m2),
      rate_max_N_per_s_(config.estimator.ramp_rate_max_N_per_s),
      cosine_(std::cos(config.variator.half_wedge_angle_rad)) {}

double Arming::floor_N(double omega_s_rad_s) const noexcept {
  return variator_.secondary_spring_force_N +
         variator_.secondary_piston_area_m2 * settings_.secondary_pressure_floor_Pa +
         variator_.secondary_centrifugal_N_s2 * omega_s_rad_s * omega_s_rad_s;
}

bool Arming::at_end_stop(double ratio) const noexcept {
  const auto near = [ratio](double stop) { return std::abs(ratio / stop - 1.0) < kRatioTolerance; };
  return (choice_ != estimator::RatioChoice::kLow && near(variator_.ratio_overdrive)) ||
         (choice_ != estimator::RatioChoice::kOverdrive && near(variator_.ratio_low));
}

std::uint32_t Arming::preconditions(const Now& now) const noexcept {
  std::uint32_t out = 0;
  const auto inhibit = [&out](bool set, Inhibit which) {
    if (set) out |= inhibit_bit(which);
  };
  inhibit(now.faulted, Inhibit::kFault);
  inhibit(!now.usable || !now.conditions.fresh, Inhibit::kInputs);
  if (out != 0) return out;
  const Conditions& c = now.conditions;
  const bool coast = trigger_ == Trigger::kCoastDown;
  const double torque = coast ? -now.torque_Nm : now.torque_Nm;
  inhibit(!c.permitted, Inhibit::kPermission);
  inhibit(coast && c.accelerator > kPedalReleased, Inhibit::kPedal);
  inhibit(c.brake_pressed, Inhibit::kBrake);
  inhibit(!c.lockup_closed, Inhibit::kLockup);
  inhibit(!at_end_stop(now.omega_s_rad_s / now.omega_p_rad_s), Inhibit::kRatio);
  inhibit(torque < settings_.torque_min_Nm || torque > settings_.torque_max_Nm, Inhibit::kTorque);
  inhibit(now.omega_p_rad_s < settings_.primary_speed_min_rad_s, Inhibit::kSpeed);
  inhibit(c.oil_degC < settings_.oil_temperature_min_degC, Inhibit::kOil);
  inhibit(!now.cooled, Inhibit::kCooldown);
  return out;
}

estimator::StopReason Arming::ended_by(const Conditions& now) const noexcept {
  const bool coast = trigger_ == Trigger::kCoastDown;
  if (!now.permitted) return estimator::StopReason::kPermission;
  if (now.brake_pressed || (coast && now.accelerator > kPedalMoved)) {
    return estimator::StopReason::kDriver;
  }
  if (!now.lockup_closed) return estimator::StopReason::kTorque;
  if (now.oil_degC < settings_.oil_temperature_min_degC - kOilBand_K) {
    return estimator::StopReason::kPermission;
  }
  return estimator::StopReason::kNone;
}

bool Arming::steady(const Now& now) const noexcept {
  const double ratio = now.omega_s_rad_s / now.omega_p_rad_s;
  return std::abs(ratio / ratio_since_ - 1.0) <= kRatioDrift &&
         std::abs(now.torque_Nm - torque_since_) <=
             kTorqueDrift * std::abs(torque_since_) + kTorqueDrift_Nm;
}

void Arming::look(const Now& now) noexcept {
  const SlipShown& shown = now.shown;
  const double grown_max_percent =
      std::max(kSlipLeast_percent, kSlipShare * (shown.peak_percent - shown.own_percent));
  if (shown.peak_percent > 0.0 && slip_percent_ - shown.own_percent > grown_max_percent) {
    search_ = {};
    unclear_ = inhibit_bit(Inhibit::kGrip);
    return;
  }
  const bool low = now.omega_s_rad_s / now.omega_p_rad_s < 1.0;
  RampPoint point;
  point.torque_Nm = std::abs(now.torque_Nm);
  point.omega_p_rad_s = now.omega_p_rad_s;
  point.primary_radius_m =
      low ? variator_.primary_radius_low_m : variator_.primary_radius_overdrive_m;
  point.wedge_cosine = cosine_;
  point.inertia_kg_m2 = inertia_kg_m2_;
  point.own_force_N = now.clamp_force_N;
  point.floor_N = floor_N(now.omega_s_rad_s);
  point.mu_expected =
      now.mu_max_known > 0.0 ? kKnownMargin * now.mu_max_known : settings_.friction_expected;
  point.peak_slip = low ? kPeakSlipLow : kPeakSlipOverdrive;
  if (reachable_mu(point) < point.mu_expected) {
    search_ = {};
    unclear_ = inhibit_bit(Inhibit::kUnreachable);
    return;
  }

  Reaction reaction;
  reaction.detection_s = kDetection_s;
  reaction.stale_s = static_cast<double>(now.stale) * kSecondsPerTick;
  reaction.dead_time_s = settings_.actuator_dead_time_s;
  reaction.lag_s = settings_.actuator_lag_s;
  search_ = RampSearch(point, reaction, SlipLimits{}, rate_max_N_per_s_);
}

std::uint32_t Arming::clearance(const Now& now) const noexcept {
  if (ramp_.rate_N_per_s <= 0.0) return inhibit_bit(Inhibit::kRamp);

  // How long the primary stays above its least speed, as it has slowed since the trigger held.
  const double held_s = static_cast<double>(now.t - held_since_) * kSecondsPerTick;
  const double slowing = (omega_p_since_ - now.omega_p_rad_s) / held_s;
  const double left_s =
      slowing > 0.0 ? (now.omega_p_rad_s - settings_.primary_speed_min_rad_s) / slowing : 1e9;
  const double longest_s = static_cast<double>(kRequestMax) * kSecondsPerTick;
  return ramp_.duration_s + kBeyondPeak_s > std::min(left_s, longest_s)
             ? inhibit_bit(Inhibit::kTime)
             : 0U;
}

void Arming::step(const Now& now) noexcept {
  inhibits_ = preconditions(now);
  settled_ = false;
  if (inhibits_ != 0) {
    held_ = false;
    return;
  }
  if (!held_ || !steady(now)) {
    held_ = true;
    held_since_ = now.t;
    ratio_since_ = now.omega_s_rad_s / now.omega_p_rad_s;
    torque_since_ = now.torque_Nm;
    omega_p_since_ = now.omega_p_rad_s;
    next_look_ = now.t + kSettle;
    unclear_ = 0;
    looked_ = cleared_ = false;
    search_ = {};
    slip_percent_ = slip_samples_ = 0.0;
  }
  slip_samples_ = std::min(slip_samples_ + 1.0, kSlipMean);
  slip_percent_ += (now.slip_percent - slip_percent_) / slip_samples_;
  const Duration held = now.t - held_since_;
  settled_ = held >= kSettle;
  if (!settled_ || control_ != Control::kCommand) return;
  // A search takes some samples, one excursion each; what was found before holds until its end.
  if (!search_.done()) {
    if (search_.step()) {
      ramp_ = search_.ramp();
      unclear_ = clearance(now);
    }
  } else if (now.t >= next_look_) {
    next_look_ = now.t + kClearancePeriod;
    look(now);
  }
  looked_ = looked_ || search_.done();
  cleared_ = looked_ && unclear_ == 0;
  inhibits_ = unclear_;
  settled_ = cleared_ || held >= kSettle + kPatience;
}

}  // namespace beltgrip::daemon
