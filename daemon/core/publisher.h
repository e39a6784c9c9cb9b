// Which frames leave at a sample: periods and at-once rules of BeltGripEstimate, BeltGripSlip and
// BeltGripStatus, with their counters. Real-time thread.
//
//   message   period                            at once when
//   Estimate  100 ms                            a new result is there
//   Slip      10 ms in an experiment, 100 ms    MacroSlipStop changes
//   Status    1 s                               anything in it changes
//
// A frame sent at once restarts its period. Where the sample period does not divide a period, the
// frame leaves at the sample nearest to its instant.
#pragma once

#include <array>
#include <cstdint>

#include "daemon/core/mono_time.h"
#include "daemon/core/outbox.h"
#include "daemon/core/own_frames.h"

namespace beltgrip::daemon {

struct Publication {
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

 private:
  struct Schedule {
    MonoTime next = 0;
    std::uint8_t counter = 0;
  };
  // True if the message leaves at t; moves its schedule on.
  bool due(OwnMessage message, MonoTime t, Duration period, bool at_once) noexcept;
  std::uint8_t take_counter(OwnMessage message) noexcept;

  OwnFrames frames_;
  Duration tolerance_;  // half a sample period
  std::array<Schedule, kOwnMessageCount> schedules_{};
  bool started_ = false;
  bool last_stop_ = false;
  StatusValues last_status_;
};

}  // namespace beltgrip::daemon
