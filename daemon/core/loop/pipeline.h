// Frames and sample instants in, frames and reports out: everything the daemon decides. No I/O, no
// clock, no allocation after construction. Real-time thread; replay and simulation use the same
// object.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>

#include "can_dbc/frame/can_frame.h"
#include "daemon/core/base/faults.h"
#include "daemon/core/base/outbox.h"
#include "daemon/core/base/port.h"
#include "daemon/core/config/options/config.h"
#include "daemon/core/experiment/experiment.h"
#include "daemon/core/experiment/recorded_requests.h"
#include "daemon/core/input/input_monitor.h"
#include "daemon/core/loop/sample_report.h"
#include "estimator/belt/belt_history.h"
#include "estimator/method/slip_curve_estimator.h"

namespace beltgrip::daemon {

// The newest value of a role that was taken, and what is known of the reading.
struct SignalObservation {
  estimator::ReadingStatus status;
  bool seen = false;
  double value = 0.0;               // SI
  MonoTime t = MonoTime::origin();  // its stamp
};

struct PipelineCounters {
  std::uint64_t frames = 0;          // offered
  std::uint64_t frames_decoded = 0;  // of a message that carries a role, taken
  std::uint64_t frames_bad = 0;      // of such a message, but wrong length, kind or protection
  std::uint64_t samples = 0;
  std::uint64_t frames_refused = 0;  // by the transmit gate
  UdsCounters diagnostics;
};

// What the loop itself goes by: whether anything changes, and whether an experiment runs.
struct Pulse {
  State state = State::kInhibited;
  bool in_experiment = false;
  bool macro_slip_stop = false;
  std::uint32_t faults = 0;
  std::uint32_t inhibits = 0;
  bool busy = false;  // samples come, or a result has
  friend bool operator==(const Pulse&, const Pulse&) = default;
};

class Pipeline {
 public:
  explicit Pipeline(const Config& config);
  // Replay with control "command": experiments begin and end with the requests of the log. This one
  // sends no clamp frame.
  Pipeline(const Config& config, RecordedRequests recorded);
  ~Pipeline();
  Pipeline(const Pipeline&) = delete;
  Pipeline& operator=(const Pipeline&) = delete;

  // Frames in order of arrival. BeltGrip's own identifiers are never inputs; such a frame that is
  // no echo comes from a foreign sender, which latches a fault.
  void on_frame(const RxFrame& frame) noexcept;
  // The link as the Port sees it; the controller's state comes with its error frames.
  void on_bus_state(BusState state, MonoTime t, std::uint8_t bus = 0) noexcept;
  // A sample at t was taken late, or (lost) samples before t were not taken at all.
  void on_late(MonoTime t, bool lost) noexcept;
  // So many samples at which nothing comes and nothing changes are left out.
  void on_silence(std::int64_t samples) noexcept;
  void on_send_failed(const can::CanFrame& frame, MonoTime t, std::uint8_t bus = 0) noexcept;
  // The sample at t: decides and leaves in outbox what must be sent now.
  const SampleReport& on_sample(MonoTime t, Outbox& outbox) noexcept;
  // The end (stop request, end of a log): ends a running experiment and leaves the last frames. Its
  // report has no sample of its own (sample.usable is false).
  const SampleReport& on_end(MonoTime t, estimator::StopReason reason, Outbox& outbox) noexcept;
  // Of the last sample.
  const SampleReport& report() const noexcept;
  Pulse pulse() const noexcept;
  const ExperimentResult* new_result() const noexcept;  // nullptr: it brought none
  // What all experiments together say, from the next sample on: MinClampForce rests on it.
  void learn(const estimator::LearnedFriction& learned) noexcept;
  // Between two samples, while no experiment runs: this becomes `next`, which has not been used
  // yet, and next becomes what this was. Inputs begin anew; the bus, its faults, the counters of
  // frames, and with `keeps_results` what was found so far, go on.
  void give_way_to(Pipeline& next, bool keeps_results) noexcept;
  const PipelineCounters& counters() const noexcept;
  std::size_t bus_count() const noexcept;  // that it listens to
  SignalObservation signal(Role role) const noexcept;
  FramesCame frames_came(Role role) const noexcept;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace beltgrip::daemon
