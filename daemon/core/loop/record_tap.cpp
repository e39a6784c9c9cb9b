#include "daemon/core/loop/record_tap.h"

namespace beltgrip::daemon {

void RecordTap::frame(const RxFrame& frame) noexcept {
  if (frame.t <= sampled_ && after_ != sampled_) {
    after_ = sampled_;
    push({.t = sampled_ + kNanosecond, .kind = RecordKind::kAfter});
  }
  push({.t = frame.t,
        .kind = RecordKind::kFrame,
        .own_echo = frame.own_echo,
        .bus = frame.bus,
        .number = frame.dropped_before,
        .frame = frame.frame});
}

void RecordTap::learned(MonoTime t, const estimator::LearnedFriction& learned) noexcept {
  if (rings_.learned.push(learned)) push({.t = t, .kind = RecordKind::kLearned});
}

void RecordTap::sampled(const SampleReport& report) noexcept {
  sampled_ = report.t;
  const bool news = report.in_experiment != in_experiment_ || report.faults != faults_;
  if (!news && left_-- > 0) return;
  left_ = kMarkSamples - 1;
  in_experiment_ = report.in_experiment;
  faults_ = report.faults;
  push({.t = report.t,
        .kind = RecordKind::kMark,
        .in_experiment = report.in_experiment,
        .number = report.faults});
}

}  // namespace beltgrip::daemon
