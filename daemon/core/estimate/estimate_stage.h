// Second stage of a sample: the sample in, its point of the friction curve out. Real-time thread.
#pragma once

#include <memory>
#include <optional>

#include "daemon/core/config/options/config.h"
#include "daemon/core/estimate/beyond_box.h"
#include "estimator/method/slip_curve_estimator.h"
#include "estimator/signal/input_correction.h"

namespace beltgrip::daemon {

class EstimateStage {
 public:
  explicit EstimateStage(const Config& config);

  // only_watches: no experiment runs. What would have stopped it (a ratio that is no end stop's,
  // torque that changes its sign) then starts the method afresh.
  // now: what a learned function depends on beside the sample.
  void step(const estimator::VariatorSample& sample, const estimator::LearnedConditions& now,
            bool only_watches) noexcept;
  void reset() noexcept { method_->reset(); }  // the curve of the last sample stays
  void ends_at_the_top() noexcept { method_->ends_at_the_top(); }
  // Once per sample after the last step of an experiment, until it returns true: then peak().
  bool conclude() noexcept { return method_->conclude(); }
  const estimator::PeakEstimate& peak() const noexcept { return method_->peak(); }

  const estimator::CurveEstimate& curve() const noexcept { return curve_; }
  // Why there is no curve at the last sample, where a learned term does not reach so far.
  BeyondBox beyond() const noexcept;
  bool is_beyond() const noexcept { return correction_ && correction_->uncovered() != nullptr; }
  // The clamp force in the transmission's own measure, which requests are made in.
  double measured_force_N() const noexcept {
    return curve_.clamp_force_N - (correction_ ? correction_->force_error_N() : 0.0);
  }

 private:
  std::optional<estimator::InputCorrection> correction_;  // where the configuration names a model
  std::unique_ptr<estimator::SlipCurveEstimator> method_;
  bool torque_is_engine_;
  estimator::CurveEstimate curve_;
};

}  // namespace beltgrip::daemon
