#include "daemon/core/observe/observation.h"

namespace beltgrip::daemon {

void ObservationSink::on_report(const SampleReport& report) noexcept {
  const bool news =
      report.new_result || report.state != state_ || report.faults != faults_ || left_ == 0;
  if (!news) {
    --left_;
    return;
  }
  left_ = kSamples - 1;
  state_ = report.state;
  faults_ = report.faults;
  Observation& draft = slot_.draft();
  draft.t = report.t;
  draft.report = report;
  draft.pipeline = pipeline_.counters();
  draft.loop = meters_;
  for (std::size_t i = 0; i < kRoleCount; ++i) {
    draft.signals[i] = pipeline_.signal(static_cast<Role>(i));
  }
  slot_.publish();
}

}  // namespace beltgrip::daemon
