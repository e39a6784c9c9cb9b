#include "daemon/core/pipeline.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "daemon/core/bus_error.h"
#include "daemon/core/pipeline_parts.h"
#include "estimator/sensor_error.h"
#include "estimator/slip.h"

namespace beltgrip::daemon {

using estimator::PeakKind;
using estimator::StopReason;
using estimator::VariatorSample;

namespace {

// More calls than an evaluation takes; at the end there is no next sample to go on with it.
constexpr int kConcludeCallsMax = 1'000'000;

// Two periods of BeltGripClamp.
constexpr Duration kConfirmationMax = 20 * kMillisecond;
constexpr Duration kConfirmationRetry = kSecond;  // then the frame is taken for lost

constexpr Duration kStillComing = 50 * kMillisecond;

constexpr double kSlipOfAPeak = 0.007;  // since the start: less of it has passed no peak
constexpr double kBoundMargin = 0.97;   // of mu* carried without a ramp

bool in_experiment(State state) noexcept {
  return state == State::kRamping || state == State::kEvaluating || state == State::kReleasing;
}

// What the safety monitor found, as a reason to stop: motion leaves data worth evaluating.
StopReason reason_of(SafetyVerdict verdict) noexcept {
  switch (verdict) {
    case SafetyVerdict::kSlip:
    case SafetyVerdict::kSlipSpeed:
      return StopReason::kSlip;
    case SafetyVerdict::kEnergy:
      return StopReason::kSlipEnergy;
    case SafetyVerdict::kSpeed:
    case SafetyVerdict::kEngine:
      return StopReason::kEngineSpeed;
    case SafetyVerdict::kDuration:
      return StopReason::kTime;
    case SafetyVerdict::kFloor:
      return StopReason::kForceFloor;
    default:
      return StopReason::kNone;
  }
}

// Why an experiment was refused.
StopReason reason_of(std::uint32_t inhibits) noexcept {
  if ((inhibits & inhibit_bit(Inhibit::kUnreachable)) != 0) return StopReason::kForceFloor;
  if ((inhibits & inhibit_bit(Inhibit::kGrip)) != 0) return StopReason::kSlip;
  return StopReason::kTime;
}

}  // namespace

// --- frames ---------------------------------------------------------------------------------

void Pipeline::on_frame(const RxFrame& frame) noexcept {
  Parts& parts = *parts_;
  ++parts.counters.frames;
  if (frame.bus >= kBusMax) return;
  Parts::BusHealth& bus = parts.buses[frame.bus];
  if (frame.dropped_before != 0) parts.faults.raise(Fault::kFramesLost, frame.t);
  if (frame.frame.error) {
    const std::optional<BusState> state = bus_state_of(frame.frame);
    if (state) bus.controller = *state;
    if (state == BusState::kOff) bus.off_since = frame.t;
    return;
  }
  switch (parts.inputs.on_frame(frame, parts.faults)) {
    case FrameUse::kTaken:
      ++parts.counters.frames_decoded;
      // A controller that is off the bus hears nothing: it has come back. What it had heard before
      // may still be on its way.
      if (bus.controller == BusState::kOff && frame.t - bus.off_since > kStillComing) {
        bus.controller = BusState::kActive;
      }
      break;
    case FrameUse::kBad:
      ++parts.counters.frames_bad;
      break;
    case FrameUse::kForeign:
      parts.take_own_frame(frame);
      break;
  }
}

void Pipeline::Parts::take_own_frame(const RxFrame& frame) noexcept {
  if (frame.bus != 0 || frame.frame.id.extended) return;
  if (frame.own_echo) {
    if (frame.frame.id.value == config.identifiers.clamp) clamp_unconfirmed = false;
    return;
  }
  for (std::size_t i = 0; i < kOwnMessageCount; ++i) {
    if (frame.frame.id.value == own_identifier(config.identifiers, static_cast<OwnMessage>(i))) {
      faults.latch(Fault::kForeignSender);
    }
  }
}

void Pipeline::on_bus_state(BusState state, MonoTime, std::uint8_t bus) noexcept {
  Parts::BusHealth& health = parts_->buses[bus];
  // A link that comes up again begins with a fresh controller.
  if (state == BusState::kActive && health.link != BusState::kActive) {
    health.controller = BusState::kActive;
  }
  health.link = state;
}

void Pipeline::on_late(MonoTime t, bool lost) noexcept {
  parts_->faults.raise(Fault::kSampleLate, t);
  parts_->samples_lost = parts_->samples_lost || lost;
}

void Pipeline::on_send_failed(const can::CanFrame& frame, MonoTime t, std::uint8_t bus) noexcept {
  parts_->faults.raise(Fault::kSendFailed, t);
  parts_->inputs.diagnostics().on_send_failed(frame, bus, t);
  if (bus == 0 && frame.id.value == parts_->config.identifiers.clamp) parts_->clamp_refused = true;
}

// --- one sample -----------------------------------------------------------------------------

void Pipeline::Parts::raise_bus_faults(MonoTime t) noexcept {
  for (const BusHealth& bus : buses) {
    if (bus.link == BusState::kDown || bus.link == BusState::kAbsent) {
      faults.raise(Fault::kBusDown, t);
    }
    if (bus.controller == BusState::kOff) faults.raise(Fault::kBusOff, t);
    if (bus.controller == BusState::kPassive) faults.raise(Fault::kBusPassive, t);
  }
}

bool Pipeline::Parts::buses_up() const noexcept {
  return std::all_of(buses.begin(), buses.end(),
                     [](const BusHealth& bus) { return !bus.needed || bus.up(); });
}

void Pipeline::learn(const estimator::LearnedFriction& learned) noexcept {
  parts_->learned = learned;
}

void Pipeline::Parts::raise_history_faults(MonoTime t) noexcept {
  if (learned.doubtful || contradictory) faults.raise(Fault::kResultDoubtful, t);
  if (learned.unwritten) faults.raise(Fault::kHistoryUnwritten, t);
}

// mu_max at the present direction and end stop: of all experiments where they are kept, else of the
// last; 0: not known.
double Pipeline::Parts::friction_known() const noexcept {
  const estimator::FusedFriction& fused = learned.of(last.curve.direction, last.curve.end_stop);
  if (fused.known) return fused.mu_max;
  return estimate.kind == PeakKind::kValue ? estimate.mu_max : 0.0;
}

SlipShown& Pipeline::Parts::shown(estimator::Direction direction,
                                  estimator::EndStop end_stop) noexcept {
  return slip_shown[direction == estimator::Direction::kDrive ? 0 : 1]
                   [end_stop == estimator::EndStop::kOverdrive ? 0 : 1];
}

bool Pipeline::Parts::by_conditions() const noexcept {
  return config.trigger == Trigger::kCoastDown || config.trigger == Trigger::kSteady;
}

bool Pipeline::Parts::triggered() const noexcept {
  if (by_conditions()) {
    return in_experiment(state) ? ended_by() == StopReason::kNone : arming.triggered();
  }
  if (config.trigger == Trigger::kAlways) return true;
  // A signal that has gone keeps its last word: the end of an experiment must be said.
  const SignalHistory& active = inputs.history(Role::kExperimentActive);
  return !active.empty() && active.newest_value() > 0.5;
}

// What of the car ends the experiment under way. Torque, ratio and slip are what it is about: they
// are the estimator's to judge.
StopReason Pipeline::Parts::ended_by() const noexcept {
  const double speed_min_rad_s =
      ClampRequest::kSpeedMargin * config.experiment.primary_speed_min_rad_s;
  if (last.sample.omega_p_rad_s < speed_min_rad_s) return StopReason::kEngineSpeed;
  return arming.ended_by(conditions);
}

// An observed experiment is over when what it needs of the car has gone, or when the force that was
// lowered is back and holds the belt: not before, the flag tells whoever lowers it.
bool Pipeline::Parts::observed_over() const noexcept {
  const VariatorSample& sample = last.sample;
  const double torque_Nm =
      config.trigger == Trigger::kCoastDown ? -sample.torque_Nm : sample.torque_Nm;
  if (!triggered() || inputs.any_lost() || torque_Nm < 0.0) return true;
  const double restored_N = ClampRequest::kRestored * own_force_N;
  return last.curve.usable && running.clamp_force_N < restored_N &&
         measured_force_N() >= restored_N &&
         arming.at_end_stop(sample.omega_s_rad_s / sample.omega_p_rad_s);
}

double Pipeline::Parts::value_or(Role role, double otherwise, bool& fresh) const noexcept {
  if (!inputs.is_bound(role)) return otherwise;
  fresh = fresh && inputs.quality(role) == SignalQuality::kValid;
  return inputs.history(role).empty() ? otherwise : inputs.history(role).newest_value();
}

Conditions Pipeline::Parts::read_conditions() const noexcept {
  Conditions now;
  now.permitted = value_or(Role::kExperimentPermitted, 1.0, now.fresh) > 0.5;
  now.lockup_closed = value_or(Role::kLockupClosed, 1.0, now.fresh) > 0.5;
  now.brake_pressed = value_or(Role::kBrakePressed, 0.0, now.fresh) > 0.5;
  now.accelerator = value_or(Role::kAcceleratorPedal, now.accelerator, now.fresh);
  now.oil_degC = value_or(Role::kOilTemperature, now.oil_degC, now.fresh);
  return now;
}

Duration Pipeline::Parts::slowest_stale() const noexcept {
  Duration slowest = InputMonitor::kStaleMinimum;
  for (std::size_t i = 0; i < kRoleCount; ++i) {
    const auto role = static_cast<Role>(i);
    if (!inputs.is_bound(role)) continue;
    slowest = std::max(slowest, inputs.period(role).value_or(0) * 5 / 2);
  }
  return slowest;
}

// The clamp force in the transmission's own measure, which requests are made in.
double Pipeline::Parts::measured_force_N() const noexcept {
  return last.curve.clamp_force_N - (correction ? correction->force_error_N() : 0.0);
}

ClampRequest::Now Pipeline::Parts::request_now(MonoTime t) const noexcept {
  return {t,
          last.sample.omega_p_rad_s,
          last.sample.omega_s_rad_s,
          last.curve.torque_p_Nm,
          measured_force_N(),
          last.curve.mu_star};
}

// The trigger's preconditions, with the estimator's view of the sample before.
void Pipeline::Parts::arm(MonoTime t) noexcept {
  conditions = read_conditions();
  if (in_experiment(state)) return;
  Arming::Now now;
  now.t = t;
  now.usable = last.sample.usable && last.curve.usable;
  now.cooled = !commands() || request.cooled();
  now.faulted =
      commands() && (faults.has(Fault::kForeignSender) || faults.has(Fault::kFrameRefused) ||
                     faults.has(Fault::kBusPassive) || faults.has(Fault::kSampleLate) ||
                     faults.has(Fault::kBusOff) || faults.has(Fault::kBusDown) ||
                     faults.has(Fault::kSendFailed) || inputs.suspect() || unconfirmed(t));
  now.omega_p_rad_s = last.sample.omega_p_rad_s;
  now.omega_s_rad_s = last.sample.omega_s_rad_s;
  now.torque_Nm = last.curve.torque_p_Nm;
  now.clamp_force_N = measured_force_N();
  now.slip_percent = last.curve.sigma_star_percent;
  now.mu_max_known = estimate.kind == PeakKind::kValue ? estimate.mu_max : 0.0;
  now.shown = shown(last.curve.direction, last.curve.end_stop);
  now.stale = slowest_stale();
  now.conditions = conditions;
  arming.step(now);
}

// Every input comes, but for as long as makes one stale no sample could be made of them: a primary
// speed at zero, say.
bool Pipeline::Parts::starved(MonoTime t) const noexcept {
  if (state != State::kRamping) return false;
  const Duration slowest = std::max(sampler.delay().value_or(0), sample_period(config));
  return t - last_usable > std::max(InputMonitor::kStaleMinimum, slowest * 5 / 2);
}

// Nobody has confirmed what was asked: it may not be on the bus at all.
bool Pipeline::Parts::unconfirmed(MonoTime t) const noexcept {
  return clamp_unconfirmed && t - clamp_sent >= kConfirmationMax;
}

// A frame that was lost with its bus is never confirmed. Inactive frames tell whether the bus is
// back, and the receiver that the request is over.
void Pipeline::Parts::ask_again(MonoTime t) noexcept {
  if (!clamp_unconfirmed || in_experiment(state) || t - clamp_sent < kConfirmationRetry) return;
  clamp_unconfirmed = false;
  if (!faults.has(Fault::kForeignSender)) publisher.repeat_inactive();
}

void Pipeline::Parts::withdraw(StopReason reason) noexcept {
  if (withdrawn == StopReason::kNone) withdrawn = reason;
}

// One sample of a standing request: what ends it, and by how much it falls. The safety monitor has
// the last word.
void Pipeline::Parts::step_request(MonoTime t) noexcept {
  backup_stop = withdrawn = StopReason::kNone;
  if (!commands()) return;
  if (state == State::kRamping) {
    if (!conditions.fresh || inputs.suspect()) withdraw(StopReason::kInputs);
    withdraw(arming.ended_by(conditions));
    if (clamp_refused || faults.has(Fault::kForeignSender) || faults.has(Fault::kFrameRefused) ||
        unconfirmed(t)) {
      withdraw(StopReason::kBus);
    }
    if (last.sample.usable && last.curve.usable) {
      request.step(request_now(t), arming.floor_N(last.sample.omega_s_rad_s));
      backup_stop = request.backup_stop();
      if (!request.followed()) withdraw(StopReason::kPermission);
    } else {
      request.hold(t);
    }
  }
  clamp_refused = false;
  SafetySignals signals;
  signals.fresh = !inputs.any_lost() && !inputs.suspect() && !samples_lost && conditions.fresh;
  signals.omega_p_rad_s = last.sample.omega_p_rad_s;
  signals.omega_s_rad_s = last.sample.omega_s_rad_s;
  signals.torque_Nm = last.sample.torque_Nm;
  signals.primary_radius_m = signals.omega_s_rad_s > signals.omega_p_rad_s
                                 ? config.variator.primary_radius_overdrive_m
                                 : config.variator.primary_radius_low_m;
  bool engine_known = inputs.is_bound(Role::kEngineSpeed);
  const double omega_e_rad_s = value_or(Role::kEngineSpeed, 0.0, engine_known);
  signals.omega_e_rad_s = engine_known ? omega_e_rad_s : 0.0;
  const SafetyVerdict verdict =
      safety.check(t, signals, state == State::kRamping ? request.force_N() : 0.0);
  if (verdict == SafetyVerdict::kAllowed) return;
  const StopReason reason = reason_of(verdict);
  if (reason == StopReason::kNone) {
    withdraw(StopReason::kInputs);
  } else if (backup_stop == StopReason::kNone) {
    backup_stop = reason;
  }
}

Guards Pipeline::Parts::guards(MonoTime t) const noexcept {
  Guards now;
  now.inputs_usable = last.sample.usable;
  now.inputs_lost =
      inputs.any_lost() || samples_lost || starved(t) || (observes() && !conditions.fresh);
  now.bus_up = buses_up();
  now.triggered = triggered();
  now.settled = !by_conditions() || arming.settled();
  now.cleared = !commands() || arming.cleared();
  now.released = observes() ? observed_over() : !now.triggered;
  now.cooled = true;
  if (!commands()) return now;
  // While a request stands, its own stops say when it ends.
  if (state == State::kRamping) now.triggered = true;
  now.released = refused || request.released(request_now(t));
  now.stuck = !refused && request.stuck(request_now(t));
  now.cooled = request.cooled();
  now.faulted = faults.has(Fault::kForeignSender) || faults.has(Fault::kFrameRefused);
  return now;
}

void Pipeline::Parts::step(MonoTime t) noexcept {
  last.curve = estimator->step(correction ? correction->correct(last.sample) : last.sample);
  if (state == State::kRamping && last.sample.usable) ++running.samples;
  if (last.sample.usable) last_usable = t;
  // Outside an experiment the estimator only watches; what would have stopped it (a ratio that is
  // no end stop's, torque that changes its sign) starts it afresh.
  if (!in_experiment(state) && last.curve.stop != StopReason::kNone) {
    estimator->reset();
    last.curve = {};
    last.curve.t_ns = last.sample.t_ns;
  }
  last.t = t;
}

void Pipeline::Parts::stop(MonoTime t, StopReason reason) noexcept {
  running.end = t;
  running.stop_reason = reason;
  running.sigma_stop_percent = std::abs(last.curve.sigma_star_percent);
  running.direction = last.curve.direction;
  running.end_stop = last.curve.end_stop;
  running.omega_p_rad_s = last.sample.omega_p_rad_s;
  running.omega_s_rad_s = last.sample.omega_s_rad_s;
  running.torque_Nm = last.curve.torque_p_Nm;
  running.clamp_force_N = last.curve.clamp_force_N;
  const bool oil_known = inputs.quality(Role::kOilTemperature) == SignalQuality::kValid;
  running.oil_degC = oil_known ? inputs.history(Role::kOilTemperature).newest_value()
                               : std::numeric_limits<double>::quiet_NaN();
}

Outcome Pipeline::Parts::judged_outcome() const noexcept {
  return running.peak.kind == PeakKind::kValue ? Outcome::kCompleted : Outcome::kInconclusive;
}

void Pipeline::Parts::publish_result(Outcome outcome) noexcept {
  running.outcome = outcome;
  running.sensor_std =
      running.peak.mu_max * estimator::relative_sensor_deviation(
                                config.variator, config.sensors, std::abs(running.torque_Nm),
                                running.clamp_force_N, running.omega_s_rad_s);
  result = running;
  last.new_result = true;
  if (outcome == Outcome::kAborted) return;  // says nothing of mu_max: the last result stands
  contradictory = running.peak.contradictory || running.peak.impossible;
  // Neither does a bound below what is known: coast-downs without a ramp come all the time.
  const bool weaker = running.peak.kind != PeakKind::kValue && estimate.kind == PeakKind::kValue &&
                      running.peak.mu_max <= estimate.mu_max;
  if (by_conditions() && weaker) return;
  estimate.kind = running.peak.kind;
  estimate.mu_max = running.peak.mu_max;
  estimate.mu_max_std = running.peak.mu_max_std;
  ++estimate.experiment_count;
  estimate_changed = true;
  if (commands() && running.peak.kind == PeakKind::kValue) {
    shown(running.direction, running.end_stop) = {slip_own_percent,
                                                  running.peak.sigma_peak_percent};
  }
}

void Pipeline::Parts::apply(const Transition& transition, MonoTime t) noexcept {
  state = transition.next;
  switch (transition.action) {
    case Action::kNone:
      break;
    case Action::kStart:
      if (commands()) {
        request.begin(request_now(t), arming.ramp().rate_N_per_s,
                      arming.floor_N(last.sample.omega_s_rad_s));
      }
      own_force_N = measured_force_N();
      estimator->reset();
      running = {};
      running.start = t;
      slip_own_percent = arming.slip_percent();
      refused = false;
      break;
    case Action::kRefuse:
      running = {};
      running.start = t;
      refused = true;
      request.end(t);
      stop(t, reason_of(arming.inhibits()));
      break;
    case Action::kStop:
      macro_slip_stop = true;
      running.stopped = true;
      stop(t, backup_stop != StopReason::kNone ? backup_stop : last.curve.stop);
      break;
    case Action::kEnd:
      stop(t, observes() ? ended_by() : StopReason::kNone);
      break;
    case Action::kAbort:
      macro_slip_stop = true;
      running.stopped = true;
      stop(t, transition.abort_reason);
      publish_result(Outcome::kAborted);
      break;
    case Action::kPublish:
      running.peak = estimator->peak();
      if (refused) {
        bound_only();
      } else if (commands() && running.peak.kind == PeakKind::kValue &&
                 request.slip_max() < kSlipOfAPeak) {
        running.peak.kind = PeakKind::kLowerBound;
        running.peak.mu_max = running.peak.ci95_low;
      }
      publish_result(judged_outcome());
      break;
    case Action::kOver:
      macro_slip_stop = false;
      arming.reset();
      estimator->reset();
      break;
  }
  if (state != State::kRamping && request.standing()) request.end(t);
}

// Without a ramp the data hold no peak, only what the belt carried.
void Pipeline::Parts::bound_only() noexcept {
  const double carried = kBoundMargin * std::abs(last.curve.mu_star);
  running.peak = {};
  if (!(carried > 0.0)) return;
  running.peak.kind = PeakKind::kLowerBound;
  running.peak.mu_max = carried;
}

const SampleReport& Pipeline::on_sample(MonoTime t, Outbox& outbox) noexcept {
  Parts& parts = *parts_;
  ++parts.counters.samples;
  parts.last.new_result = false;
  parts.estimate_changed = false;
  parts.faults.expire(t);
  parts.inputs.update(t, parts.faults);
  parts.raise_bus_faults(t);
  parts.raise_history_faults(t);
  parts.last.sample = parts.sampler.sample(t, !in_experiment(parts.state));

  parts.ask_again(t);

  // An experiment begins before the sample is used and stops after it.
  if (parts.by_conditions()) parts.arm(t);
  bool speed_known = true;
  const double speed_m_s = parts.value_or(Role::kVehicleSpeed, 0.0, speed_known);
  parts.request.travel(t, speed_known ? speed_m_s : 0.0);
  Guards guards = parts.guards(t);
  if (!in_experiment(parts.state)) parts.apply(next_state(parts.state, guards), t);
  parts.step(t);
  parts.step_request(t);
  guards = parts.guards(t);
  guards.stop_decided =
      parts.last.curve.stop != StopReason::kNone || parts.backup_stop != StopReason::kNone;
  guards.withdrawn = parts.withdrawn != StopReason::kNone;
  guards.withdrawn_reason = parts.withdrawn;
  if (parts.state == State::kRamping || parts.state == State::kReleasing) {
    parts.apply(next_state(parts.state, guards), t);
  }
  if (parts.state == State::kEvaluating) {
    guards.concluded = parts.estimator->conclude();
    parts.apply(next_state(parts.state, guards), t);
  }
  parts.samples_lost = false;

  Outbox wanted;
  parts.report(t);
  parts.publisher.collect(t, parts.publication(), wanted);
  parts.inputs.diagnostics().step(t, {parts.buses[0].up(), parts.buses[1].up()}, wanted);
  parts.pass_gate(wanted, outbox);
  return parts.last;
}

const SampleReport& Pipeline::on_end(MonoTime t, StopReason reason, Outbox& outbox) noexcept {
  Parts& parts = *parts_;
  parts.last.new_result = false;
  parts.estimate_changed = false;
  const bool running = parts.state == State::kRamping;
  if (running) parts.stop(parts.last.t, reason);
  if (running || parts.state == State::kEvaluating) {
    bool concluded = false;
    for (int call = 0; call < kConcludeCallsMax && !concluded; ++call) {
      concluded = parts.estimator->conclude();
    }
    if (concluded) parts.running.peak = parts.estimator->peak();
    parts.publish_result(parts.judged_outcome());
  }
  parts.state = State::kInhibited;
  if (parts.request.standing()) parts.request.end(t);
  Outbox wanted;
  parts.report(t);
  parts.publisher.collect_all(t, parts.publication(), wanted);
  parts.pass_gate(wanted, outbox);
  parts.last.sample.usable = false;
  return parts.last;
}

// --- what leaves ----------------------------------------------------------------------------

void Pipeline::Parts::report(MonoTime t) noexcept {
  last.t = t;
  last.state = state;
  last.in_experiment = in_experiment(state);
  last.macro_slip_stop = macro_slip_stop;
  last.stop_reason = macro_slip_stop ? running.stop_reason : StopReason::kNone;
  last.result = result;
  last.faults = faults.bits();
  last.inhibits = by_conditions() ? arming.inhibits() : 0U;
  last.request_force_N = state == State::kRamping ? request.force_N() : 0.0;
  last.ramp_N_per_s = state == State::kRamping && commands() ? request.rate_N_per_s() : 0.0;
}

Publication Pipeline::Parts::publication() const noexcept {
  Publication now;
  now.command = commands();
  now.clamp = {last.request_force_N > 0.0, last.request_force_N};
  now.in_experiment = last.in_experiment;
  now.new_result = estimate_changed;
  now.estimate = estimate;
  const estimator::CurveEstimate& curve = last.curve;
  const double friction = friction_known();
  if (friction > 0.0 && curve.usable && last.sample.usable) {
    now.estimate.min_clamp_force_N =
        estimator::min_clamp_force_N(config.variator, curve.end_stop, curve.torque_p_Nm, friction);
  }
  now.slip.macro_slip_stop = macro_slip_stop;
  now.slip.phase = curve.phase;
  now.slip.available = curve.usable && last.sample.usable;
  now.slip.mu_star = curve.mu_star;
  now.slip.sigma_star_percent = curve.sigma_star_percent;
  now.slip.friction_slope = curve.friction_slope;
  now.status = {state, result.outcome, result.stop_reason, last.faults};
  return now;
}

void Pipeline::Parts::pass_gate(const Outbox& wanted, Outbox& outbox) noexcept {
  for (std::size_t i = 0; i < wanted.size; ++i) {
    if (!gate.permits(wanted.frames[i], wanted.bus[i], last.t)) {
      faults.latch(Fault::kFrameRefused);
      continue;
    }
    outbox.push(wanted.frames[i], wanted.bus[i]);
    if (wanted.bus[i] == 0 && wanted.frames[i].id.value == config.identifiers.clamp &&
        !clamp_unconfirmed) {
      clamp_unconfirmed = true;
      clamp_sent = last.t;
    }
  }
  counters.frames_refused = refused_before + gate.refused();
  counters.diagnostics = inputs.diagnostics().counters();
}

// --- another configuration ------------------------------------------------------------------

void Pipeline::Parts::go_on_from(const Parts& before, bool keeps_results) noexcept {
  publisher.go_on_from(before.publisher);
  faults = before.faults;
  counters = before.counters;
  refused_before = before.counters.frames_refused;
  // A controller that kept a request is not to be asked again before a restart.
  if (before.state == State::kFault) state = State::kFault;
  for (std::size_t i = 0; i < kBusMax; ++i) {
    const bool needed = buses[i].needed;
    buses[i] = before.buses[i];
    buses[i].needed = needed;
  }
  clamp_unconfirmed = before.clamp_unconfirmed;
  clamp_sent = before.clamp_sent;
  last.t = before.last.t;
  // What was found is no less found under a configuration that it does not hold for.
  estimate.experiment_count = before.estimate.experiment_count;
  if (!keeps_results) return;
  estimate = before.estimate;
  result = before.result;
  learned = before.learned;
  slip_shown = before.slip_shown;
}

void Pipeline::give_way_to(Pipeline& next, bool keeps_results) noexcept {
  next.parts_->go_on_from(*parts_, keeps_results);
  parts_.swap(next.parts_);
}

const PipelineCounters& Pipeline::counters() const noexcept { return parts_->counters; }

std::size_t Pipeline::bus_count() const noexcept { return parts_->config.further_bus ? 2 : 1; }

SignalObservation Pipeline::signal(Role role) const noexcept {
  const SignalHistory& history = parts_->inputs.history(role);
  SignalObservation seen{.quality = parts_->inputs.quality(role), .seen = !history.empty()};
  if (seen.seen) {
    seen.value = history.newest_value();
    seen.t = history.newest();
  }
  return seen;
}

}  // namespace beltgrip::daemon
