// One or several logs as one timeline: merged by stamp, frames of one interface or of all, of one
// bus or two, stamps made monotonic. A stamp, or a few, from which the next one leaps back to where
// the time was marks a garbled line: its frame is dropped and counted. Where the stamps of a log
// step back and stay there, or ahead by more than a week, its clock was set: time goes on without
// the step. A shorter gap is a pause of the recording, and time passes in it. Memory flat. Tools
// only.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "can_dbc/frame/can_frame.h"
#include "can_dbc/log/can_log.h"
#include "tools/ports/wanted_set.h"

namespace beltgrip::ports {

struct TimelineCounters {
  std::uint64_t frames = 0;       // delivered, or not wanted
  std::uint64_t frames_bad = 0;   // dropped because of their stamp
  std::uint64_t clock_steps = 0;  // steps of a log's clock that were taken out
  std::int64_t first_ns = 0;      // stamp of the first of them
  std::int64_t last_ns = 0;       // and of the last
};

struct FrameSelection {
  std::string interface;            // empty: all
  std::string further_interface;    // its frames are of bus 1, all others of bus 0; empty: none
  std::vector<can::CanId> ignored;  // BeltGrip's own frames are no input
  // Of the others those alone, the errors of a controller, and for the time that it spans each
  // log's first frame and last. Empty: all.
  std::vector<daemon::WantedFrames> wanted;
};

class LogTimeline {
 public:
  LogTimeline(std::vector<std::unique_ptr<can::LogReader>> logs, FrameSelection selection);
  ~LogTimeline();

  bool next(can::StampedFrame& frame);
  const TimelineCounters& counters() const { return counters_; }
  // Sums over the logs; first_bad of each in turn.
  can::LogStats stats() const;
  // How much of the logs is read, 0 to 1; no number: one is a stream.
  double share_read() const;

 private:
  class Source;
  FrameSelection selection_;
  WantedSet wanted_;
  std::vector<std::unique_ptr<Source>> sources_;
  TimelineCounters counters_;
  bool has_begun_ = false;
};

}  // namespace beltgrip::ports
