#include "daemon/core/pipeline.h"

#include <cmath>

#include "daemon/core/bus_error.h"
#include "daemon/core/pipeline_parts.h"

namespace beltgrip::daemon {

using estimator::PeakKind;
using estimator::StopReason;

namespace {

// More calls than an evaluation takes; at the end there is no next sample to go on with it.
constexpr int kConcludeCallsMax = 1'000'000;

// Two periods of BeltGripClamp and the jitter of one sample.
constexpr Duration kConfirmationMax = 25 * kMillisecond;

constexpr double kPedalMoved = 0.05;   // while a request stands: the driver wants something
constexpr double kBoundMargin = 0.97;  // of mu* carried without a ramp

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
      return StopReason::kEngineSpeed;
    case SafetyVerdict::kDuration:
      return StopReason::kTime;
    case SafetyVerdict::kFloor:
      return StopReason::kForceFloor;
    default:
      return StopReason::kNone;
  }
}

}  // namespace

// --- frames ---------------------------------------------------------------------------------

void Pipeline::on_frame(const RxFrame& frame) noexcept {
  Parts& parts = *parts_;
  ++parts.counters.frames;
  if (frame.dropped_before != 0) parts.faults.raise(Fault::kFramesLost, frame.t);
  if (frame.frame.error) {
    const std::optional<BusState> state = bus_state_of(frame.frame);
    if (state) parts.controller = *state;
    return;
  }
  switch (parts.inputs.on_frame(frame, parts.faults)) {
    case FrameUse::kTaken:
      ++parts.counters.frames_decoded;
      // A controller that is off the bus hears nothing: it has come back.
      if (parts.controller == BusState::kOff) parts.controller = BusState::kActive;
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
  if (frame.frame.id.extended) return;
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

void Pipeline::on_bus_state(BusState state, MonoTime) noexcept {
  // A link that comes up again begins with a fresh controller.
  if (state == BusState::kActive && parts_->link != BusState::kActive) {
    parts_->controller = BusState::kActive;
  }
  parts_->link = state;
}

void Pipeline::on_late(MonoTime t, bool lost) noexcept {
  parts_->faults.raise(Fault::kSampleLate, t);
  parts_->samples_lost = parts_->samples_lost || lost;
}

void Pipeline::on_send_failed(const can::CanFrame& frame, MonoTime t) noexcept {
  parts_->faults.raise(Fault::kSendFailed, t);
  if (frame.id.value == parts_->config.identifiers.clamp) parts_->clamp_refused = true;
}

// --- one sample -----------------------------------------------------------------------------

void Pipeline::Parts::raise_bus_faults(MonoTime t) noexcept {
  if (link == BusState::kDown || link == BusState::kAbsent) faults.raise(Fault::kBusDown, t);
  if (controller == BusState::kOff) faults.raise(Fault::kBusOff, t);
  if (controller == BusState::kPassive) faults.raise(Fault::kBusPassive, t);
}

bool Pipeline::Parts::by_conditions() const noexcept {
  return config.trigger == Trigger::kCoastDown || config.trigger == Trigger::kSteady;
}

bool Pipeline::Parts::triggered() const noexcept {
  if (by_conditions()) return arming.triggered();
  if (config.trigger == Trigger::kAlways) return true;
  // A signal that has gone keeps its last word: the end of an experiment must be said.
  const SignalHistory& active = inputs.history(Role::kExperimentActive);
  return !active.empty() && active.newest_value() > 0.5;
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

ClampRequest::Now Pipeline::Parts::request_now(MonoTime t) const noexcept {
  return {t,
          last.sample.omega_p_rad_s,
          last.sample.omega_s_rad_s,
          last.curve.torque_p_Nm,
          last.curve.clamp_force_N,
          last.curve.mu_star};
}

// The trigger's preconditions, with the estimator's view of the sample before.
void Pipeline::Parts::arm(MonoTime t) noexcept {
  conditions = read_conditions();
  if (commands() && in_experiment(state)) return;
  Arming::Now now;
  now.t = t;
  now.usable = last.sample.usable && last.curve.usable;
  now.cooled = !commands() || request.cooled();
  now.faulted =
      commands() && (faults.has(Fault::kForeignSender) || faults.has(Fault::kFrameRefused) ||
                     faults.has(Fault::kBusPassive) || faults.has(Fault::kSampleLate));
  now.omega_p_rad_s = last.sample.omega_p_rad_s;
  now.omega_s_rad_s = last.sample.omega_s_rad_s;
  now.torque_Nm = last.curve.torque_p_Nm;
  now.clamp_force_N = last.curve.clamp_force_N;
  now.mu_max_known = estimate.kind == PeakKind::kValue ? estimate.mu_max : 0.0;
  now.stale = slowest_stale();
  now.conditions = conditions;
  arming.step(now);
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
    if (!conditions.fresh) withdraw(StopReason::kInputs);
    if (!conditions.permitted) withdraw(StopReason::kPermission);
    const bool coast = config.trigger == Trigger::kCoastDown;
    if (conditions.brake_pressed || (coast && conditions.accelerator > kPedalMoved)) {
      withdraw(StopReason::kDriver);
    }
    if (!conditions.lockup_closed) withdraw(StopReason::kTorque);
    if (conditions.oil_degC < config.experiment.oil_temperature_min_degC - 1.0) {
      withdraw(StopReason::kPermission);
    }
    if (clamp_refused || faults.has(Fault::kForeignSender) || faults.has(Fault::kFrameRefused) ||
        (clamp_unconfirmed && t - clamp_sent > kConfirmationMax)) {
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
  signals.fresh = !inputs.any_lost() && !samples_lost && conditions.fresh;
  signals.omega_p_rad_s = last.sample.omega_p_rad_s;
  signals.omega_s_rad_s = last.sample.omega_s_rad_s;
  signals.torque_Nm = last.sample.torque_Nm;
  signals.primary_radius_m = signals.omega_s_rad_s > signals.omega_p_rad_s
                                 ? config.variator.primary_radius_overdrive_m
                                 : config.variator.primary_radius_low_m;
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
  now.inputs_lost = inputs.any_lost() || samples_lost;
  now.bus_up =
      (link == BusState::kActive || link == BusState::kWarning || link == BusState::kPassive) &&
      controller != BusState::kOff;
  now.triggered = triggered();
  now.settled = !by_conditions() || arming.settled();
  now.cleared = !commands() || arming.cleared();
  now.released = !now.triggered;
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
  last.curve = estimator->step(last.sample);
  if (state == State::kRamping && last.sample.usable) ++running.samples;
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
}

Outcome Pipeline::Parts::judged_outcome() const noexcept {
  return running.peak.kind == PeakKind::kValue ? Outcome::kCompleted : Outcome::kInconclusive;
}

void Pipeline::Parts::publish_result(Outcome outcome) noexcept {
  running.outcome = outcome;
  result = running;
  last.new_result = true;
  if (outcome == Outcome::kAborted) return;  // says nothing of mu_max: the last result stands
  // Neither does a bound below what is known: coast-downs without a ramp come all the time.
  const bool weaker = running.peak.kind != PeakKind::kValue && estimate.kind == PeakKind::kValue &&
                      running.peak.mu_max <= estimate.mu_max;
  if (by_conditions() && weaker) return;
  estimate.kind = running.peak.kind;
  estimate.mu_max = running.peak.mu_max;
  estimate.mu_max_std = running.peak.mu_max_std;
  ++estimate.experiment_count;
  estimate_changed = true;
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
      estimator->reset();
      running = {};
      running.start = t;
      refused = false;
      break;
    case Action::kRefuse:
      running = {};
      running.start = t;
      refused = true;
      request.end(t);
      stop(t, (arming.inhibits() & inhibit_bit(Inhibit::kUnreachable)) != 0
                  ? StopReason::kForceFloor
                  : StopReason::kTime);
      break;
    case Action::kStop:
      macro_slip_stop = true;
      running.stopped = true;
      stop(t, backup_stop != StopReason::kNone ? backup_stop : last.curve.stop);
      break;
    case Action::kEnd:
      stop(t, StopReason::kNone);
      break;
    case Action::kAbort:
      macro_slip_stop = true;
      running.stopped = true;
      stop(t, transition.abort_reason);
      publish_result(Outcome::kAborted);
      break;
    case Action::kPublish:
      running.peak = estimator->peak();
      if (refused) bound_only();
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
  parts.last.sample = parts.sampler.sample(t, !in_experiment(parts.state));

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
  if (estimate.kind == PeakKind::kValue && curve.usable && last.sample.usable) {
    const estimator::VariatorParameters& variator = config.variator;
    const double radius_m = curve.end_stop == estimator::EndStop::kOverdrive
                                ? variator.primary_radius_overdrive_m
                                : variator.primary_radius_low_m;
    now.estimate.min_clamp_force_N = variator.safety_factor * std::abs(curve.torque_p_Nm) *
                                     std::cos(variator.half_wedge_angle_rad) /
                                     (2.0 * radius_m * estimate.mu_max);
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
    if (!gate.permits(wanted.frames[i])) {
      faults.latch(Fault::kFrameRefused);
      continue;
    }
    outbox.push(wanted.frames[i]);
    if (wanted.frames[i].id.value == config.identifiers.clamp && !clamp_unconfirmed) {
      clamp_unconfirmed = true;
      clamp_sent = last.t;
    }
  }
  counters.frames_refused = gate.refused();
}

const PipelineCounters& Pipeline::counters() const noexcept { return parts_->counters; }

}  // namespace beltgrip::daemon
