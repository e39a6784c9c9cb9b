// What a Pipeline is made of; seen by pipeline.cpp and pipeline_setup.cpp only.
#pragma once

#include <memory>

#include "daemon/core/input_monitor.h"
#include "daemon/core/pipeline.h"
#include "daemon/core/publisher.h"
#include "daemon/core/sampler.h"
#include "daemon/core/tx_gate.h"

namespace beltgrip::daemon {

struct Pipeline::Parts {
  explicit Parts(const Config& config);

  void take_own_frame(const RxFrame& frame) noexcept;
  void raise_bus_faults(MonoTime t) noexcept;
  bool triggered() const noexcept;
  Guards guards(MonoTime t) const noexcept;
  void apply(const Transition& transition, MonoTime t) noexcept;
  void step(MonoTime t) noexcept;
  void stop(MonoTime t, estimator::StopReason reason) noexcept;
  void publish_result(Outcome outcome) noexcept;
  Outcome judged_outcome() const noexcept;
  void report(MonoTime t) noexcept;
  Publication publication() const noexcept;
  void pass_gate(const Outbox& wanted, Outbox& outbox) noexcept;

  Config config;
  InputMonitor inputs;
  Sampler sampler;
  std::unique_ptr<estimator::SlipCurveEstimator> estimator;
  Publisher publisher;
  TxGate gate;
  FaultSet faults;
  PipelineCounters counters;
  SampleReport last;  // as reported

  State state = State::kInhibited;
  bool macro_slip_stop = false;
  bool samples_lost = false;                // since the last sample
  bool estimate_changed = false;            // with this sample
  ExperimentResult running;                 // the experiment under way
  ExperimentResult result;                  // the last that came to its outcome
  EstimateValues estimate;                  // the last that had a result
  BusState link = BusState::kActive;        // as the port sees it
  BusState controller = BusState::kActive;  // as error frames tell it
};

}  // namespace beltgrip::daemon
