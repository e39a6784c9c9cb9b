#include "daemon/core/loop/reload.h"

namespace beltgrip::daemon {

ReloadSlot::~ReloadSlot() {
  offer(nullptr);
  collect();
}

void ReloadLink::on_report(const SampleReport& report) noexcept {
  next_.on_report(report);
  if (report.new_result) not_before_ = report.t + kAfterResult;
  if (report.in_experiment || report.t < not_before_) return;
  Reload* reload = slot_.take();
  if (reload == nullptr) return;
  if (tap_ != nullptr) tap_->reloaded(report.t);
  pipeline_.give_way_to(reload->pipeline, reload->keeps_results);
  port_.select(reload->wanted);
  slot_.give_back(reload);
}

}  // namespace beltgrip::daemon
