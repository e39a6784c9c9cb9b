#include "tools/cli/progress.h"

#include <unistd.h>

#include <cstdio>

namespace beltgrip::cli {

namespace {
constexpr double kPatience_s = 2.0, kPause_s = 0.2;
constexpr double kWholeRate = 10.0;  // no digits behind the point from there on
}  // namespace

Progress::Progress(bool shown)
    : shown_(shown && isatty(STDERR_FILENO) != 0), next_s_(kPatience_s) {}

void Progress::tell(double done, const std::string& what, const char* rate_unit, double share) {
  const double wall_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
  if (!shown_ || wall_s < next_s_) return;
  next_s_ = wall_s + kPause_s;
  const double rate = done / wall_s;
  std::fprintf(stderr, "\r\x1b[Kbeltgrip: %.0f %s, %.*f %s", done, what.c_str(),
               rate < kWholeRate ? 1 : 0, rate, rate_unit);
  if (share > 0.0 && share <= 1.0) {
    std::fprintf(stderr, ", %.0f s left", wall_s * (1.0 - share) / share);
  }
  std::fflush(stderr);
  on_screen_ = true;
}

void Progress::clear() {
  if (on_screen_) std::fputs("\r\x1b[K", stderr);
  on_screen_ = false;
}

void RunProgress::reads(const ports::LogTimeline& timeline) {
  timeline_ = &timeline;
  ++logs_begun_;
  done_s_ += log_s_;
  log_s_ = 0.0;
  first_.reset();
}

void RunProgress::at(daemon::MonoTime t) {
  if (!first_) first_ = t;
  if (!progress_.steps()) return;
  log_s_ = daemon::seconds(t - *first_);
  // The logs that are left take as long as the ones that were read.
  const double read = timeline_ != nullptr ? timeline_->share_read() : 0.0;
  const double share =
      read > 0.0 ? (static_cast<double>(logs_begun_ - 1) + read) / static_cast<double>(logs_) : 0.0;
  progress_.tell(done_s_ + log_s_, logs_ > 1 ? "s of the logs" : "s of the log", "times real time",
                 share);
}

}  // namespace beltgrip::cli
