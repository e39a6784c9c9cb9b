// The loop over a Port: drain frames, sample on the grid, send, report. The same object code for
// the bus, the embedded bus, replay and simulation. Real-time thread; returns when the Port is
// closed.
#pragma once

#include "daemon/core/base/latency_histogram.h"
#include "daemon/core/base/port.h"
#include "daemon/core/loop/history_rings.h"
#include "daemon/core/loop/pipeline.h"
#include "daemon/core/loop/record_tap.h"
#include "daemon/core/loop/reload.h"

namespace beltgrip::daemon {

// Receives each sample's report (a ring in the daemon, a file in replay, a checker in tests).
class SampleSink {
 public:
  virtual ~SampleSink() = default;
  virtual void on_report(const SampleReport& report) noexcept = 0;
  // As many samples as this were left out in a silence; each would have been like the last.
  virtual void on_silence(const SampleReport& /*last*/, std::int64_t /*samples*/) noexcept {}
};

struct LoopCounters {
  std::uint64_t samples_late = 0;  // cycle slips
  std::uint64_t sends_failed = 0;
};

// What the loop measures of itself while it runs, where somebody asks for it.
struct LoopMeters {
  LoopCounters counters;
  LatencyHistogram wake_up;          // from a sample's instant to the return of the wait for it
  LatencyHistogram sample_to_frame;  // from a sample's instant until the port had its frames
  LatencyHistogram frame_age;        // from a frame's stamp to its turn here
};

// What the loop exchanges with the helper thread between two samples, each a step of its own, after
// the sample's report has gone out: results and what the history learns of them; then another
// configuration, unless an experiment runs or its result may still be on its way to the history.
struct Exchange {
  static constexpr Duration kAfterResult = kSecond;

  HistoryRings* history = nullptr;
  ReloadSlot* reload = nullptr;
};

// The sample grid starts at port.now() as it is when run_loop is called: the first frame's stamp
// for a Port in log time. Samples that could not be taken in time are taken late, in order and with
// the frames that had come by their instants, so a late loop decides what a punctual one would
// have. In a silence that the port knows of, samples are left out as soon as nothing changes any
// more: it costs the same however long it is.
LoopCounters run_loop(Port& port, Pipeline& pipeline, double sample_rate_hz,
                      estimator::StopReason end_reason, SampleSink* sink,
                      LoopMeters* meters = nullptr, RecordTap* tap = nullptr,
                      const Exchange& exchange = {}) noexcept;

}  // namespace beltgrip::daemon
