// What a Pipeline is made of; seen by pipeline.cpp and pipeline_setup.cpp only.
#pragma once

#include <cmath>
#include <memory>
#include <optional>

#include "daemon/core/arming.h"
#include "daemon/core/clamp_request.h"
#include "daemon/core/input_monitor.h"
#include "daemon/core/pipeline.h"
#include "daemon/core/publisher.h"
#include "daemon/core/safety_monitor.h"
#include "daemon/core/sampler.h"
#include "daemon/core/tx_gate.h"
#include "estimator/input_correction.h"

namespace beltgrip::daemon {

inline Duration sample_period(const Config& config) {
  return std::llround(static_cast<double>(kSecond) / config.estimator.sample_rate_hz);
}

struct Pipeline::Parts {
  explicit Parts(const Config& config);

  void go_on_from(const Parts& before, bool keeps_results) noexcept;
  void take_own_frame(const RxFrame& frame) noexcept;
  bool buses_up() const noexcept;  // those that are needed
  void raise_bus_faults(MonoTime t) noexcept;
  bool by_conditions() const noexcept;  // trigger "coast_down" or "steady"
  bool commands() const noexcept { return config.control == Control::kCommand; }
  // An experiment is what others do to the belt while the trigger's conditions hold.
  bool observes() const noexcept { return by_conditions() && !commands(); }
  bool triggered() const noexcept;
  estimator::StopReason ended_by() const noexcept;
  bool observed_over() const noexcept;
  double value_or(Role role, double otherwise, bool& fresh) const noexcept;
  Conditions read_conditions() const noexcept;
  Duration slowest_stale() const noexcept;
  double measured_force_N() const noexcept;
  ClampRequest::Now request_now(MonoTime t) const noexcept;
  void arm(MonoTime t) noexcept;
  void step_request(MonoTime t) noexcept;
  bool unconfirmed(MonoTime t) const noexcept;
  bool starved(MonoTime t) const noexcept;
  void ask_again(MonoTime t) noexcept;
  void withdraw(estimator::StopReason reason) noexcept;
  Guards guards(MonoTime t) const noexcept;
  void apply(const Transition& transition, MonoTime t) noexcept;
  void step(MonoTime t) noexcept;
  void stop(MonoTime t, estimator::StopReason reason) noexcept;
  void bound_only() noexcept;
  void publish_result(Outcome outcome) noexcept;
  Outcome judged_outcome() const noexcept;
  void raise_history_faults(MonoTime t) noexcept;
  double friction_known() const noexcept;
  SlipShown& shown(estimator::Direction direction, estimator::EndStop end_stop) noexcept;
  void report(MonoTime t) noexcept;
  Publication publication() const noexcept;
  void pass_gate(const Outbox& wanted, Outbox& outbox) noexcept;

  Config config;
  InputMonitor inputs;
  Sampler sampler;
  std::optional<estimator::InputCorrection> correction;  // where the configuration names a model
  std::unique_ptr<estimator::SlipCurveEstimator> estimator;
  Publisher publisher;
  TxGate gate;
  FaultSet faults;
  PipelineCounters counters;
  std::uint64_t refused_before = 0;  // under the configurations before this one
  SampleReport last;                 // as reported
  Arming arming;
  ClampRequest request;
  SafetyMonitor safety;
  Conditions conditions;

  State state = State::kInhibited;
  bool macro_slip_stop = false;
  bool samples_lost = false;  // since the last sample
  MonoTime last_usable = 0;   // sample
  bool refused = false;       // the experiment under way never began
  estimator::StopReason backup_stop = estimator::StopReason::kNone;  // at this sample
  estimator::StopReason withdrawn = estimator::StopReason::kNone;    // at this sample
  bool clamp_refused = false;          // by the gate, or by the port: since the last sample
  bool clamp_unconfirmed = false;      // a clamp frame waits for its echo
  MonoTime clamp_sent = 0;             // the first that waits
  bool estimate_changed = false;       // with this sample
  ExperimentResult running;            // the experiment under way
  ExperimentResult result;             // the last that came to its outcome
  EstimateValues estimate;             // the last that had a result
  estimator::LearnedFriction learned;  // over all experiments, where they are kept
  bool contradictory = false;          // the last result, in itself
  double own_force_N = 0.0;            // before the experiment under way
  double slip_own_percent = 0.0;       // of the experiment under way, before it began
  // By direction and end stop.
  std::array<std::array<SlipShown, 2>, 2> slip_shown{};

  struct BusHealth {
    bool needed = false;                      // an experiment cannot go on without it
    BusState link = BusState::kActive;        // as the port sees it
    BusState controller = BusState::kActive;  // as error frames tell it
    MonoTime off_since = 0;                   // with kOff
    bool up() const noexcept {
      return link != BusState::kDown && link != BusState::kAbsent && link != BusState::kOff &&
             controller != BusState::kOff;
    }
  };
  std::array<BusHealth, kBusMax> buses;
};

}  // namespace beltgrip::daemon
