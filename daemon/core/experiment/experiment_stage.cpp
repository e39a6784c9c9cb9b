#include "daemon/core/experiment/experiment_stage.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "daemon/core/base/limits.h"
#include "daemon/core/experiment/stop_of.h"
#include "estimator/physics/clamp_force.h"

namespace beltgrip::daemon {

using estimator::ReadingVerdict;

using estimator::PeakKind;
using estimator::StopReason;
using estimator::VariatorSample;

namespace {

constexpr double kAnswerLags = 3.0;       // of the actuator: then its pressure has answered
constexpr double kSlipped_percent = 1.5;  // more than deformation and a drift of the ratio explain
constexpr double kSlipOfAPeak_share = 0.007;  // since the start: less of it has passed no peak

bool in_experiment(State state) noexcept {
  return state == State::kRamping || state == State::kEvaluating || state == State::kReleasing;
}

// A fault under which nothing may be asked; two of them stay until a restart.
bool forbids(const FaultSet& faults) noexcept {
  return faults.has(Fault::kForeignSender) || faults.has(Fault::kFrameRefused) ||
         faults.has(Fault::kClampStuck);
}

// Under these no request begins.
bool delays(const FaultSet& faults) noexcept {
  return faults.has(Fault::kForeignSender) || faults.has(Fault::kFrameRefused) ||
         faults.has(Fault::kBusPassive) || faults.has(Fault::kSampleLate) ||
         faults.has(Fault::kBusOff) || faults.has(Fault::kBusDown) ||
         faults.has(Fault::kSendFailed);
}

}  // namespace

ExperimentStage::ExperimentStage(const Config& config, std::optional<RecordedRequests> recorded)
    : config_(config),
      arming_(config),
      request_(config),
      by_record_(recorded.has_value()),
      recorded_(std::move(recorded).value_or(RecordedRequests({}))) {}

bool ExperimentStage::runs() const noexcept { return in_experiment(state_); }

SlipShown& ExperimentStage::shown(estimator::Direction direction,
                                  estimator::EndStop end_stop) noexcept {
  return slip_shown_[direction == estimator::Direction::kDrive ? 0 : 1]
                    [end_stop == estimator::EndStop::kOverdrive ? 0 : 1];
}

FallShown& ExperimentStage::fall_shown(estimator::Direction direction,
                                       estimator::EndStop end_stop) noexcept {
  return fall_shown_[direction == estimator::Direction::kDrive ? 0 : 1]
                    [end_stop == estimator::EndStop::kOverdrive ? 0 : 1];
}

// --- before an experiment --------------------------------------------------------------------

Conditions ExperimentStage::read_conditions(const InputMonitor& channels) const noexcept {
  Conditions now;
  now.permitted = channels.value_or(Role::kExperimentPermitted, 1.0, now.fresh) > 0.5;
  now.lockup_closed = channels.value_or(Role::kLockupClosed, 1.0, now.fresh) > 0.5;
  now.brake_pressed = channels.value_or(Role::kBrakePressed, 0.0, now.fresh) > 0.5;
  now.accelerator = channels.value_or(Role::kAcceleratorPedal, now.accelerator, now.fresh);
  now.oil_degC = channels.value_or(Role::kOilTemperature, now.oil_degC, now.fresh);
  return now;
}

bool ExperimentStage::arm(const Now& now, const KnownFriction& known,
                          double friction_as_read) noexcept {
  new_result_ = false;
  if (by_record_) recorded_.step(now.t);
  const InputMonitor& channels = now.input.channels();
  if (by_conditions()) {
    conditions_ = read_conditions(channels);
    if (!runs()) {
      const VariatorSample& sample = now.input.sample();
      const estimator::CurveEstimate& curve = now.estimate.curve();
      Arming::Now arming;
      arming.t = now.t;
      arming.usable = sample.usable && curve.usable;
      arming.beyond_box = now.estimate.is_beyond();
      arming.cooled = !commands() || request_.cooled();
      arming.faulted = commands() && (delays(now.faults) || channels.suspect() || now.unconfirmed);
      arming.omega_p_rad_s = sample.omega_p_rad_s;
      arming.omega_s_rad_s = sample.omega_s_rad_s;
      arming.torque_Nm = curve.torque_p_Nm;
      arming.clamp_force_N = now.estimate.measured_force_N();
      arming.slip_percent = curve.sigma_star_percent;
      arming.mu_max_known = known.peak_as_read(curve, friction_as_read);
      arming.mu_carried = known.carried();
      arming.shown = shown(curve.direction, curve.end_stop);
      arming.stale = now.input.slowest_stale();
      arming.watched = !commands() || state_ != State::kSettling || channels.standstill_shows();
      arming.conditions = conditions_;
      arming_.step(arming);
      would_ask_ = arming_.triggered() && (would_ask_ || (arming_.settled() && arming_.cleared()));
    }
  }
  const bool announced_before = announced_.has_value();
  const bool ready = asks() && by_conditions() && state_ == State::kSettling && arming_.settled() &&
                     arming_.cleared();
  if (!ready) {
    announced_.reset();
  } else if (!announced_) {
    announced_ = now.t;
  }
  bool speed_known = true;
  const double speed_m_s = channels.value_or(Role::kVehicleSpeed, 0.0, speed_known);
  request_.travel(now.t, speed_known ? speed_m_s : 0.0);
  return announced_ && !announced_before;
}

bool ExperimentStage::triggered(const Now& now) const noexcept {
  if (by_conditions()) return runs() ? !ended_by(now.input.sample()) : arming_.triggered();
  if (config_.trigger == Trigger::kAlways) return true;
  // A signal that has gone keeps its last word: the end of an experiment must be said.
  const SignalHistory& active = now.input.channels().history(Role::kExperimentActive);
  return !active.empty() && active.newest_value() > 0.5;
}

// --- what ends an experiment ------------------------------------------------------------------

// What of the car ends the experiment under way. Torque, ratio and slip are what it is about: they
// are the estimator's to judge.
Stop ExperimentStage::ended_by(const VariatorSample& sample) const noexcept {
  const double speed_min_rad_s = limits::kRequestSpeedShare * arming_.speed_min_rad_s();
  if (sample.omega_p_rad_s < speed_min_rad_s) {
    return {StopReason::kEngineSpeed,
            {.what = "falls to",
             .figure = sample.omega_p_rad_s,
             .limit = speed_min_rad_s,
             .unit = "rad/s",
             .role = Role::kPrimarySpeed}};
  }
  return arming_.ended_by(conditions_);
}

// An observed experiment is over when what it needs of the car has gone, or when the force that was
// lowered is back and holds the belt: not before, the flag tells whoever lowers it.
bool ExperimentStage::observed_over(const Now& now) const noexcept {
  const VariatorSample& sample = now.input.sample();
  const double torque_Nm =
      config_.trigger == Trigger::kCoastDown ? -sample.torque_Nm : sample.torque_Nm;
  if (!triggered(now) || now.input.channels().any_lost() || torque_Nm < 0.0) return true;
  const double restored_N = ClampRequest::kRestored * own_force_N_;
  return now.estimate.curve().usable && running_.clamp_force_N < restored_N &&
         now.estimate.measured_force_N() >= restored_N &&
         arming_.at_end_stop(sample.omega_s_rad_s / sample.omega_p_rad_s,
                             now.estimate.measured_force_N());
}

bool ExperimentStage::starved(const Now& now) const noexcept {
  return state_ == State::kRamping && now.input.starved(now.t);
}

// Why there is no sample where there should be one.
Stop ExperimentStage::lost(const Now& now) const noexcept {
  if (const Stop gone = now.input.lost(now.t)) return gone;
  if (starved(now)) return now.input.starved_for(now.t);
  return now.input.missing_condition();
}

void ExperimentStage::withdraw(const Stop& stop) noexcept {
  if (!withdrawn_) withdrawn_ = stop;
}

void ExperimentStage::withdraw_for_bus(const Now& now) noexcept {
  const char* what = clamp_refused_ ? "a clamp frame could not be sent"
                     : now.faults.has(Fault::kForeignSender)
                         ? "a foreign sender uses our identifiers"
                     : now.faults.has(Fault::kFrameRefused) ? "the transmit gate refused a frame"
                     : now.unconfirmed                      ? "clamp frames are not confirmed"
                                                            : nullptr;
  if (what != nullptr) withdraw({StopReason::kBus, {.what = what}});
}

// --- the request ------------------------------------------------------------------------------

InputMonitor::Watch ExperimentStage::watch(double torque_Nm) const noexcept {
  InputMonitor::Watch watch;
  watch.on = commands() && ((runs() && !refused_) || state_ == State::kSettling);
  watch.slopes = state_ == State::kSettling || state_ == State::kRamping;
  if (commands() && state_ == State::kRamping) {
    watch.torque_sign = std::copysign(1.0, torque_Nm);
    watch.request_begun = running_.start;
    watch.fall_Pa_per_s = request_.rate_least_N_per_s() / config_.variator.secondary_piston_area_m2;
    watch.answer =
        Duration::of_ns(std::llround(1e9 * (config_.experiment.actuator_dead_time_s +
                                            kAnswerLags * config_.experiment.actuator_lag_s)));
  }
  return watch;
}

ClampRequest::Now ExperimentStage::request_now(const Now& now) const noexcept {
  const VariatorSample& sample = now.input.sample();
  const estimator::CurveEstimate& curve = now.estimate.curve();
  const InputMonitor& channels = now.input.channels();
  const SignalHistory& pressure = channels.history(Role::kSecondaryPressure);
  return {now.t,
          sample.omega_p_rad_s,
          sample.omega_s_rad_s,
          curve.torque_p_Nm,
          now.estimate.measured_force_N(),
          curve.mu_star,
          channels.value_if_known(Role::kEngineSpeed),
          channels.value_if_known(Role::kVehicleSpeed),
          pressure.newest() - channels.delay(Role::kSecondaryPressure),
          estimator::secondary_clamp_force_N(config_.variator, pressure.newest_value(),
                                             sample.omega_s_rad_s)};
}

AnswerLag::Reading ExperimentStage::force_reading(const Now& now) const noexcept {
  const ValueCourse& pressure = now.input.channels().course(Role::kSecondaryPressure);
  const double area_m2 = config_.variator.secondary_piston_area_m2;
  return {area_m2 * pressure.noise(), area_m2 * pressure.resolution()};
}

// The torque as it came last, not as the sampler delays it.
DriveChanges::Now ExperimentStage::drive_now(const Now& now) const noexcept {
  const Role torque =
      config_.estimator.torque_is_engine ? Role::kEngineTorque : Role::kPrimaryTorque;
  const SignalHistory& history = now.input.channels().history(torque);
  return {.t = now.t,
          .accelerator = conditions_.accelerator,
          .torque_Nm = history.newest_value(),
          .torque_at = history.newest()};
}

void ExperimentStage::count(const Now& now) noexcept {
  if (state_ != State::kRamping || !now.input.sample().usable) return;
  ++running_.samples;
  if (now.estimate.is_beyond()) running_.beyond.take(now.estimate.beyond());
  const estimator::CurveEstimate& curve = now.estimate.curve();
  if (!curve.usable) return;
  mu_star_most_ = std::max(mu_star_most_, std::abs(curve.mu_star));
  last_points_.add(std::abs(curve.sigma_star_percent), std::abs(curve.mu_star));
}

RoleSet ExperimentStage::step_request(const Now& now) noexcept {
  RoleSet still;
  backup_stop_ = withdrawn_ = {};
  if (!commands()) return still;
  const Stop changed = changes_.step(drive_now(now));
  if (state_ == State::kRamping) {
    if (!conditions_.fresh) withdraw(now.input.missing_condition());
    if (now.input.channels().suspect()) {
      withdraw({StopReason::kInputs, {.what = "a message at a wrong rate, or its counter or CRC"}});
    }
    withdraw(arming_.ended_by(conditions_));
    withdraw_for_bus(now);
    withdraw(changed);
    if (now.input.sample().usable && now.estimate.curve().usable) {
      const double floor_N = arming_.floor_N(now.input.sample().omega_s_rad_s);
      if (!by_record_) {
        request_.step(request_now(now), floor_N);
      } else if (follows_on()) {
        request_.follow(request_now(now), floor_N, recorded_.force_N());
      }
      backup_stop_ = {request_.backup_stop(), request_.cause()};
      if (backup_stop_.reason == StopReason::kInputFrozen && backup_stop_.cause.role) {
        still.set(static_cast<std::size_t>(*backup_stop_.cause.role));
        withdraw(backup_stop_);
      }
      judge_following(now, still);
    } else {
      request_.hold(now.t);
    }
    const bool stops = backup_stop_ || now.estimate.curve().stop != StopReason::kNone;
    if (stops) withdraw(changes_.unsettled());
    if (by_record_) go_by_record(now.estimate.curve(), still);
  }
  if (state_ == State::kReleasing && !refused_) judge_release(now, still);
  if (state_ != State::kRamping) judge_own_force(now);
  clamp_refused_ = false;
  return still;
}

// --- the request of a record ------------------------------------------------------------------

// The request of the experiment under way stands in the record, still.
bool ExperimentStage::follows_on() const noexcept { return recorded_.standing() == followed_; }

// The record says when the request ends, and why. What is judged here lends its words where it
// comes to the same.
void ExperimentStage::go_by_record(const estimator::CurveEstimate& curve, RoleSet& still) noexcept {
  // A controller withdraws its permission for what the driver does, and that is then seen first.
  Conditions permitted = conditions_;
  permitted.permitted = true;
  const std::array<Stop, 4> judged{stop_of(curve), withdrawn_, backup_stop_,
                                   arming_.ended_by(permitted)};
  backup_stop_ = withdrawn_ = {};
  if (follows_on() || followed_->reason != StopReason::kInputFrozen) still.reset();
  if (follows_on() || followed_->reason == StopReason::kNone) return;
  Stop why{followed_->reason, {}};
  for (const Stop& each : judged) {
    if (each.reason != why.reason) continue;
    why = each;
    break;
  }
  (followed_->outcome == Outcome::kAborted ? withdrawn_ : backup_stop_) = why;
}

// It says when one begins, too. Where it has none, what would be refused is refused, but not what
// would have been asked for: the log's daemon knew better.
void ExperimentStage::guard_by_record(Guards& guards) const noexcept {
  const bool begins = recorded_.begins() && recorded_.standing() != followed_;
  guards.faulted = false;
  guards.cooled = guards.cooled || recorded_.near();
  if (state_ == State::kRamping) {
    guards.triggered = follows_on();
  } else if (!runs()) {
    guards.triggered = guards.triggered || begins;
    guards.settled =
        begins || (guards.settled && !arming_.cleared() && !recorded_.near() && !would_ask_);
    guards.cleared = begins;
  }
}

// --- the request's force -----------------------------------------------------------------------

// Does the force follow, and is it the force that does not, or its reading?
void ExperimentStage::judge_following(const Now& now, RoleSet& still) noexcept {
  if (request_.followed()) return;
  const ValueCourse& pressure = now.input.channels().course(Role::kSecondaryPressure);
  if (request_.changed_since(pressure.since()) &&
      pressure.stood_for() >= ClampRequest::kFollowTime) {
    still.set(static_cast<std::size_t>(Role::kSecondaryPressure));
    withdraw({StopReason::kInputFrozen,
              {.what = "stands still while the request falls, for",
               .figure = seconds(pressure.stood_for()),
               .unit = "s",
               .role = Role::kSecondaryPressure}});
    return;
  }
  withdraw({StopReason::kClampNotFollowed,
            {.what = "clamping force off the request by",
             .figure = request_.off_N(),
             .limit = request_.follow_band_N(),
             .unit = "N"}});
}

// A force that seems not to come back: is it the force, or its reading?
void ExperimentStage::judge_release(const Now& now, RoleSet& still) noexcept {
  if (!now.input.sample().usable || !now.estimate.curve().usable) return;
  const ClampRequest::Now request = request_now(now);
  request_.follow_release(request);
  if (!request_.stuck(request)) return;
  const MonoTime since = now.input.channels().course(Role::kSecondaryPressure).since();
  misread_ = request_.grips_again().value_or(since <= request_.ended());
  if (misread_) still.set(static_cast<std::size_t>(Role::kSecondaryPressure));
}

// After each request the controller has to give once what it gave before, else it is not asked
// again.
void ExperimentStage::judge_own_force(const Now& now) noexcept {
  if (!now.input.sample().usable || !now.estimate.curve().usable) return;
  returned_.step({.t = now.t,
                  .force_N = now.estimate.measured_force_N(),
                  .torque_Nm = now.estimate.curve().torque_p_Nm});
  const bool in_time = now.t - request_.ended() < ClampRequest::kReleaseTime;
  if (asks() && !returned_.back() && !in_time && !misread_) {
    now.faults.raise(Fault::kClampStuck, now.t);
  }
}

void ExperimentStage::take(SafetyVerdict verdict, double figure, double limit,
                           const Now& now) noexcept {
  const Stop stop = stop_of(verdict, figure, limit);
  if (stop.reason == StopReason::kInputs) {
    withdraw(verdict == SafetyVerdict::kInputs ? lost(now) : stop);
  } else if (!backup_stop_) {
    backup_stop_ = stop;
  }
}

// --- from state to state ------------------------------------------------------------------------

Guards ExperimentStage::guards(const Now& now) const noexcept {
  Guards guards;
  const bool usable = now.input.sample().usable;
  guards.inputs_usable = usable && (state_ != State::kInhibited || now.input.usable_again(now.t));
  guards.inputs_lost = now.input.any_lost() || starved(now) || (observes() && !conditions_.fresh);
  if (guards.inputs_lost) guards.lost_reason = lost(now).reason;
  guards.bus_up = now.input.buses().needed_up();
  guards.triggered = triggered(now);
  guards.settled = !by_conditions() || arming_.settled();
  if (asks() && arming_.cleared()) {
    guards.settled = guards.settled && announced_ && now.t - *announced_ >= limits::kAnnounced &&
                     now.inactive_sent;
  }
  guards.cleared = !commands() || arming_.cleared();
  const bool releasing = state_ == State::kReleasing;
  if (releasing) guards.released = observes() ? observed_over(now) : !guards.triggered;
  guards.cooled = true;
  if (!commands()) return guards;
  // While a request stands, its own stops say when it ends.
  if (state_ == State::kRamping) guards.triggered = true;
  if (releasing) {
    const ClampRequest::Now request = request_now(now);
    guards.released = refused_ || request_.released(request);
    guards.stuck = !refused_ && usable && !misread_ && request_.stuck(request);
  }
  guards.cooled = request_.cooled();
  guards.faulted = forbids(now.faults);
  if (by_record_) guard_by_record(guards);
  return guards;
}

Action ExperimentStage::begin(const Now& now) noexcept {
  if (runs()) return Action::kNone;
  return apply(next_state(state_, guards(now)), now);
}

Action ExperimentStage::end(const Now& now) noexcept {
  if (state_ != State::kRamping && state_ != State::kReleasing) return Action::kNone;
  Guards after = guards(now);
  after.stop_decided =
      now.estimate.curve().stop != StopReason::kNone || static_cast<bool>(backup_stop_);
  after.withdrawn = static_cast<bool>(withdrawn_);
  after.withdrawn_reason = withdrawn_.reason;
  return apply(next_state(state_, after), now);
}

void ExperimentStage::release(const Now& now) noexcept {
  Guards concluded;
  concluded.concluded = true;
  apply(next_state(state_, concluded), now);
}

Action ExperimentStage::apply(const Transition& transition, const Now& now) noexcept {
  switch (transition.action) {
    case Action::kNone:
    case Action::kPublish:
      break;
    case Action::kStart:
      start(now);
      break;
    case Action::kRefuse:
      running_ = {};
      running_.start = now.t;
      refused_ = true;
      request_.end(now.t);
      stop(now.t, stop_of(arming_.inhibits(), arming_.obstacle()), now);
      break;
    case Action::kStop:
      macro_slip_stop_ = true;
      running_.stopped = true;
      stop(now.t, backup_stop_ ? backup_stop_ : stop_of(now.estimate.curve()), now);
      break;
    case Action::kEnd:
      stop(now.t, observes() ? ended_by(now.input.sample()) : Stop{}, now);
      break;
    case Action::kAbort:
      macro_slip_stop_ = true;
      running_.stopped = true;
      stop(now.t, abort_of(transition.abort_reason, now), now);
      keep_result(Outcome::kAborted);  // says nothing of mu_max: what is known of it stands
      break;
    case Action::kOver:
      macro_slip_stop_ = false;
      if (transition.next == State::kFault) now.faults.latch(Fault::kClampStuck);
      arming_.reset();
      break;
  }
  state_ = transition.next;  // after it is said why: what is lost depends on what was going on
  if (state_ != State::kRamping && request_.standing()) {
    request_.end(now.t);
    returned_.end();
  }
  return transition.action;
}

void ExperimentStage::start(const Now& now) noexcept {
  const VariatorSample& sample = now.input.sample();
  if (commands()) {
    request_.begin(request_now(now), arming_.plan(), arming_.floor_N(sample.omega_s_rad_s),
                   force_reading(now));
    returned_.begin();
    if (by_record_) followed_ = recorded_.standing();
  }
  own_force_N_ = now.estimate.measured_force_N();
  omega_s_start_rad_s_ = sample.omega_s_rad_s;
  mu_star_most_ = 0.0;
  last_points_.clear();
  sigma_first_percent_ = std::abs(now.estimate.curve().sigma_star_percent);
  running_ = {};
  running_.start = now.t;
  slip_own_percent_ = arming_.slip_percent();
  refused_ = misread_ = false;
}

void ExperimentStage::stop(MonoTime t, const Stop& why, const Now& now) noexcept {
  const VariatorSample& sample = now.input.sample();
  const estimator::CurveEstimate& curve = now.estimate.curve();
  const InputMonitor& channels = now.input.channels();
  running_.end = t;
  running_.stop_reason = why.reason;
  running_.cause = why.cause;
  running_.sigma_stop_percent = std::abs(curve.sigma_star_percent);
  running_.direction = curve.direction;
  running_.end_stop = curve.end_stop;
  running_.omega_p_rad_s = sample.omega_p_rad_s;
  running_.omega_s_rad_s = sample.omega_s_rad_s;
  running_.torque_Nm = curve.torque_p_Nm;
  running_.clamp_force_N = curve.clamp_force_N;
  const bool oil_known = channels.verdict(Role::kOilTemperature) == ReadingVerdict::kValid;
  running_.oil_degC = oil_known ? channels.history(Role::kOilTemperature).newest_value()
                                : std::numeric_limits<double>::quiet_NaN();
}

// With the reason that the state machine chose.
Stop ExperimentStage::abort_of(StopReason reason, const Now& now) const noexcept {
  if (withdrawn_.reason == reason) return withdrawn_;
  if (reason == StopReason::kBus) return {reason, {.what = "a bus is down or off"}};
  const Stop gone = lost(now);
  return gone.reason == reason ? gone : Stop{reason, {}};
}

StopCause ExperimentStage::obstacle() const noexcept {
  const std::uint32_t forbidden = inhibits() & Arming::kForbids;
  return forbidden != 0 ? stop_of(forbidden, arming_.obstacle()).cause : StopCause{};
}

// --- its result ---------------------------------------------------------------------------------

bool ExperimentStage::stopped_by_slip() const noexcept {
  const StopReason reason = running_.stop_reason;
  return running_.stopped && (reason == StopReason::kSlope || reason == StopReason::kSlip ||
                              reason == StopReason::kSlipRate ||
                              reason == StopReason::kSlipEnergy || reason == StopReason::kRoom);
}

bool ExperimentStage::stopped_at_the_top() const noexcept {
  return running_.stop_reason == StopReason::kSlipEnergy ||
         running_.stop_reason == StopReason::kSlipRate;
}

EndedExperiment ExperimentStage::ended() const noexcept {
  const StopReason reason = running_.stop_reason;
  EndedExperiment ended;
  ended.direction = running_.direction;
  ended.end_stop = running_.end_stop;
  ended.duration = running_.end - running_.start;
  ended.ramped = !refused_;
  ended.passed_a_peak = !commands() || !(request_.slip_max_share() < kSlipOfAPeak_share);
  ended.ended_by_slip = stopped_by_slip();
  ended.may_have_slipped = running_.stopped && reason == StopReason::kInputs &&
                           running_.sigma_stop_percent - sigma_first_percent_ > kSlipped_percent;
  ended.mu_star_most = mu_star_most_;
  ended.omega_s_start_rad_s = omega_s_start_rad_s_;
  ended.omega_s_end_rad_s = running_.omega_s_rad_s;
  ended.clamp_force_end_N = running_.clamp_force_N;
  return ended;
}

void ExperimentStage::keep_result(Outcome outcome) noexcept {
  running_.outcome = outcome;
  result_ = running_;
  new_result_ = true;
}

void ExperimentStage::conclude(const estimator::PeakEstimate& peak, double sensor_std,
                               bool slipped) noexcept {
  running_.peak = peak;
  running_.sensor_std = sensor_std;
  const bool is_value = peak.kind == PeakKind::kValue;
  keep_result(is_value ? Outcome::kCompleted : Outcome::kInconclusive);
  result_.slipped = slipped;
  if (!commands()) return;
  SlipShown& shown_here = shown(running_.direction, running_.end_stop);
  // Without a value, what was let go for its slip came at least that far up.
  const bool first_seen =
      shown_here.peak_percent <= 0.0 && stopped_by_slip() && peak.kind != PeakKind::kNone;
  if (is_value || first_seen) {
    if (running_.stop_reason == StopReason::kSlope) {
      last_points_.show(peak.sigma_peak_percent, fall_shown(running_.direction, running_.end_stop));
    }
    shown_here = {slip_own_percent_, peak.sigma_peak_percent,
                  fall_shown(running_.direction, running_.end_stop).range()};
  }
}

bool ExperimentStage::cut_short(MonoTime t, StopReason reason, const Now& now) noexcept {
  new_result_ = false;
  const bool ramping = state_ == State::kRamping;
  if (ramping) stop(t, {reason, {}}, now);
  return ramping || state_ == State::kEvaluating;
}

void ExperimentStage::go_idle(MonoTime t) noexcept {
  state_ = State::kInhibited;
  if (request_.standing()) request_.end(t);
}

void ExperimentStage::go_on_from(const ExperimentStage& before, bool keeps_results) noexcept {
  // While a fault forbids requests; a controller that kept one is not to be asked again at all.
  if (before.state_ == State::kFault) state_ = State::kFault;
  returned_ = before.returned_;
  if (!keeps_results) return;
  result_ = before.result_;
  slip_shown_ = before.slip_shown_;
  fall_shown_ = before.fall_shown_;
}

}  // namespace beltgrip::daemon
