// Between the real-time thread and the history that the helper thread keeps: results go out, what
// all experiments together say comes back. Two rings, wait-free; a full one drops. Real-time
// thread.
#pragma once

#include "daemon/core/base/spsc_ring.h"
#include "daemon/core/loop/loop.h"
#include "daemon/core/loop/pipeline.h"

namespace beltgrip::daemon {

using ResultRing = SpscRing<ExperimentResult, 16>;
using LearnedRing = SpscRing<estimator::LearnedFriction, 4>;

struct HistoryRings {
  ResultRing results;   // to the helper thread
  LearnedRing learned;  // and back
};

class HistoryLink final : public SampleSink {
 public:
  // next: where the reports go on to. tap: of the flight recorder, where there is one.
  HistoryLink(HistoryRings& rings, Pipeline& pipeline, SampleSink& next,
              RecordTap* tap = nullptr) noexcept
      : rings_(rings), pipeline_(pipeline), next_(next), tap_(tap) {}
  void on_report(const SampleReport& report) noexcept override {
    next_.on_report(report);
    if (report.new_result) rings_.results.push(report.result);
    estimator::LearnedFriction learned;
    while (rings_.learned.pop(learned)) {
      if (tap_ != nullptr) tap_->learned(report.t, learned);
      pipeline_.learn(learned);
    }
  }

 private:
  HistoryRings& rings_;
  Pipeline& pipeline_;
  SampleSink& next_;
  RecordTap* tap_;
};

}  // namespace beltgrip::daemon
