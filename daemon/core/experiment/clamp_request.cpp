#include "daemon/core/experiment/clamp_request.h"
#include "estimator/physics/units.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace beltgrip::daemon {

using estimator::StopReason;

namespace {
using estimator::kPercent;
// What the slip since the start leaves out: slip at the start, and the deformation that is gone.
constexpr double kSlipAtStart_share = 0.01;
// And of a late peak more: at 57 % of its friction a belt has come 28 % of the way in slip.
constexpr double kStartShare = 0.3;
constexpr double kNearPeak = 0.85;  // of the largest friction expected
// A slip rate that is no noise, and above what the ramp holds: 4.5 deviations of a window. At the
// least a little more than production noise gives: what a rate costs is in the energy to come, and
// the crossing overshoots by so much. With 1.1 %/s in place of 3 four of 111 peaks in reach more
// end without a value in lab noise, with 2 as with 3 (campaign --seeds 1500 --from 1700001,
// 990001). A fifth less or more: the same 87 and 86 values of 98.
constexpr double kRateDeviations = 4.5;
constexpr double kRateLeast_1_s = 0.03;
constexpr double kSlipGrows_1_s = 0.006;  // a belt that holds creeps slower than this
constexpr double kDecision_s = 0.02;      // to the next frame, and the receiver's cycle
// The floor falls with the square of the secondary's speed, whose noise must not carry the request
// below it.
constexpr double kFloorNoise_N = 10.0;
// Chosen: what is looked at on the floor, whether it falls and whether the belt holds there. A
// coasting car's falls by 50 N/s; one that falls by less brings nothing into reach. Measured: five
// belts whose peak came as the floor fell slipped by 0.9 to 1.3 %/s over this time before they came
// to it, one that was far from its peak by 0.3 (campaign seeds 990324, 990557, 990673, 991443,
// 991496 in lab noise; coast-overdrive with mu_max 0.16). A fifth less or more ends up to five of
// 98 requests otherwise and leaves the number of values of 188 peaks in reach as it is, in each
// noise.
constexpr Duration kFloorPatience = 1 * kSecond;
constexpr double kFloorFalls_N_per_s = 10.0;
// Chosen: of the energy at which a request ends; below it noise of the slip rate says nothing. A
// fifth less or more: the same 87 and 86 values of 98 peaks in reach in lab and production noise,
// none beyond G1 (campaign --seeds 1500 --from 990001 --nothing-wrong).
constexpr double kReckonedFrom = 0.7;
// Chosen: of the room, from where on it is reckoned anew; in a request that has come so far slip
// takes 0.2 s for the rest. 0.72: the same 87 and 86 values; 0.98: 87 and 85.
constexpr double kNearRoom = 0.9;
constexpr Duration kReleaseMinimum = 300 * kMillisecond;
constexpr Duration kSlipAfter =
    200 * kMillisecond;  // averages noise, forgets macro slip before kReleaseTime
// Slip at the end of a request that shows whether it goes back; and of it, then the force is back.
constexpr double kSlipShown_share = 0.003;
constexpr double kSlipGone = 0.5;
constexpr double kUntrueShare = 0.5;    // of the ratio's drift that another node's speed tells too
constexpr double kStuckForce = 1.1;     // of the last request
constexpr double kStuckFriction = 0.8;  // of the friction expected: the belt is near its peak
}  // namespace

ClampRequest::ClampRequest(const Config& config)
    : settings_(config.experiment),
      rate_max_N_per_s_(config.estimator.ramp_rate_max_N_per_s),
      sample_(period_of(config.estimator.sample_rate_hz)) {
  for (const RoleBinding& binding : config.roles) {
    if (binding.role != Role::kVehicleSpeed) continue;
    speed_step_m_s_ =
        std::abs(binding.factor * (binding.codec.physical(1) - binding.codec.physical(0)));
  }
}

void ClampRequest::begin(const Now& now, const RequestPlan& plan, double floor_N,
                         const AnswerLag::Reading& reading) noexcept {
  standing_ = true;
  followed_ = true;
  far_ = true;
  rides_ = false;
  stop_ = {};
  begun_ = last_ = off_since_ = now.t;
  plan_ = plan;
  anew_ = {};
  law_ = {rate_max_N_per_s_, plan.crossing.ramp_top_N_per_s, plan.crossing.slip_rate_1_s,
          kNearPeak * plan.point.mu_expected, kBelowPeaks * plan.point.mu_least};
  rate_N_per_s_ = rate_max_N_per_s_;
  force_N_ = start_force_N_ = std::max(now.clamp_force_N, floor_N);
  start_torque_Nm_ = now.torque_Nm;
  start_ratio_ = now.omega_s_rad_s / now.omega_p_rad_s;
  start_engine_ = now.omega_e_rad_s / now.omega_p_rad_s;
  start_wheels_ = now.speed_m_s / now.omega_s_rad_s;
  slip_.begin(start_ratio_, start_torque_Nm_);
  damage_.begin(now.t, std::abs(now.mu_star));
  proof_.begin(now.t, {.force_N = force_N_,
                       .follow_band_N = kFollowBand * force_N_ + kFollowBand_N,
                       .configured = {settings_.actuator_dead_time_s, settings_.actuator_lag_s},
                       .reading = reading,
                       .sample = sample_});
  asked_count_ = 1;
  recent_least_N_per_s_ = std::numeric_limits<double>::infinity();
  recent_until_ = now.t;
  asked_[0] = {now.t, force_N_, 0.0, 0.0};
}

double ClampRequest::power_W(const Now& now) const noexcept {
  return (std::max(0.0, slip_.slip_share()) + kSlipAtStart_share) * std::abs(now.torque_Nm) *
         now.omega_p_rad_s;
}

void ClampRequest::follow_belt(const Now& now) noexcept {
  slip_.step(now.t, now.omega_s_rad_s / now.omega_p_rad_s);
  damage_.step(
      {.t = now.t,
       .slip_share = slip_.slip_share(),
       .mu_star = std::abs(now.mu_star),
       .power_W = power_W(now),
       .slip_speed_m_s = slip_.slip_share() * now.omega_p_rad_s * plan_.point.primary_radius_m,
       .grows = rides_ || slip_.rate_1_s() > kSlipGrows_1_s});
  proof_.step({.t = now.t,
               .asked_N = force_N_,
               .read_at = now.read_at,
               .read_N = now.read_N,
               .near = std::abs(now.mu_star) > law_.mu_far,
               .on_floor = rides_});
  reckon_anew(now);
}

void ClampRequest::hold(MonoTime t) noexcept {
  last_ = t;
  proof_.ask(t, force_N_);
}

Stop ClampRequest::judge_slip(const Now&) const noexcept {
  const double slip_share = slip_.slip_share(), rate_1_s = slip_.rate_1_s();
  const double beyond = slip_share - damage_.slip_at_best_share();
  const auto too_much = [](const char* what, StopReason reason, double figure, double limit,
                           const char* unit) {
    return Stop{
        reason,
        {.what = what, .figure = kPercent * figure, .limit = kPercent * limit, .unit = unit}};
  };
  if (slip_share > limits::kRequestSlip_share) {
    return too_much("slip since the start", StopReason::kSlip, slip_share,
                    limits::kRequestSlip_share, "%");
  }
  if (damage_.beyond() && beyond > limits::kRequestSlipBeyond_share) {
    return too_much("slip since friction rose last", StopReason::kSlip, beyond,
                    limits::kRequestSlipBeyond_share, "%");
  }
  const double held_1_s =
      law_.slip_rate_1_s + std::max(kRateLeast_1_s, kRateDeviations * slip_.rate_deviation_1_s());
  const double most_1_s = damage_.beyond() ? std::min(held_1_s, limits::kRequestSlipRate_1_s)
                                           : limits::kRequestSlipRate_1_s;
  if (slip_share > limits::kRequestSlipRateFrom_share && rate_1_s > most_1_s) {
    return too_much("slip grows by", StopReason::kSlipRate, rate_1_s, most_1_s, "%/s");
  }
  return {};
}

Stop ClampRequest::judge_damage(const Now& now) const noexcept {
  const auto too_much = [](const char* what, double figure, double limit, const char* unit) {
    return Stop{StopReason::kSlipEnergy,
                {.what = what, .figure = figure, .limit = limit, .unit = unit}};
  };
  const double now_W = power_W(now);
  const double to_come_J = energy_to_come_J(now), energy_J = damage_.energy_J() + to_come_J;
  if (to_come_J >= kNotCaught) {
    const double mu = std::abs(now.mu_star);
    return too_much("the force before the request would not catch the belt", start_force_N_,
                    peak_force_N(point_now(now, mu), mu), "N");
  }
  if (energy_J > limits::kRequestEnergy_J) {
    return too_much("slip energy beyond the peak, with what is to come", energy_J,
                    limits::kRequestEnergy_J, "J");
  }
  if (!damage_.beyond()) return {};
  if (now_W > limits::kRequestPower_W) {
    return too_much("slip power beyond the peak", now_W, limits::kRequestPower_W, "W");
  }
  if (damage_.fast_s() > limits::kRequestFast_s) {
    return too_much("fast slip beyond the peak, for", damage_.fast_s(), limits::kRequestFast_s,
                    "s");
  }
  return {};
}

double ClampRequest::room_share(const Now& now) const noexcept {
  return peak_slip_max_share(plan_.crossing, SlipLimits{}, std::abs(now.torque_Nm),
                             now.omega_p_rad_s, plan_.point.primary_radius_m);
}

double ClampRequest::slip_in_all_share() const noexcept {
  const double slip_share = slip_.slip_share();
  return slip_share + std::max(kSlipAtStart_share, kStartShare * std::max(0.0, slip_share));
}

// The plan as it is by now.
RampPoint ClampRequest::point_now(const Now& now, double mu) const noexcept {
  RampPoint point = plan_.point;
  point.torque_Nm = std::abs(now.torque_Nm);
  point.omega_p_rad_s = now.omega_p_rad_s;
  point.own_force_N = start_force_N_;
  point.mu_least = mu;
  return point;
}

// With the worst silence: ours, until the receiver's time-out, or an input's.
double ClampRequest::told_s() const noexcept {
  const Reaction& reaction = plan_.reaction;
  return kDecision_s + std::max(reaction.stale_s, reaction.timeout_s) + reaction.cycle_s;
}

// As if the peak came now, if friction still rises; it is then no less than was assumed. Where no
// belt has its peak yet, and where there is little to come, what the power makes of the actuator's
// answer.
double ClampRequest::energy_to_come_J(const Now& now) const noexcept {
  const bool beyond = damage_.beyond();
  const double now_W = power_W(now), longest_J = (told_s() + answer_s()) * now_W;
  const bool near = damage_.mu_best() > law_.mu_top &&
                    damage_.energy_J() + longest_J > kReckonedFrom * limits::kRequestEnergy_J;
  if (!near) return beyond ? (kDecision_s + answer_s()) * now_W : 0.0;
  const double slip_share = std::max(0.0, slip_.slip_share()), mu = std::abs(now.mu_star);
  return daemon::energy_to_come_J(
      point_now(now, beyond ? mu : std::max(plan_.point.mu_least, mu)), plan_.reaction,
      {.slip_share = slip_share + kSlipAtStart_share,
       .beyond_share = beyond ? slip_share - damage_.slip_at_best_share() : 0.0,
       .slip_rate_1_s = slip_.rate_1_s()},
      told_s());
}

// A belt that carries more than was assumed of it is held by its own force with more to spare: near
// the end of its room the crossing is reckoned anew with what it has carried, an excursion a
// sample. Its energy, that is: the slip on its way stays as it was planned, for what slip there is
// in all is known to half a point alone (with it two of 4,000 requests pass 0.8 m/s, by 4 and 7 %).
void ClampRequest::reckon_anew(const Now& now) noexcept {
  room_share_ = room_share(now);
  if (slip_in_all_share() < kNearRoom * room_share_ || !anew_.step()) return;
  if (anew_.crossing().slip_rate_1_s > 0.0) {
    plan_.crossing.dearest.time_s = anew_.crossing().dearest.time_s;
    plan_.crossing.dearest.area_s = anew_.crossing().dearest.area_s;
  }
  anew_ = CrossingSearch(point_now(now, std::max(plan_.point.mu_least, damage_.mu_best())),
                         plan_.reaction, SlipLimits{}, plan_.crossing.slip_rate_1_s);
}

Stop ClampRequest::judge_room() const noexcept {
  const double slip_share = slip_in_all_share();
  if (slip_share > room_share_) {
    return {StopReason::kRoom,
            {.what = "a peak could no longer be crossed, slip",
             .figure = kPercent * slip_share,
             .limit = kPercent * room_share_,
             .unit = "%"}};
  }
  return {};
}

// Beyond the peak it is too late to ask for less.
Stop ClampRequest::judge_lag() const noexcept {
  if (damage_.beyond()) return {};
  const auto answers = [this](const char* what, double figure_s, double limit_s) {
    return Stop{StopReason::kLag,
                {.what = what,
                 .figure = figure_s,
                 .limit = limit_s,
                 .unit = "s",
                 .further = "configured",
                 .further_figure = answer_s(),
                 .further_unit = "s"}};
  };
  if (proof_.late()) {
    return answers("clamping force answers after", proof_.least_s(), proof_.late_s());
  }
  if (proof_.unshown()) {
    return answers("clamping force is not shown to answer before", proof_.most_s(),
                   proof_.credible_s());
  }
  return {};
}

// The floor falls by itself with the speed: a request rides on it for as long as it does.
Stop ClampRequest::judge_floor(const Now& now, double floor_N) const noexcept {
  const double rode_s = rides_ ? seconds(now.t - rides_since_) : 0.0;
  const bool stays =
      rode_s > seconds(kFloorPatience) && floor_first_N_ - floor_N < kFloorFalls_N_per_s * rode_s;
  const bool over =
      now.omega_p_rad_s < limits::kRequestSpeedShare * settings_.primary_speed_min_rad_s;
  // Arming found no more than this in reach; a belt that holds there is far from its peak.
  const bool holds = rides_ && std::abs(now.mu_star) > plan_.point.mu_expected && belt_holds();
  if (force_N_ < floor_N || stays || holds || (rides_ && over)) {
    return {StopReason::kForceFloor,
            {.what = "request at its floor", .figure = force_N_, .limit = floor_N, .unit = "N"}};
  }
  return {};
}

// For as long, in which noise makes little of it.
bool ClampRequest::belt_holds() const noexcept {
  constexpr std::size_t kAge = static_cast<std::size_t>(kFloorPatience / kCoursePeriod);
  static_assert(kAge < kAsked);
  if (asked_count_ <= kAge) return false;
  const Asked& then = asked(kAge);
  return slip_.slip_share() - then.slip_share < kSlipGrows_1_s * seconds(last_ - then.t);
}

Stop ClampRequest::judge(const Now& now, double floor_N) const noexcept {
  if (const Stop stop = judge_slip(now)) return stop;
  if (const Stop stop = judge_damage(now)) return stop;
  if (const Stop stop = judge_room()) return stop;
  if (const Stop stop = judge_lag()) return stop;
  if (const Stop stop = judge_floor(now, floor_N)) return stop;
  if (now.t - begun_ >= limits::kRequestLongest) {
    return {StopReason::kTime,
            {.what = "request stood for",
             .figure = seconds(now.t - begun_),
             .limit = seconds(limits::kRequestLongest),
             .unit = "s"}};
  }
  if (const Stop stop = judge_course(now)) return stop;
  const double given_rad_s = now.omega_s_rad_s / start_ratio_;
  const double off = std::abs(now.omega_p_rad_s / given_rad_s - 1.0);
  if (off > kSpeedBand) {
    return {StopReason::kEngineSpeed,
            {.what = "off the speed that the secondary gives it by",
             .figure = kPercent * off,
             .limit = kPercent * kSpeedBand,
             .unit = "%",
             .role = Role::kPrimarySpeed}};
  }
  const double least_rad_s = limits::kRequestSpeedShare * settings_.primary_speed_min_rad_s;
  if (now.omega_p_rad_s < least_rad_s) {
    return {StopReason::kEngineSpeed,
            {.what = "falls to",
             .figure = now.omega_p_rad_s,
             .limit = least_rad_s,
             .unit = "rad/s",
             .role = Role::kPrimarySpeed}};
  }
  const double torque_off_Nm = std::abs(now.torque_Nm - start_torque_Nm_);
  const double torque_band_Nm = kTorqueBand * std::abs(start_torque_Nm_) + kTorqueBand_Nm;
  if (torque_off_Nm > torque_band_Nm) {
    return {StopReason::kTorque,
            {.what = "torque on the belt has changed by",
             .figure = torque_off_Nm,
             .limit = torque_band_Nm,
             .unit = "Nm"}};
  }
  return {};
}

// Slip lowers the speed ratio in drive and raises it in overrun. Where it moves the other way while
// the force falls, a speed is not true, or the transmission shifts.
Stop ClampRequest::judge_course(const Now& now) const noexcept {
  const double drift = now.omega_s_rad_s / now.omega_p_rad_s / start_ratio_ - 1.0;
  const double wrong_way = drift * std::copysign(1.0, start_torque_Nm_);
  if (wrong_way <= kRatioBand) return {};
  const std::optional<Role> untrue = untrue_speed(now, drift);
  return {untrue ? StopReason::kInputFrozen : StopReason::kRatio,
          {.what = untrue ? "alone moves the speed ratio against the torque, by"
                          : "speed ratio has moved against the torque by",
           .figure = kPercent * wrong_way,
           .limit = kPercent * kRatioBand,
           .unit = "%",
           .role = untrue}};
}

// The shaft whose speed has left a neighbour's by as much and in the same direction. A torque that
// changes moves the neighbour the other way, a shift moves it along.
std::optional<Role> ClampRequest::untrue_speed(const Now& now, double drift) const noexcept {
  const double told = kUntrueShare * std::abs(drift);
  if (start_engine_ > 0.0 && now.omega_e_rad_s > 0.0) {
    const double left = now.omega_e_rad_s / now.omega_p_rad_s / start_engine_ - 1.0;
    if (left * std::copysign(1.0, drift) > told) return Role::kPrimarySpeed;
  }
  if (start_wheels_ > 0.0 && now.speed_m_s > 0.0) {
    const double left = now.omega_s_rad_s * start_wheels_ / now.speed_m_s - 1.0;
    if (left * std::copysign(1.0, drift) > told + speed_step_m_s_ / now.speed_m_s) {
      return Role::kSecondarySpeed;
    }
  }
  return std::nullopt;
}

// Noise of the slip rate alone may say that the peak is near; the fall to the rest need not be slow
// for that, for it goes no further until the answer is known.
double ClampRequest::wanted_rate_N_per_s(double mu_star) const noexcept {
  if (proof_.rests()) return std::min(proof_.rest_N_per_s(), law_.rate_max_N_per_s);
  if (far_) return law_.rate_max_N_per_s;
  if (!proof_.falls()) return ramp_near_N_per_s(law_, mu_star, slip_.rate_1_s());
  RampLaw law = law_;
  law.mu_top = law.mu_far;
  return ramp_near_N_per_s(law, mu_star, slip_.rate_1_s());
}

// The force that the ramp has come to, not below the floor.
double ClampRequest::lowered_N(const Now& now, double floor_N) noexcept {
  const double step_s = seconds(now.t - last_);
  far_ = far_ && peak_is_far(law_, std::abs(now.mu_star), slip_.rate_1_s());
  const double wanted_N_per_s = wanted_rate_N_per_s(std::abs(now.mu_star));
  return std::max(force_N_ - wanted_N_per_s * step_s, std::min(force_N_, floor_N + kFloorNoise_N));
}

void ClampRequest::go_to(const Now& now, double floor_N, double force_N) noexcept {
  const double step_s = seconds(now.t - last_);
  const double before_N = force_N_;
  const bool rode = rides_;
  rides_ = force_N_ <= floor_N + (rode ? 2.0 : 1.0) * kFloorNoise_N;
  if (rides_ && !rode) {
    rides_since_ = now.t;
    floor_first_N_ = floor_N;
  }
  force_N_ = force_N;
  rate_N_per_s_ = step_s > 0.0 ? (before_N - force_N_) / step_s : 0.0;
  const Asked& before = asked(0);
  if (now.t - before.t >= kCoursePeriod) {
    const double over_s = seconds(now.t - before.t);
    asked_[asked_count_ % kAsked] = {now.t, force_N_, (before.force_N - force_N_) / over_s,
                                     slip_.slip_share()};
    ++asked_count_;
    recent_until_ = before.t;
  }
  last_ = now.t;
  if (last_ > recent_until_) look_back();
  proof_.ask(now.t, force_N_);
  off_N_ = std::abs(now.clamp_force_N - force_N_);
  if (off_N_ <= follow_band_N()) off_since_ = now.t;
  followed_ = now.t - off_since_ <= kFollowTime;
}

void ClampRequest::step(const Now& now, double floor_N) noexcept {
  if (!standing_) return;
  follow_belt(now);
  if (!stop_) stop_ = judge(now, floor_N);
  go_to(now, floor_N, lowered_N(now, floor_N));
}

void ClampRequest::follow(const Now& now, double floor_N, double force_N) noexcept {
  follow_belt(now);
  if (!stop_) stop_ = judge(now, floor_N);
  go_to(now, floor_N, force_N);
}

// A force that follows is behind by what the request fell within the actuator's answer.
double ClampRequest::follow_band_N() const noexcept {
  const std::size_t age =
      std::min(asked_count_, static_cast<std::size_t>(kRecent / kCoursePeriod)) - 1;
  const double over_s = seconds(last_ - asked(age).t);
  const double behind_N =
      over_s > 0.0 ? std::min(1.0, answer_s() / over_s) * (asked(age).force_N - force_N_) : 0.0;
  return kFollowBand * force_N_ + kFollowBand_N + behind_N;
}

double ClampRequest::rate_least_N_per_s() const noexcept {
  return std::min(rate_N_per_s_, recent_least_N_per_s_);
}

// Of those within kRecent; it holds until the next is kept, or the oldest of them is older.
void ClampRequest::look_back() noexcept {
  recent_least_N_per_s_ = std::numeric_limits<double>::infinity();
  for (std::size_t age = 0; age + 1 < std::min(asked_count_, kAsked); ++age) {
    const Asked& each = asked(age);
    if (last_ - each.t > kRecent) break;
    recent_least_N_per_s_ = std::min(recent_least_N_per_s_, each.rate_N_per_s);
    recent_until_ = each.t + kRecent;
  }
}

bool ClampRequest::changed_since(MonoTime t) const noexcept {
  double then_N = force_N_;
  for (std::size_t age = 0; age < std::min(asked_count_, kAsked) && asked(age).t >= t; ++age) {
    then_N = asked(age).force_N;
  }
  return then_N - force_N_ > follow_band_N();
}

void ClampRequest::end(MonoTime t) noexcept {
  if (standing_) slip_after_share_ = slip_.slip_share();
  standing_ = false;
  ended_ = t;
  rest_s_ = rest_m_ = 0.0;
  travelled_ = false;
}

bool ClampRequest::released(const Now& now) const noexcept {
  const Duration since = now.t - ended_;
  return (since >= kReleaseMinimum && now.clamp_force_N >= kRestored * start_force_N_) ||
         since >= kReleaseTime;
}

void ClampRequest::follow_release(const Now& now) noexcept {
  const double slip_share = slip_.slip_share_at(now.omega_s_rad_s / now.omega_p_rad_s);
  const double share = std::min(1.0, fraction(now.t - last_, kSlipAfter));
  slip_after_share_ += share * (slip_share - slip_after_share_);
  last_ = now.t;
}

std::optional<bool> ClampRequest::grips_again() const noexcept {
  if (slip_.slip_share() < kSlipShown_share) return std::nullopt;
  return slip_after_share_ < kSlipGone * slip_.slip_share();
}

bool ClampRequest::stuck(const Now& now) const noexcept {
  return now.t - ended_ >= kReleaseTime && now.clamp_force_N <= kStuckForce * force_N_ &&
         now.mu_star >= kStuckFriction * settings_.friction_expected;
}

void ClampRequest::travel(MonoTime t, double speed_m_s) noexcept {
  if (travelled_) {
    const double step_s = seconds(t - last_travel_);
    rest_s_ += step_s;
    rest_m_ += std::max(0.0, speed_m_s) * step_s;
  }
  travelled_ = true;
  last_travel_ = t;
}

bool ClampRequest::cooled() const noexcept {
  return rest_s_ >= settings_.cooldown_s && rest_m_ >= settings_.cooldown_m;
}

}  // namespace beltgrip::daemon
