// How far a command has come, on a terminal, where it takes longer than people wait without a word:
// what is done, how fast, and how long the rest takes. Tools only.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "daemon/core/base/mono_time.h"
#include "tools/ports/log_timeline.h"

namespace beltgrip::cli {

// Of an option --quiet.
inline constexpr const char* kNoProgress = "No progress on standard error";

class Progress {
 public:
  explicit Progress(bool shown = true);
  ~Progress() { clear(); }
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  // For loops of many short steps: true at one in a thousand of them.
  bool steps() { return shown_ && ++steps_ % kSteps == 0; }
  // share: of the whole, 0 to 1; no number: not known. "12 s of the log, 340 times real time, 5 s
  // left"
  void tell(double done, const std::string& what, const char* rate_unit, double share);
  // Before other text.
  void clear();

 private:
  static constexpr std::uint64_t kSteps = 1024;

  bool shown_;
  bool on_screen_ = false;
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
  double next_s_;
  std::uint64_t steps_ = 0;
};

// Of the pipeline over one log after another.
class RunProgress {
 public:
  explicit RunProgress(Progress& progress, std::size_t logs = 1)
      : progress_(progress), logs_(logs) {}
  void reads(const ports::LogTimeline& timeline);
  void at(daemon::MonoTime t);  // every sample

 private:
  Progress& progress_;
  const ports::LogTimeline* timeline_ = nullptr;
  std::size_t logs_, logs_begun_ = 0;
  double done_s_ = 0.0, log_s_ = 0.0;  // of the logs before, of this one
  std::optional<daemon::MonoTime> first_;
};

}  // namespace beltgrip::cli
