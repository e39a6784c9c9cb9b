#include "tools/ports/log_timeline.h"

#include <algorithm>
#include <optional>

#include "can_dbc/text/stray_stamps.h"

namespace beltgrip::ports {

namespace {
constexpr std::int64_t kSecond_ns = 1'000'000'000;
// Frames of one bus may leave a kernel a little out of order; more than this is another matter.
constexpr std::int64_t kDisorder_ns = kSecond_ns;
// A pause between two drives of one recording lasts days at most; a clock that is set after a start
// comes from years before (chosen). Time then goes on after what stands for a pause.
constexpr std::int64_t kClockSet_ns = 604'800 * kSecond_ns;
constexpr std::int64_t kPause_ns = 600 * kSecond_ns;
// Chosen, a bound on memory: of one stamp are as many frames as a row of a table has cells.
constexpr std::size_t kStrayFrames = 256;
}  // namespace

// One log, one frame ahead of what is taken, and some more where a stamp leaps. The two frames
// change places; none is copied before it is known to be wanted, but what was read ahead of a leap.
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
    shift();
    if (!first_->there) return false;
    if (!has_before_) {
      last_ns_ = before_ns_ = first_->record.t_ns;
      has_before_ = true;
      return true;
    }
    if (is_apart(first_->record.t_ns)) judge_leap();
    before_ns_ = first_->record.t_ns;
    last_ns_ = std::max(last_ns_, before_ns_ + shift_ns_);
    return true;
  }

  bool is_apart(std::int64_t t_ns) const {  // from the frame before
    return t_ns < before_ns_ - kDisorder_ns || t_ns > before_ns_ + kDisorder_ns;
  }

  // Of the first frame, which lies apart: out of the way of those that do not.
  [[gnu::noinline]] void judge_leap() {
    while (is_apart(first_->record.t_ns)) {
      const std::size_t count = strays();
      if (count == 0) break;
      counters_.frames_bad += count;
      for (std::size_t i = 0; i < count; ++i) shift();
    }
    const std::int64_t gap_ns = first_->record.t_ns - before_ns_;
    if (gap_ns < -kDisorder_ns || gap_ns > kClockSet_ns) {
      shift_ns_ -= gap_ns < 0 ? gap_ns : gap_ns - kPause_ns;
      ++counters_.clock_steps;
    }
  }

  void shift() {
    std::swap(first_, second_);
    if (!first_->there) return;
    if (more_.empty()) {
      read(*second_);
      return;
    }
    *second_ = more_[next_more_++];
    if (next_more_ < more_.size()) return;
    more_.clear();
    next_more_ = 0;
  }

  // The frame so many behind the first.
  const Ahead& ahead(std::size_t count) {
    if (count == 0) return *first_;
    if (count == 1) return *second_;
    const std::size_t at = next_more_ + count - 2;
    while (more_.size() <= at) read(more_.emplace_back());
    return more_[at];
  }

  // How many frames from the first on, which lies apart, are of garbled lines: a few, and the next
  // one takes the leap back.
  std::size_t strays() {
    const std::int64_t begin_ns = first_->record.t_ns;
    const bool is_back = begin_ns < before_ns_;
    const std::int64_t end_ns = (is_back ? before_ns_ : begin_ns) - kDisorder_ns;
    std::size_t stamps = 1;
    std::int64_t last_ns = begin_ns;
    for (std::size_t count = 1; count <= kStrayFrames; ++count) {
      const Ahead& next = ahead(count);
      if (!next.there) return 0;
      const std::int64_t next_ns = next.record.t_ns;
      if (is_back == (next_ns >= end_ns)) {
        const bool leaps_too = !is_back || next_ns > last_ns + kDisorder_ns;
        return leaps_too ? count : 0;
      }
      if (next_ns != last_ns && ++stamps > can::kStrayStamps) return 0;
      last_ns = next_ns;
    }
    return 0;
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
  std::vector<Ahead> more_;  // behind the second, where they were looked at
  std::size_t next_more_ = 0;
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
