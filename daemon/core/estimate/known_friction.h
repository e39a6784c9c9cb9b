// What is known of the belt's friction: from the results of this run, and from what the history of
// all experiments says. Says what a clamp force may rest on. Real-time thread.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "daemon/core/base/faults.h"
#include "daemon/core/config/options/config.h"
#include "daemon/core/estimate/ended_experiment.h"
#include "estimator/belt/belt_history.h"
#include "estimator/method/slip_curve_estimator.h"

namespace beltgrip::daemon {

class KnownFriction {
 public:
  // config outlives it.
  explicit KnownFriction(const Config& config) : config_(config) {}

  // The last result that says something of mu_max.
  struct Newest {
    estimator::PeakKind kind = estimator::PeakKind::kNone;
    double mu_max = 0.0;
    double mu_max_std = 0.0;
    std::uint8_t experiment_count = 0;
  };

  // What all experiments together say, where they are kept.
  void learn(const estimator::LearnedFriction& learned) noexcept;
  struct Taken {
    bool changed = false;  // newest() has
    bool slipped = false;  // the belt, with less friction than was known, and gave no value
  };
  // The result of an experiment that was evaluated. as_read: mu_max under the configuration's
  // constants, of a value. keeps_better: a bound below what is known says nothing.
  Taken take(const estimator::PeakEstimate& peak, const EndedExperiment& ended, double as_read,
             bool keeps_better) noexcept;

  const Newest& newest() const noexcept { return newest_; }
  // mu* at which the belt is known to let go, as it is read there; 0: not known. as_read: of the
  // newest value. What one experiment without a value says against it is asked once more: a sensor
  // that errs for a moment reads like a belt that slips, and a belt that is taken for half its
  // friction is never asked again. The second such answer in a row is believed.
  double peak_as_read(const estimator::CurveEstimate& curve, double as_read) const noexcept;
  // mu* that the belt has carried in the last experiment, where that gave a bound alone; 0: none.
  double carried() const noexcept {
    return newest_.kind == estimator::PeakKind::kLowerBound ? newest_.mu_max : 0.0;
  }
  // What MinClampForce may rest on at this direction and end stop; 0: not known. What the belt has
  // shown since a value was measured, there or elsewhere, lowers it.
  double to_rest_on(const estimator::CurveEstimate& curve) const noexcept;
  // The least clamp force that holds the belt at this torque; nothing: not known.
  std::optional<double> min_clamp_force_N(const estimator::CurveEstimate& curve) const noexcept;
  void raise_faults(MonoTime t, const estimator::CurveEstimate& curve,
                    FaultSet& faults) const noexcept;
  void go_on_from(const KnownFriction& before, bool keeps_results) noexcept;

 private:
  void keep_slipped(std::size_t group, const EndedExperiment& ended, Taken& taken) noexcept;
  double measured(std::size_t group) const noexcept;
  double known_as_read(std::size_t group) const noexcept;
  double share_slipped(std::size_t group) const noexcept;
  double share_left(std::size_t group) const noexcept;
  double traction_1_m(std::size_t group) const noexcept;

  const Config& config_;
  Newest newest_;
  estimator::LearnedFriction learned_;  // over all experiments, where they are kept
  // The newest results of the belt; those from before the start come with `learned`, which may be
  // long after it.
  estimator::BeltMemory memory_;
  std::array<unsigned, estimator::kBeltGroups> slips_in_a_row_{};  // of this run
  bool remembers_ = false;      // a result of its own: `memory` is newer than what is learned
  bool contradictory_ = false;  // the last result, in itself; until a measured one settles it
};

}  // namespace beltgrip::daemon
