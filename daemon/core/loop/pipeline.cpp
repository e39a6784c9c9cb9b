#include "daemon/core/loop/pipeline.h"

#include "daemon/core/loop/pipeline_parts.h"
#include "estimator/physics/clamp_force.h"

namespace beltgrip::daemon {

using estimator::StopReason;

namespace {
// More calls than an evaluation takes; at the end there is no next sample to go on with it.
constexpr int kConcludeCallsMax = 1'000'000;
}  // namespace

// --- frames ---------------------------------------------------------------------------------

void Pipeline::on_frame(const RxFrame& frame) noexcept {
  Parts& parts = *parts_;
  ++parts.counters.frames;
  if (frame.bus >= kBusMax) return;
  if (frame.dropped_before != 0) parts.faults.raise(Fault::kFramesLost, frame.t);
  if (frame.frame.error) {
    parts.input.on_error_frame(frame);
    return;
  }
  switch (parts.input.on_frame(frame, parts.faults)) {
    case FrameUse::kTaken:
      ++parts.counters.frames_decoded;
      break;
    case FrameUse::kBad:
      ++parts.counters.frames_bad;
      break;
    case FrameUse::kForeign:
      parts.output.on_frame(frame, parts.faults);
      break;
  }
}

void Pipeline::on_bus_state(BusState state, MonoTime, std::uint8_t bus) noexcept {
  parts_->input.on_link(bus, state);
}

void Pipeline::on_late(MonoTime t, bool lost) noexcept {
  parts_->faults.raise(Fault::kSampleLate, t);
  if (lost) parts_->input.on_samples_lost();
}

void Pipeline::on_silence(std::int64_t samples) noexcept {
  parts_->counters.samples += static_cast<std::uint64_t>(samples);
}

void Pipeline::on_send_failed(const can::CanFrame& frame, MonoTime t, std::uint8_t bus) noexcept {
  parts_->faults.raise(Fault::kSendFailed, t);
  parts_->input.on_send_failed(frame, bus, t);
  if (parts_->output.is_clamp(frame, bus)) parts_->experiment.on_clamp_refused();
}

// --- one sample -----------------------------------------------------------------------------

ExperimentStage::Now Pipeline::Parts::now(MonoTime at) noexcept {
  return {at, input, estimate, faults, output.unconfirmed(at), output.inactive_sent()};
}

// What a change of the experiment's state asks of the stages beside it.
void Pipeline::Parts::take_action(Action action) noexcept {
  if (action == Action::kStart || action == Action::kOver) estimate.reset();
  if (action == Action::kStart || action == Action::kRefuse) evaluation.begin();
  if (action == Action::kStop && experiment.stopped_at_the_top()) estimate.ends_at_the_top();
}

// From this sample's signals alone; 0: not known.
double Pipeline::Parts::acting_force_N() const noexcept {
  const estimator::VariatorSample& sample = input.sample();
  if (!sample.usable) return 0.0;
  return estimator::secondary_clamp_force_N(config.variator, sample.secondary_pressure_Pa,
                                            sample.omega_s_rad_s);
}

// Its verdict holds for what leaves, whatever the experiment makes of it.
void Pipeline::Parts::judge_safety(const ExperimentStage::Now& now) noexcept {
  permitted = false;
  if (!experiment.asks()) return;
  const InputMonitor& channels = input.channels();
  const estimator::VariatorSample& sample = input.sample();
  SafetySignals signals;
  signals.fresh = inputs_sound && experiment.conditions().fresh;
  signals.omega_p_rad_s = sample.omega_p_rad_s;
  signals.omega_s_rad_s = sample.omega_s_rad_s;
  signals.torque_Nm = sample.torque_Nm;
  signals.primary_radius_m = signals.omega_s_rad_s > signals.omega_p_rad_s
                                 ? config.variator.primary_radius_overdrive_m
                                 : config.variator.primary_radius_low_m;
  signals.omega_e_rad_s = channels.value_if_known(Role::kEngineSpeed);
  signals.clamp_force_N = acting_force_N();
  const SafetyVerdict verdict = safety.check(now.t, signals, experiment.request_force_N());
  permitted = verdict == SafetyVerdict::kAllowed;
  if (!permitted) {
    experiment.take(verdict, safety.figure(), safety.limit(), now);
  }
}

bool Pipeline::Parts::evaluate() noexcept {
  return evaluation.step(estimate, experiment.ended(), input.sample());
}

void Pipeline::Parts::publish_result(const estimator::PeakEstimate& peak) noexcept {
  const KnownFriction::Taken taken = known.take(
      peak, experiment.ended(), evaluation.friction_as_read(), experiment.by_conditions());
  estimate_changed = taken.changed;
  experiment.conclude(peak, evaluation.sensor_std(), taken.slipped);
}

const SampleReport& Pipeline::on_sample(MonoTime t, Outbox& outbox) noexcept {
  Parts& parts = *parts_;
  ++parts.counters.samples;
  parts.estimate_changed = false;
  parts.faults.expire(t);

  // What is known before this sample is used: that of the sample before.
  const estimator::CurveEstimate& curve = parts.estimate.curve();
  const estimator::VariatorSample& sample = parts.input.step(
      t, parts.experiment.watch(curve.torque_p_Nm), !parts.experiment.runs(), parts.faults);
  parts.known.raise_faults(t, curve, parts.faults);
  if (!parts.experiment.runs()) parts.output.ask_again(t, parts.faults);

  // An experiment begins before the sample is used and stops after it.
  const ExperimentStage::Now now = parts.now(t);
  if (parts.experiment.arm(now, parts.known, parts.evaluation.friction_as_read())) {
    parts.output.announce();
  }
  parts.take_action(parts.experiment.begin(now));
  parts.conditions = parts.input.learned_conditions();
  parts.estimate.step(sample, parts.conditions, !parts.experiment.runs());
  parts.experiment.count(now);
  if (const RoleSet still = parts.experiment.step_request(now); still.any()) {
    for (std::size_t i = 0; i < kRoleCount; ++i) {
      if (still[i]) parts.input.stands_still(static_cast<Role>(i));
    }
    parts.faults.raise(Fault::kInputFrozen, t);
  }
  parts.inputs_sound = !parts.input.any_lost() && !parts.input.channels().suspect();
  parts.judge_safety(now);
  parts.take_action(parts.experiment.end(now));
  if (parts.experiment.state() == State::kEvaluating && parts.evaluate()) {
    parts.experiment.release(now);
    parts.publish_result(parts.evaluation.peak());
  }

  const Publication publication = parts.publication();
  parts.input.poll(t, parts.output.collect(t, publication));
  parts.output.pass(t, parts.acting_force_N(), outbox, parts.faults);
  parts.count_frames();
  parts.t = t;
  return parts.make_report(publication, sample.usable);
}

const SampleReport& Pipeline::on_end(MonoTime t, StopReason reason, Outbox& outbox) noexcept {
  Parts& parts = *parts_;
  parts.estimate_changed = false;
  if (parts.experiment.cut_short(parts.t, reason, parts.now(t))) {
    bool concluded = false;
    for (int call = 0; call < kConcludeCallsMax && !concluded; ++call) concluded = parts.evaluate();
    parts.publish_result(concluded ? parts.evaluation.peak() : estimator::PeakEstimate{});
  }
  parts.experiment.go_idle(t);
  const Publication publication = parts.publication();
  parts.output.collect_all(t, publication);
  parts.output.pass(t, parts.acting_force_N(), outbox, parts.faults);
  parts.count_frames();
  parts.t = t;
  return parts.make_report(publication, false);
}

// --- what leaves ----------------------------------------------------------------------------

Publication Pipeline::Parts::publication() const noexcept {
  const estimator::CurveEstimate& curve = estimate.curve();
  const KnownFriction::Newest& newest = known.newest();
  const ExperimentResult& result = experiment.result();
  const double request_force_N = permitted_force_N();
  Publication now;
  now.command = experiment.asks();
  now.clamp = {request_force_N > 0.0, request_force_N};
  now.in_experiment = experiment.runs();
  now.new_result = estimate_changed;
  now.estimate = {newest.kind, newest.mu_max, newest.mu_max_std, newest.experiment_count, {}};
  now.slip.macro_slip_stop = experiment.macro_slip_stop();
  now.slip.phase = curve.phase;
  now.slip.available = curve.usable && input.sample().usable;
  if (now.slip.available) now.estimate.min_clamp_force_N = known.min_clamp_force_N(curve);
  now.slip.mu_star = curve.mu_star;
  now.slip.sigma_star_percent = curve.sigma_star_percent;
  now.slip.friction_slope = curve.friction_slope;
  now.status = {experiment.state(), result.outcome, result.stop_reason, faults.bits()};
  return now;
}

void Pipeline::Parts::count_frames() noexcept {
  counters.frames_refused = output.refused();
  counters.diagnostics = input.channels().diagnostics().counters();
}

const SampleReport& Pipeline::Parts::make_report(const Publication& published,
                                                 bool usable) noexcept {
  const bool stopped = experiment.macro_slip_stop();
  report.t = t;
  report.state = experiment.state();
  report.in_experiment = experiment.runs();
  report.macro_slip_stop = stopped;
  report.stop_reason = stopped ? experiment.running().stop_reason : StopReason::kNone;
  report.stop_cause = stopped ? experiment.running().cause : StopCause{};
  report.sample = input.sample();
  report.sample.usable = usable;
  report.curve = estimate.curve();
  report.new_result = experiment.new_result();
  report.result = experiment.result();
  report.faults = published.status.faults;
  report.foreign_identifier = output.foreign_identifier();
  report.frozen = input.channels().frozen();
  report.inhibits = experiment.inhibits();
  report.obstacle = experiment.obstacle();
  report.beyond = estimate.beyond();
  report.torque_is_the_belts = inputs_sound && input.lockup_closed();
  report.oil_degC = conditions.oil_temperature_degC;
  report.request_force_N = permitted_force_N();
  report.ramp_N_per_s = experiment.ramp_N_per_s();
  return report;
}

const SampleReport& Pipeline::report() const noexcept { return parts_->report; }

// --- between two samples --------------------------------------------------------------------

Pulse Pipeline::pulse() const noexcept {
  const Parts& parts = *parts_;
  const ExperimentStage& experiment = parts.experiment;
  const State state = experiment.state();
  return {.state = state,
          .in_experiment = experiment.runs(),
          .macro_slip_stop = experiment.macro_slip_stop(),
          .faults = parts.faults.bits(),
          .inhibits = experiment.inhibits(),
          .busy = state == State::kRamping || state == State::kEvaluating ||
                  experiment.new_result() || parts.input.sample().usable ||
                  parts.estimate.curve().usable};
}

const ExperimentResult* Pipeline::new_result() const noexcept {
  const ExperimentStage& experiment = parts_->experiment;
  return experiment.new_result() ? &experiment.result() : nullptr;
}

void Pipeline::learn(const estimator::LearnedFriction& learned) noexcept {
  parts_->known.learn(learned);
}

void Pipeline::Parts::go_on_from(const Parts& before, bool keeps_results) noexcept {
  input.go_on_from(before.input);
  known.go_on_from(before.known, keeps_results);
  if (keeps_results) evaluation.go_on_from(before.evaluation);
  experiment.go_on_from(before.experiment, keeps_results);
  output.go_on_from(before.output);
  faults = before.faults;
  counters = before.counters;
  t = before.t;
}

void Pipeline::give_way_to(Pipeline& next, bool keeps_results) noexcept {
  next.parts_->go_on_from(*parts_, keeps_results);
  parts_.swap(next.parts_);
}

const PipelineCounters& Pipeline::counters() const noexcept { return parts_->counters; }

std::size_t Pipeline::bus_count() const noexcept { return parts_->config.further_bus ? 2 : 1; }

FramesCame Pipeline::frames_came(Role role) const noexcept {
  return parts_->input.channels().frames_came(role);
}

SignalObservation Pipeline::signal(Role role) const noexcept {
  const InputMonitor& channels = parts_->input.channels();
  const SignalHistory& history = channels.history(role);
  SignalObservation seen{.status = channels.status(role), .seen = !history.empty()};
  if (seen.seen) {
    seen.value = history.newest_value();
    seen.t = history.newest();
  }
  return seen;
}

}  // namespace beltgrip::daemon
