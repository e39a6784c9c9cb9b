// The evaluation of an experiment, some of it at each sample: its curve, what the assumptions make
// of its peak, and of the top that points on no one curve reached. Real-time thread.
#pragma once

#include <cstdint>
#include <optional>

#include "daemon/core/config/options/config.h"
#include "daemon/core/estimate/ended_experiment.h"
#include "daemon/core/estimate/estimate_stage.h"
#include "estimator/physics/assumed_constants.h"

namespace beltgrip::daemon {

class PeakEvaluation {
 public:
  // config outlives it.
  explicit PeakEvaluation(const Config& config);

  // Before the first step of each experiment.
  void begin() noexcept;
  // One sample's share; true once peak() says what is published. What was read rests on the
  // configuration's constants; what is known of mu_max also on those that nobody stated.
  bool step(EstimateStage& estimate, const EndedExperiment& ended,
            const estimator::VariatorSample& sample) noexcept;

  const estimator::PeakEstimate& peak() const noexcept { return peak_; }
  // Of mu_max: the part by constant errors of the sensors and by assumed constants.
  double sensor_std() const noexcept { return sensor_std_; }
  // mu_max of the last value under the configuration's constants; 0: none yet.
  double friction_as_read() const noexcept { return friction_as_read_; }
  void go_on_from(const PeakEvaluation& before) noexcept {
    friction_as_read_ = before.friction_as_read_;
  }

 private:
  enum class Next : std::uint8_t { kCurve, kPeak, kTop, kDone };
  void read_peak(const EstimateStage& estimate, const EndedExperiment& ended,
                 const estimator::VariatorSample& sample) noexcept;
  void bound_only(const estimator::CurveEstimate& curve, double omega_s_rad_s) noexcept;
  void begin_weighing(const EndedExperiment& ended, double mu, double force_N,
                      double relative_noise) noexcept;
  void weigh_peak() noexcept;
  void weigh_top(const EndedExperiment& ended) noexcept;
  double top_reached(const EndedExperiment& ended) const noexcept;
  double top_force_N(const EndedExperiment& ended) const noexcept;
  estimator::PeakReading reading_at(const EndedExperiment& ended, double mu,
                                    double force_N) const noexcept;

  const Config& config_;
  std::optional<estimator::AssumedConstants> assumptions_;  // where there are any
  Next next_ = Next::kCurve;
  bool weighing_ = false;  // by the assumptions, begun
  estimator::PeakEstimate peak_;
  double sensor_std_ = 0.0;
  double friction_as_read_ = 0.0;
};

}  // namespace beltgrip::daemon
