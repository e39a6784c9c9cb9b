#include "daemon/core/estimate/estimate_stage.h"

#include "estimator/choice/make_estimator.h"

namespace beltgrip::daemon {

EstimateStage::EstimateStage(const Config& config)
    : method_(
          estimator::make_slip_curve_estimator(config.estimator, config.variator, config.sensors)) {
  if (config.corrected) {
    correction_.emplace(*config.corrected, config.variator, config.estimator.sample_rate_hz,
                        config.learned);
  }
  method_->reset();
}

void EstimateStage::step(const estimator::VariatorSample& sample,
                         const estimator::LearnedConditions& now, bool only_watches) noexcept {
  curve_ = method_->step(correction_ ? correction_->correct(sample, now) : sample);
  if (only_watches && curve_.stop != estimator::StopReason::kNone) {
    method_->reset();
    curve_ = {};
    curve_.t_ns = sample.t_ns;
  }
}

}  // namespace beltgrip::daemon
