#include "daemon/core/estimate/estimate_stage.h"

#include "estimator/choice/make_estimator.h"

namespace beltgrip::daemon {

EstimateStage::EstimateStage(const Config& config)
    : method_(
          estimator::make_slip_curve_estimator(config.estimator, config.variator, config.sensors)),
      torque_is_engine_(config.estimator.torque_is_engine) {
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

BeyondBox EstimateStage::beyond() const noexcept {
  if (!correction_) return {};
  const estimator::InputCorrection& correction = *correction_;
  const estimator::LearnedTerm* const term = correction.uncovered();
  if (term == nullptr) return {};
  BeyondBox beyond;
  beyond.term = term->name;
  switch (term->variable) {
    case estimator::LearnedVariable::kOilTemperature:
      beyond.role = Role::kOilTemperature;
      break;
    case estimator::LearnedVariable::kPrimarySpeed:
      beyond.role = Role::kPrimarySpeed;
      break;
    case estimator::LearnedVariable::kPrimaryPressure:
      beyond.role = Role::kPrimaryPressure;
      break;
    case estimator::LearnedVariable::kSecondaryPressure:
      beyond.role = Role::kSecondaryPressure;
      break;
    case estimator::LearnedVariable::kTorque:
      beyond.role = torque_is_engine_ ? Role::kEngineTorque : Role::kPrimaryTorque;
      break;
  }
  beyond.figure = correction.uncovered_at();
  beyond.least = term->knot[0];
  beyond.most = term->knot[term->count - 1];
  beyond.samples = 1;
  return beyond;
}

}  // namespace beltgrip::daemon
