#include "tools/ports/log_timeline.h"

#include <algorithm>
#include <optional>

namespace beltgrip::ports {

namespace {
constexpr std::int64_t kSecond_ns = 1'000'000'000;
// Frames of one bus may leave a kernel a little out of order; more than this is another matter.
constexpr std::int64_t kDisorder_ns = kSecond_ns;
// A pause between two drives of one recording lasts days at most; a clock that is set after a start
// comes from years before (chosen). Time then goes on after what stands for a pause.
constexpr std::int64_t kClockSet_ns = 604'800 * kSecond_ns;
constexpr std::int64_t kPause_ns = 600 * kSecond_ns;
}  // namespace

// One log, one frame ahead of what is taken. The two frames change places; none is copied before it
// is known to be wanted.
class LogTimeline::Source {
 public:
  Source(std::unique_ptr<can::LogReader> log, const FrameSelection& selection,
         const WantedSet& wanted, TimelineCounters& counters)
      : log_(std::move(log)), selection_(selection), wanted_(wanted), counters_(counters) {
    read(*second_);
    advance();
  }

  bool has_front() const { return first_->there; }
  std::int64_t front_ns() const { return last_ns_; }
  void take_front(can::StampedFrame& frame) {
    frame.t_ns = last_ns_;
    frame.frame = first_->record.frame;
    frame.bus = first_->bus;
    advance();
  }
  const can::LogStats& stats() const { return log_->stats(); }
  double share_read() const { return log_->share_read(); }

 private:
  struct Ahead {
    can::LogRecord record;
    std::uint8_t bus = 0;
    bool wanted = false;
    bool there = false;
  };

  // To the next frame that is wanted, or to the last.
  void advance() {
    bool is_first = !has_before_;
    while (step() && !first_->wanted && !is_first && second_->there) ++counters_.frames;
  }

  // False at the end.
  bool step() {
    for (;;) {
      std::swap(first_, second_);
      if (!first_->there) return false;
      read(*second_);
      const std::int64_t t_ns = first_->record.t_ns;
      const bool leaps = has_before_ && t_ns - before_ns_ > kDisorder_ns;
      if (!leaps || !second_->there || second_->record.t_ns >= t_ns - kDisorder_ns) break;
      ++counters_.frames_bad;
    }
    const std::int64_t log_ns = first_->record.t_ns;
    if (has_before_) {
      const std::int64_t gap_ns = log_ns - before_ns_;
      if (gap_ns < -kDisorder_ns || gap_ns > kClockSet_ns) {
        shift_ns_ -= gap_ns < 0 ? gap_ns : gap_ns - kPause_ns;
        ++counters_.clock_steps;
      }
    }
    before_ns_ = log_ns;
    last_ns_ = has_before_ ? std::max(last_ns_, log_ns + shift_ns_) : log_ns;
    has_before_ = true;
    return true;
  }

  void read(Ahead& ahead) {
    const can::LogRecord& record = ahead.record;
    while ((ahead.there = log_->next(ahead.record))) {
      if (!selection_.interface.empty() && record.interface != selection_.interface) continue;
      if (std::find(selection_.ignored.begin(), selection_.ignored.end(), record.frame.id) !=
          selection_.ignored.end()) {
        continue;
      }
      const bool further =
          !selection_.further_interface.empty() && record.interface == selection_.further_interface;
      ahead.bus = further ? 1 : 0;
      ahead.wanted = wanted_.has(record.frame, ahead.bus);
      return;
    }
  }

  std::unique_ptr<can::LogReader> log_;
  const FrameSelection& selection_;
  const WantedSet& wanted_;
  TimelineCounters& counters_;
  Ahead one_, other_;
  Ahead* first_ = &one_;
  Ahead* second_ = &other_;
  bool has_before_ = false;
  std::int64_t before_ns_ = 0;  // stamp in the log of the frame before
  std::int64_t last_ns_ = 0;    // stamp on the timeline of the frame before
  std::int64_t shift_ns_ = 0;
};

LogTimeline::LogTimeline(std::vector<std::unique_ptr<can::LogReader>> logs,
                         FrameSelection selection)
    : selection_(std::move(selection)), wanted_(selection_.wanted) {
  for (auto& log : logs) {
    sources_.push_back(std::make_unique<Source>(std::move(log), selection_, wanted_, counters_));
  }
}

LogTimeline::~LogTimeline() = default;

bool LogTimeline::next(can::StampedFrame& frame) {
  Source* earliest = nullptr;
  for (const auto& source : sources_) {
    if (!source->has_front()) continue;
    if (earliest == nullptr || source->front_ns() < earliest->front_ns()) earliest = source.get();
  }
  if (earliest == nullptr) return false;
  earliest->take_front(frame);
  if (!has_begun_) counters_.first_ns = frame.t_ns;
  has_begun_ = true;
  counters_.last_ns = frame.t_ns;
  ++counters_.frames;
  return true;
}

double LogTimeline::share_read() const {
  double sum = 0.0;
  for (const auto& source : sources_) sum += source->share_read();
  return sum / static_cast<double>(sources_.size());
}

can::LogStats LogTimeline::stats() const {
  can::LogStats sum;
  for (const auto& source : sources_) {
    const can::LogStats& stats = source->stats();
    sum.binary = sum.binary || stats.binary;
    sum.lines += stats.lines;
    sum.frames += stats.frames;
    sum.lines_bad += stats.lines_bad;
    sum.first_bad.insert(sum.first_bad.end(), stats.first_bad.begin(), stats.first_bad.end());
  }
  return sum;
}

}  // namespace beltgrip::ports
