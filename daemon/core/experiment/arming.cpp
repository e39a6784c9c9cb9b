#include "daemon/core/experiment/arming.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "daemon/core/experiment/force_floor.h"
#include "daemon/core/experiment/ramp_rate.h"
#include "estimator/physics/slip.h"
#include "estimator/physics/units.h"
#include "estimator/signal/signal_chain.h"

namespace beltgrip::daemon {

namespace {

constexpr double kPedalMoved =
    0.05;  // chosen: in an experiment, above the noise of a pedal at rest
constexpr double kOilBand_K =
    1.0;  // chosen: in an experiment, below what it may begin with; oil cools slower
constexpr double kKnownMargin = 1.05;  // the belt may have run in since its last value
constexpr double kPeakSlipOverdrive_share = 0.020;
constexpr double kPeakSlipLow_share = 0.035;
// Chosen: a belt of which nothing is known may have as little friction. Measured: 0.075, 0.068 and
// 0.102 beside it in tests/FIGURES.md; less refuses most of the peaks in reach, with more two of
// the five drives of reachability.cpp slip.
constexpr double kLeastFriction = 0.085;
// What a fifth more or less of each number here changes: a table in tests/FIGURES.md.
// Chosen: what is known may have worn, by more than the 3 % that the history tells.
constexpr double kKnownLeast = 0.95;
constexpr double kDetection_s = 0.03;  // derived: six samples, of filters and sampler
constexpr double kBeyondPeak_s = 1.0;  // acquisition at the start, and slip until it is seen
// Measured: of the coast-down, kept when a request waits. A car leaves the end stop before the
// least speed that is configured, and a ramp may last longer than reckoned: with 0.5 s 29 of 179
// peaks in reach were lost to the end of the coast-down, with 3 s 7 (campaign --nothing-wrong).
constexpr double kSpare_s = 3.0;
constexpr double kRideSpare_s = 0.5;  // chosen: the same, where a request rides the floor
// Chosen: the middle of the slip rates that a crossing may have, before one is found.
constexpr double kPlanned_1_s = 0.025;
constexpr double kRoomGained = 0.001;  // chosen: of slip, a tenth of a point is worth waiting for
constexpr double kFurther = 0.95;      // chosen: of the speed; is there more room a little later?
// Chosen: of the steepest fall, what an unknown belt has when a fault comes at the worst instant of
// its crossing. With the whole of it 34 of 60 drawn cars were not asked.
constexpr double kFaultShare = 0.5;
constexpr Duration kSlipMean = 500 * kMillisecond;
using estimator::kPercent;
// A request begins at the own force and falls from there: what that falls by itself within the
// actuator's answer must stay far inside the band in which a force counts as following. A coasting
// car's own falls by some 50 N/s.
constexpr double kForceRate_N_per_s = 150.0;
constexpr double kForceDeviations = 3.0;
constexpr std::size_t kForceLookMost = 5;  // blocks, of the longest line that is judged
// Of white noise: a second difference of means has root 6 of their deviation, the median of its
// magnitude is 0.6745 of its own.
constexpr double kPerMedian = 1.0 / (0.6745 * 2.449489742783178);

// What is assumed of an unknown belt, as far as its own experiments leave it open.
double within(const FallRange& shown, double assumed) noexcept {
  return shown.most > 0.0 ? std::clamp(assumed, shown.least, shown.most) : assumed;
}

}  // namespace

ExperimentSettings begins_within(const Config& config) noexcept {
  ExperimentSettings settings = config.experiment;
  if (config.control == Control::kCommand) return settings;
  settings.torque_max_Nm = std::numeric_limits<double>::infinity();
  settings.primary_speed_min_rad_s *= limits::kObservedSpeedShare;
  return settings;
}

Arming::Arming(const Config& config)
    : trigger_(config.trigger),
      control_(config.control),
      variator_(config.variator),
      choice_(config.estimator.ratio),
      settings_(begins_within(config)),
      inertia_kg_m2_(config.variator.primary_inertia_kg_m2),
      rate_max_N_per_s_(config.estimator.ramp_rate_max_N_per_s),
      cosine_(std::cos(config.variator.half_wedge_angle_rad)),
      force_step_N_(config.variator.secondary_piston_area_m2 * config.estimator.pressure_step_Pa) {}

double Arming::floor_N(double omega_s_rad_s) const noexcept {
  return force_floor_N(variator_, settings_.secondary_pressure_floor_Pa, omega_s_rad_s);
}

// The force bends the pulleys open: below its end stop, not above it, the ratio may stand further
// off. No further than where the estimator takes it for another ratio.
bool Arming::rests_on_stop(double share_of_stop, double force_N) noexcept {
  const double lacks_most =
      std::min(kRatioTolerance + estimator::kDeformationMost_1_N * std::max(0.0, force_N),
               estimator::kRatioTolerance_percent / kPercent);
  return share_of_stop < 1.0 + kRatioTolerance && share_of_stop > 1.0 - lacks_most;
}

bool Arming::at_end_stop(double ratio, double force_N) const noexcept {
  const auto near = [=](double stop) { return rests_on_stop(ratio / stop, force_N); };
  return (choice_ != estimator::RatioChoice::kLow && near(variator_.ratio_overdrive)) ||
         (choice_ != estimator::RatioChoice::kOverdrive && near(variator_.ratio_low));
}

std::uint32_t Arming::preconditions(const Now& now) const noexcept {
  std::uint32_t out = 0;
  const auto inhibit = [&out](bool set, Inhibit which) {
    if (set) out |= inhibit_bit(which);
  };
  inhibit(now.faulted, Inhibit::kFault);
  inhibit(now.beyond_box, Inhibit::kModel);
  inhibit((!now.usable && !now.beyond_box) || !now.conditions.fresh, Inhibit::kInputs);
  if (out != 0) return out;
  const Conditions& c = now.conditions;
  const bool coast = trigger_ == Trigger::kCoastDown;
  const double torque = coast ? -now.torque_Nm : now.torque_Nm;
  inhibit(!c.permitted, Inhibit::kPermission);
  inhibit(coast && c.accelerator > kPedalReleased, Inhibit::kPedal);
  inhibit(c.brake_pressed, Inhibit::kBrake);
  inhibit(!c.lockup_closed, Inhibit::kLockup);
  inhibit(!at_end_stop(now.omega_s_rad_s / now.omega_p_rad_s, now.clamp_force_N), Inhibit::kRatio);
  inhibit(torque < settings_.torque_min_Nm || torque > settings_.torque_max_Nm, Inhibit::kTorque);
  inhibit(now.omega_p_rad_s < settings_.primary_speed_min_rad_s, Inhibit::kSpeed);
  inhibit(c.oil_degC < settings_.oil_temperature_min_degC, Inhibit::kOil);
  inhibit(!now.cooled, Inhibit::kCooldown);
  return out;
}

Stop Arming::ended_by(const Conditions& now) const noexcept {
  using estimator::StopReason;
  const bool coast = trigger_ == Trigger::kCoastDown;
  if (!now.permitted) {
    return {StopReason::kPermission,
            {.what = "permission withdrawn", .role = Role::kExperimentPermitted}};
  }
  if (now.brake_pressed) {
    return {StopReason::kDriver, {.what = "brake pressed", .role = Role::kBrakePressed}};
  }
  if (coast && now.accelerator > kPedalMoved) {
    return {StopReason::kDriver,
            {.what = "pedal at",
             .figure = kPercent * now.accelerator,
             .limit = kPercent * kPedalMoved,
             .unit = "%",
             .role = Role::kAcceleratorPedal}};
  }
  if (!now.lockup_closed) {
    return {StopReason::kTorque, {.what = "lock-up opens", .role = Role::kLockupClosed}};
  }
  const double oil_least_degC = settings_.oil_temperature_min_degC - kOilBand_K;
  if (now.oil_degC < oil_least_degC) {
    return {StopReason::kPermission,
            {.what = "oil at",
             .figure = now.oil_degC,
             .limit = oil_least_degC,
             .unit = "degC",
             .role = Role::kOilTemperature}};
  }
  return {};
}

bool Arming::steady(const Now& now) const noexcept {
  const double ratio = now.omega_s_rad_s / now.omega_p_rad_s;
  return std::abs(ratio / ratio_since_ - 1.0) <= kRatioDrift &&
         std::abs(now.torque_Nm - torque_since_Nm_) <=
             kTorqueDrift * std::abs(torque_since_Nm_) + kTorqueDrift_Nm;
}

void Arming::look(const Now& now) noexcept {
  const SlipShown& shown = now.shown;
  const double grown_max_percent =
      std::max(kSlipLeast_percent, kSlipShare * (shown.peak_percent - shown.own_percent));
  if (shown.peak_percent > 0.0 && slip_percent_ - shown.own_percent > grown_max_percent) {
    search_ = later_ = {};
    unclear_ = inhibit_bit(Inhibit::kGrip);
    obstacle_ = {.figure = slip_percent_ - shown.own_percent, .limit = grown_max_percent};
    return;
  }
  const RampPoint here = point_at(now, now.omega_p_rad_s);
  const double slowing = slowing_rad_s2(now);
  const double least_rad_s = settings_.primary_speed_min_rad_s;
  const double ramp_rad_s = slowing * ramp_s(here, kPlanned_1_s, rate_max_N_per_s_);
  const RampPoint soon = point_at(now, std::max(least_rad_s, now.omega_p_rad_s - ramp_rad_s));
  const double spare_rad_s = slowing * (kBeyondPeak_s + kRideSpare_s);
  // What a request that began now could ride the floor to.
  const double longest_s = seconds(limits::kRequestLongest);
  const double ridden_rad_s =
      std::max(least_rad_s + spare_rad_s, now.omega_p_rad_s - slowing * longest_s);
  const RampPoint latest = point_at(now, std::min(ridden_rad_s, soon.omega_p_rad_s));
  if (reachable_mu(latest) < latest.mu_expected) {
    search_ = later_ = {};
    unclear_ = inhibit_bit(Inhibit::kUnreachable);
    obstacle_ = {.figure = latest.floor_N,
                 .limit = peak_force_N(latest, latest.mu_expected),
                 .needed = reached_below_rad_s(latest, now.omega_s_rad_s / now.omega_p_rad_s)};
    return;
  }
  search_ = CrossingSearch(soon, reaction(now), SlipLimits{});
  const double later_rad_s = std::max(latest.omega_p_rad_s, kFurther * soon.omega_p_rad_s);
  later_ = CrossingSearch(point_at(now, later_rad_s), reaction(now), SlipLimits{});
}

RampPoint Arming::point_at(const Now& now, double omega_p_rad_s) const noexcept {
  const double ratio = now.omega_s_rad_s / now.omega_p_rad_s;
  const bool low = ratio < 1.0;
  const bool known = now.mu_max_known > 0.0;
  RampPoint point;
  point.torque_Nm = std::abs(now.torque_Nm);
  point.omega_p_rad_s = omega_p_rad_s;
  point.primary_radius_m =
      low ? variator_.primary_radius_low_m : variator_.primary_radius_overdrive_m;
  point.wedge_cosine = cosine_;
  point.inertia_kg_m2 = inertia_kg_m2_;
  point.own_force_N = now.clamp_force_N;
  point.floor_N = floor_N(ratio * omega_p_rad_s);
  if (known) {
    point.mu_expected = kKnownMargin * now.mu_max_known;
    point.mu_least = kKnownLeast * now.mu_max_known;
  } else {  // no less than it has carried
    point.mu_expected = std::max(settings_.friction_expected, kKnownMargin * now.mu_carried);
    point.mu_least = std::max(std::min(kLeastFriction, settings_.friction_expected),
                              kKnownLeast * now.mu_carried);
  }
  point.peak_slip_share = low ? kPeakSlipLow_share : kPeakSlipOverdrive_share;
  const double fall_max = kPercent * settings_.fall_max_per_percent;
  point.fall = within(now.shown.fall, fall_max);
  point.fall_at_fault = within(now.shown.fall, kFaultShare * fall_max);
  const double noise_1_s = slip_course_.rate_deviation_1_s();
  point.slip_rate_noise_1_s = std::isfinite(noise_1_s) ? noise_1_s : 0.0;  // nothing has moved yet
  return point;
}

Reaction Arming::reaction(const Now& now) const noexcept {
  Reaction reaction;
  reaction.detection_s = kDetection_s;
  reaction.stale_s = seconds(now.stale);
  reaction.dead_time_s = settings_.actuator_dead_time_s;
  reaction.lag_s = settings_.actuator_lag_s;
  return reaction;
}

// Fast to where the first peaks may lie, then at the rate near the top.
double Arming::ramp_s(const RampPoint& point, double slip_rate_1_s,
                      double rate_N_per_s) const noexcept {
  const double peak_N = peak_force_N(point, point.mu_expected);
  const double near_N =
      std::clamp(peak_force_N(point, kBelowPeaks * point.mu_least),
                 std::min(peak_N, point.own_force_N), std::max(peak_N, point.own_force_N));
  const double top_N_per_s = std::min(
      rate_N_per_s,
      ramp_at_the_top_N_per_s(point, settings_.actuator_dead_time_s + settings_.actuator_lag_s,
                              slip_rate_1_s));
  return std::max(0.0, point.own_force_N - near_N) / rate_N_per_s +
         std::max(0.0, near_N - peak_N) / top_N_per_s;
}

// The ramp that ends in that time, in steps of a fifth; no number: none to the largest that can be
// configured.
double Arming::rate_needed_N_per_s(const RampPoint& point, double slip_rate_1_s,
                                   double left_s) const noexcept {
  constexpr double kStep = 1.2, kMost_N_per_s = 10e3;
  double rate_N_per_s = rate_max_N_per_s_;
  while (ramp_s(point, slip_rate_1_s, rate_N_per_s) + kBeyondPeak_s > left_s) {
    rate_N_per_s *= kStep;
    if (rate_N_per_s > kMost_N_per_s) return std::numeric_limits<double>::quiet_NaN();
  }
  return rate_N_per_s;
}

// The primary's speed at which the floor comes down to the peak's force; no number: not at rest.
double Arming::reached_below_rad_s(const RampPoint& point, double ratio) const noexcept {
  const double turning_N = peak_force_N(point, point.mu_expected) - floor_N(0.0);
  return std::sqrt(turning_N / variator_.secondary_centrifugal_N_s2) / ratio;
}

// Of the primary, since the trigger held.
double Arming::slowing_rad_s2(const Now& now) const noexcept {
  const double held_s = seconds(now.t - held_since_);
  return held_s > 0.0 ? std::max(0.0, (omega_p_since_rad_s_ - now.omega_p_rad_s) / held_s) : 0.0;
}

std::uint32_t Arming::clearance(const Now& now) noexcept {
  const Crossing& crossing = search_.crossing();
  const RampPoint& point = search_.point();
  const double slowing = slowing_rad_s2(now);
  const double left_s =
      slowing > 0.0 ? (now.omega_p_rad_s - settings_.primary_speed_min_rad_s) / slowing : 1e9;
  const double planned_1_s = crossing.slip_rate_1_s > 0.0 ? crossing.slip_rate_1_s : kPlanned_1_s;
  const double needed_s = ramp_s(point, planned_1_s, rate_max_N_per_s_) + kBeyondPeak_s;
  const double patience_s = seconds(kPatience);
  const bool slows = slowing * patience_s > (1.0 - kFurther) * now.omega_p_rad_s;
  const bool waits = slows && needed_s + kSpare_s < left_s &&
                     (later_.crossing().peak_slip_detectable_share >
                          crossing.peak_slip_detectable_share + kRoomGained ||
                      reachable_mu(point) < point.mu_expected);
  if (waits) return inhibit_bit(Inhibit::kWait);
  if (crossing.slip_rate_1_s <= 0.0) {
    const CrossingDenied& denied = search_.denied();
    const double known = obstacle_.wall == CrossingWall::kFall
                             ? obstacle_.figure
                             : std::numeric_limits<double>::quiet_NaN();
    obstacle_ = {.figure = denied.figure, .limit = denied.limit, .wall = denied.wall};
    if (denied.wall == CrossingWall::kFall) {
      obstacle_.figure = known;
      obstacle_.needed = point.own_force_N / peak_force_N(point, point.mu_least);
      if (refused_.fall_known()) refused_ = search_;
    }
    return inhibit_bit(Inhibit::kRamp);
  }
  plan_ = {crossing, point, reaction(now)};
  const double longest_s = seconds(limits::kRequestLongest);
  if (needed_s <= std::min(left_s, longest_s)) return 0U;
  const double most_s = std::min(left_s, longest_s);
  obstacle_ = {.figure = needed_s,
               .limit = most_s,
               .needed = rate_needed_N_per_s(point, planned_1_s, most_s)};
  return inhibit_bit(Inhibit::kTime);
}

void Arming::follow_force(const Now& now) noexcept {
  block_sum_N_ += now.clamp_force_N;
  block_samples_ += 1.0;
  if (now.t - block_since_ < kForceBlock) return;
  force_means_N_[force_count_++ % kForceBlocks] = block_sum_N_ / block_samples_;
  block_since_ = now.t;
  block_sum_N_ = block_samples_ = 0.0;
  force_rests_ = force_at_rest();
}

// Of a mean, read off second differences: neither a line nor, by the median, a force that has just
// begun to move counts as noise.
double Arming::force_noise_N() const noexcept {
  std::array<double, kForceBlocks - 2> seconds_N{};
  const auto at = [this](std::size_t i) {
    return force_means_N_[(force_count_ + i) % kForceBlocks];
  };
  for (std::size_t i = 0; i < seconds_N.size(); ++i) {
    seconds_N[i] = std::abs(at(i) - 2.0 * at(i + 1) + at(i + 2));
  }
  const auto middle = seconds_N.begin() + seconds_N.size() / 2;
  std::nth_element(seconds_N.begin(), middle, seconds_N.end());
  return std::hypot(kPerMedian * *middle, force_step_N_ / std::sqrt(12.0));
}

// The slopes of the lines through the last means, from two of them on: a fall that has just begun
// shows in the short ones, a slow one in the long ones. Each less what noise may have made of it.
bool Arming::force_at_rest() const noexcept {
  if (force_count_ < kForceBlocks) return false;
  constexpr double kBlock_s = seconds(kForceBlock);
  const double noise_N = force_noise_N();
  for (std::size_t length = 2; length <= kForceLookMost; ++length) {
    const double n = static_cast<double>(length), middle = 0.5 * (n - 1.0);
    const double moment = n * (n * n - 1.0) / 12.0;
    double slope_N = 0.0;  // per block
    for (std::size_t age = 0; age < length; ++age) {
      const double mean_N = force_means_N_[(force_count_ - 1 - age) % kForceBlocks];
      slope_N += mean_N * (middle - static_cast<double>(age)) / moment;
    }
    const double deviation_N = noise_N / std::sqrt(moment);
    if (std::abs(slope_N) - kForceDeviations * deviation_N > kForceRate_N_per_s * kBlock_s) {
      return false;
    }
  }
  return true;
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
    torque_since_Nm_ = now.torque_Nm;
    omega_p_since_rad_s_ = now.omega_p_rad_s;
    unclear_ = 0;
    looked_ = cleared_ = false;
    search_ = later_ = refused_ = {};
    obstacle_ = {};
    slip_percent_ = slip_samples_ = 0.0;
    slip_course_.begin(ratio_since_, now.torque_Nm);
    force_count_ = 0;
    force_rests_ = false;
    block_since_ = now.t;
    block_sum_N_ = block_samples_ = 0.0;
  }
  const Duration step = now.t - last_;
  last_ = now.t;
  slip_samples_ = std::min(slip_samples_ + 1.0, std::max(1.0, fraction(kSlipMean, step)));
  slip_percent_ += (now.slip_percent - slip_percent_) / slip_samples_;
  slip_course_.step(now.t, now.omega_s_rad_s / now.omega_p_rad_s);
  follow_force(now);
  const Duration held = now.t - held_since_;
  settled_ = held >= kSettle;
  if (!settled_ || control_ != Control::kCommand) return;
  // A search takes some samples, one excursion each; what was found before holds until its end.
  if (!search_.done()) {
    search_.step();
  } else if (!later_.done()) {
    if (later_.step()) unclear_ = clearance(now);
  } else if (now.t >= next_look_) {
    next_look_ = now.t + kClearancePeriod;
    look(now);
  } else if (!refused_.fall_known()) {
    refused_.step_fall();
    if (refused_.fall_known() && obstacle_.wall == CrossingWall::kFall) {
      obstacle_.figure = refused_.denied().figure;
    }
  }
  looked_ = looked_ || (search_.done() && later_.done());
  const std::uint32_t moving = force_rests_ ? 0U : inhibit_bit(Inhibit::kForce);
  const std::uint32_t quiet = now.watched ? 0U : inhibit_bit(Inhibit::kQuiet);
  inhibits_ = unclear_ | moving | quiet;
  cleared_ = looked_ && inhibits_ == 0;
  const bool waits = (inhibits_ & inhibit_bit(Inhibit::kWait)) != 0;
  settled_ = cleared_ || (held >= kSettle + kPatience && !waits);
}

}  // namespace beltgrip::daemon
