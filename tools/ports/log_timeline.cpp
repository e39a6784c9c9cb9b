#include "tools/ports/log_timeline.h"

#include <algorithm>
#include <optional>

namespace beltgrip::ports {

namespace {
constexpr std::int64_t kSecond_ns = 1'000'000'000;
// Frames of one bus may leave a kernel a little out of order; more than this is another matter.
constexpr std::int64_t kDisorder_ns = kSecond_ns;
// The longest silence that is played through.
constexpr std::int64_t kSilence_ns = 600 * kSecond_ns;
}  // namespace

// One log, one frame ahead of what is taken.
class LogTimeline::Source {
 public:
  Source(std::unique_ptr<can::LogReader> log, const FrameSelection& selection,
         TimelineCounters& counters)
      : log_(std::move(log)), selection_(selection), counters_(counters) {
    has_second_ = read(second_);
    advance();
  }

  const can::StampedFrame* front() const { return has_first_ ? &first_ : nullptr; }
  const can::LogStats& stats() const { return log_->stats(); }

  void advance() {
    for (;;) {
      has_first_ = has_second_;
      if (!has_first_) return;
      first_ = second_;
      has_second_ = read(second_);
      const bool leaps = has_before_ && first_.t_ns - before_ns_ > kDisorder_ns;
      if (leaps && has_second_ && second_.t_ns < first_.t_ns - kDisorder_ns) {
        ++counters_.frames_bad;
        continue;
      }
      break;
    }
    const std::int64_t log_ns = first_.t_ns;
    if (has_before_) {
      const std::int64_t gap_ns = log_ns - before_ns_;
      if (gap_ns < -kDisorder_ns || gap_ns > kSilence_ns) {
        shift_ns_ -= gap_ns < 0 ? gap_ns : gap_ns - kSilence_ns;
        ++counters_.clock_steps;
      }
    }
    before_ns_ = log_ns;
    last_ns_ = has_before_ ? std::max(last_ns_, log_ns + shift_ns_) : log_ns;
    has_before_ = true;
    first_.t_ns = last_ns_;
  }

 private:
  bool read(can::StampedFrame& frame) {
    can::LogRecord record;
    while (log_->next(record)) {
      if (!selection_.interface.empty() && record.interface != selection_.interface) continue;
      if (std::find(selection_.ignored.begin(), selection_.ignored.end(), record.frame.id) !=
          selection_.ignored.end()) {
        continue;
      }
      frame.t_ns = record.t_ns;
      frame.frame = record.frame;
      frame.bus =
          !selection_.further_interface.empty() && record.interface == selection_.further_interface;
      return true;
    }
    return false;
  }

  std::unique_ptr<can::LogReader> log_;
  const FrameSelection& selection_;
  TimelineCounters& counters_;
  can::StampedFrame first_, second_;
  bool has_first_ = false, has_second_ = false, has_before_ = false;
  std::int64_t before_ns_ = 0;  // stamp in the log of the frame before
  std::int64_t last_ns_ = 0;    // stamp on the timeline of the frame before
  std::int64_t shift_ns_ = 0;
};

LogTimeline::LogTimeline(std::vector<std::unique_ptr<can::LogReader>> logs,
                         FrameSelection selection)
    : selection_(std::move(selection)) {
  for (auto& log : logs) {
    sources_.push_back(std::make_unique<Source>(std::move(log), selection_, counters_));
  }
}

LogTimeline::~LogTimeline() = default;

bool LogTimeline::next(can::StampedFrame& frame) {
  Source* earliest = nullptr;
  for (const auto& source : sources_) {
    const can::StampedFrame* front = source->front();
    if (front != nullptr && (earliest == nullptr || front->t_ns < earliest->front()->t_ns)) {
      earliest = source.get();
    }
  }
  if (earliest == nullptr) return false;
  frame = *earliest->front();
  earliest->advance();
  if (counters_.frames == 0) counters_.first_ns = frame.t_ns;
  counters_.last_ns = frame.t_ns;
  ++counters_.frames;
  return true;
}

can::LogStats LogTimeline::stats() const {
  can::LogStats sum;
  for (const auto& source : sources_) {
    const can::LogStats& stats = source->stats();
    sum.lines += stats.lines;
    sum.frames += stats.frames;
    sum.lines_bad += stats.lines_bad;
    sum.first_bad.insert(sum.first_bad.end(), stats.first_bad.begin(), stats.first_bad.end());
  }
  return sum;
}

}  // namespace beltgrip::ports
