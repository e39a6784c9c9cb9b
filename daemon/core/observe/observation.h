// What the loop is doing, as plain data for the helper thread: service manager, `beltgrip status`,
// last lines of the log. Written by the real-time thread.
#pragma once

#include <array>
#include <cstdint>

#include "daemon/core/base/latest_slot.h"
#include "daemon/core/config/options/config.h"
#include "daemon/core/loop/loop.h"
#include "daemon/core/loop/pipeline.h"

namespace beltgrip::daemon {

struct Observation {
  MonoTime t = MonoTime::origin();
  SampleReport report;
  PipelineCounters pipeline;
  LoopMeters loop;
  std::array<SignalObservation, kRoleCount> signals;
};

// Publishes an observation every kSamples samples, and at once when something in it is news.
class ObservationSink final : public SampleSink {
 public:
  static constexpr int kSamples = 10;

  ObservationSink(const Pipeline& pipeline, const LoopMeters& meters, LatestSlot<Observation>& slot)
      : pipeline_(pipeline), meters_(meters), slot_(slot) {}
  void on_report(const SampleReport& report) noexcept override;

 private:
  const Pipeline& pipeline_;
  const LoopMeters& meters_;
  LatestSlot<Observation>& slot_;
  int left_ = 0;
  State state_ = State::kInhibited;
  std::uint32_t faults_ = 0;
};

}  // namespace beltgrip::daemon
