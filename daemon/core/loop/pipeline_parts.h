// What a Pipeline is made of; seen by pipeline.cpp and pipeline_setup.cpp only.
#pragma once

#include "daemon/core/estimate/estimate_stage.h"
#include "daemon/core/estimate/known_friction.h"
#include "daemon/core/estimate/peak_evaluation.h"
#include "daemon/core/experiment/experiment_stage.h"
#include "daemon/core/guard/safety_monitor.h"
#include "daemon/core/input/input_stage.h"
#include "daemon/core/loop/pipeline.h"
#include "daemon/core/publish/output_stage.h"

namespace beltgrip::daemon {

struct Pipeline::Parts {
  explicit Parts(const Config& config, std::optional<RecordedRequests> recorded = {});

  void go_on_from(const Parts& before, bool keeps_results) noexcept;
  ExperimentStage::Now now(MonoTime t) noexcept;
  void take_action(Action action) noexcept;
  double acting_force_N() const noexcept;
  void judge_safety(const ExperimentStage::Now& now) noexcept;
  double permitted_force_N() const noexcept {
    return permitted ? experiment.request_force_N() : 0.0;
  }
  bool evaluate() noexcept;
  void publish_result(const estimator::PeakEstimate& peak) noexcept;
  Publication publication() const noexcept;
  void count_frames() noexcept;
  const SampleReport& make_report(const Publication& published, bool usable) noexcept;

  Config config;
  InputStage input;
  EstimateStage estimate;
  PeakEvaluation evaluation;
  KnownFriction known;
  ExperimentStage experiment;
  SafetyMonitor safety;
  OutputStage output;
  FaultSet faults;
  PipelineCounters counters;
  MonoTime t = MonoTime::origin();          // of the last sample
  bool estimate_changed = false;            // with this sample
  bool inputs_sound = false;                // with this sample: none is lost, none in doubt
  estimator::LearnedConditions conditions;  // with this sample
  bool permitted = false;  // by the safety monitor: to ask for force with this sample
  SampleReport report;     // of the last sample; written by make_report() alone
};

}  // namespace beltgrip::daemon
