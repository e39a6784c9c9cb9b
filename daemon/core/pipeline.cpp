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

bool in_experiment(State state) noexcept {
  return state == State::kRamping || state == State::kEvaluating || state == State::kReleasing;
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
  if (frame.own_echo || frame.frame.id.extended) return;
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

void Pipeline::on_send_failed(MonoTime t) noexcept { parts_->faults.raise(Fault::kSendFailed, t); }

// --- one sample -----------------------------------------------------------------------------

void Pipeline::Parts::raise_bus_faults(MonoTime t) noexcept {
  if (link == BusState::kDown || link == BusState::kAbsent) faults.raise(Fault::kBusDown, t);
  if (controller == BusState::kOff) faults.raise(Fault::kBusOff, t);
  if (controller == BusState::kPassive) faults.raise(Fault::kBusPassive, t);
}

bool Pipeline::Parts::triggered() const noexcept {
  if (config.trigger == Trigger::kAlways) return true;
  // A signal that has gone keeps its last word: the end of an experiment must be said.
  const SignalHistory& active = inputs.history(Role::kExperimentActive);
  return !active.empty() && active.newest_value() > 0.5;
}

Guards Pipeline::Parts::guards(MonoTime) const noexcept {
  Guards now;
  now.inputs_usable = last.sample.usable;
  now.inputs_lost = inputs.any_lost() || samples_lost;
  now.bus_up =
      (link == BusState::kActive || link == BusState::kWarning || link == BusState::kPassive) &&
      controller != BusState::kOff;
  now.triggered = triggered();
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
      estimator->reset();
      running = {};
      running.start = t;
      break;
    case Action::kStop:
      macro_slip_stop = true;
      running.stopped = true;
      stop(t, last.curve.stop);
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
      publish_result(judged_outcome());
      break;
    case Action::kOver:
      macro_slip_stop = false;
      estimator->reset();
      break;
  }
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
  Guards guards = parts.guards(t);
  if (!in_experiment(parts.state)) parts.apply(next_state(parts.state, guards), t);
  parts.step(t);
  guards.stop_decided = parts.last.curve.stop != StopReason::kNone;
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
}

Publication Pipeline::Parts::publication() const noexcept {
  Publication now;
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
    if (gate.permits(wanted.frames[i])) {
      outbox.push(wanted.frames[i]);
    } else {
      faults.latch(Fault::kFrameRefused);
    }
  }
  counters.frames_refused = gate.refused();
}

const PipelineCounters& Pipeline::counters() const noexcept { return parts_->counters; }

}  // namespace beltgrip::daemon
