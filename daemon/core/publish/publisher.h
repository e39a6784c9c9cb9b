// Which frames leave at a sample: periods and at-once rules of BeltGripEstimate, BeltGripSlip,
// BeltGripStatus and, with control "command", BeltGripClamp, with their counters. Real-time thread.
//
//   message   period                            at once when
//   Estimate  100 ms                            a new result is there
//   Slip      10 ms in an experiment, 100 ms    MacroSlipStop changes
//   Status    1 s                               anything in it changes
//   Clamp     10 ms while a request stands,     a request begins or ends
//             and for limits::kInactiveFrames at start
//             and when one ends; all of those
//             at once at the end
//
// A frame sent at once restarts its period. Where the sample period does not divide a period, the
// frame leaves at the sample nearest to its instant.
#pragma once

#include <array>
#include <cstdint>

#include "daemon/core/base/limits.h"
#include "daemon/core/base/mono_time.h"
#include "daemon/core/base/outbox.h"
#include "daemon/core/publish/own_frames.h"

namespace beltgrip::daemon {

struct Publication {
  bool command = false;  // clamp frames are sent at all
  ClampValues clamp;
  EstimateValues estimate;
  SlipValues slip;
  StatusValues status;
  bool in_experiment = false;
  bool new_result = false;  // estimate has changed with this sample
};

class Publisher {
 public:
  Publisher(const FrameIdentifiers& identifiers, Duration sample_period);
  // Adds what is due at t. The first call sends every message.
  void collect(MonoTime t, const Publication& publication, Outbox& outbox) noexcept;
  // Adds every message: the last ones before the end.
  void collect_all(MonoTime t, const Publication& publication, Outbox& outbox) noexcept;
  // Counters and periods of another publisher's frames go on; clamp frames begin with inactive
  // ones.
  void go_on_from(const Publisher& before) noexcept;
  // Before a request; and where the inactive frames of the last may not have come through.
  void repeat_inactive() noexcept { inactive_left_ = limits::kInactiveFrames; }
  bool inactive_sent() const noexcept { return inactive_left_ == 0; }

 private:
  struct Schedule {
    MonoTime next = MonoTime::origin();
    std::uint8_t counter = 0;
  };
  // True if the message leaves at t; moves its schedule on.
  bool due(OwnMessage message, MonoTime t, Duration period, bool at_once) noexcept;
  std::uint8_t take_counter(OwnMessage message) noexcept;
  void collect_clamp(MonoTime t, const ClampValues& clamp, Outbox& outbox) noexcept;

  OwnFrames frames_;
  Duration tolerance_;  // half a sample period
  std::array<Schedule, kOwnMessageCount> schedules_{};
  bool started_ = false;
  bool last_stop_ = false;
  bool last_request_ = false;
  int inactive_left_ = limits::kInactiveFrames;
  StatusValues last_status_;
};

}  // namespace beltgrip::daemon
