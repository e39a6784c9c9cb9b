// Everything that the robust method remembers of one experiment, in bounded memory: means over
// cells that grow with age, and the slow course and noise of each channel. Real-time thread; all
// memory is taken by the constructor.
#pragma once

#include <cstddef>
#include <limits>
#include <vector>

#include "estimator/reading/step_watch.h"
#include "estimator/record/history.h"
#include "estimator/signal/trend.h"

namespace beltgrip::estimator {

class ExperimentRecord {
 public:
  explicit ExperimentRecord(double sample_rate_hz);
  void reset() noexcept;
  // One sample, t_s since the first. True when a cell of the finest level was completed.
  bool step(const Cell& sample) noexcept;
  // The belt has begun to slip: the shafts run apart, which is no noise of their speeds.
  void slips() noexcept { slips_ = true; }

  const History& history() const noexcept { return history_; }
  const Trend& force() const noexcept { return force_; }
  const Trend& torque() const noexcept { return torque_; }
  // The straight lines that end now.
  const Line& force_line() const noexcept { return force_line_; }
  const Line& torque_line() const noexcept { return torque_line_; }
  // Where the torque's line stood at t when it ended there: what was known of the torque then.
  struct TorqueEstimate {
    double torque_Nm = 0.0, variance = 0.0;
    bool valid = false;
  };
  TorqueEstimate torque_estimate_at(double t_s) const noexcept;
  // Noise of the channels, as densities (variance of the mean over one second), without what is
  // true variation.
  double torque_noise_Nm2_s() const noexcept { return torque_.density(kNoiseScale_s); }
  // Variance of the error that readings of the torque close in time share.
  double torque_slow_variance() const noexcept { return torque_slow_variance_; }
  // A shaft's speed is read with the same error at any speed; slip, which divides by it, is not.
  double slip_noise_percent2_s() const noexcept {
    return slip_speed_.density(kNoiseScale_s) / (last_omega_rad_s_ * last_omega_rad_s_);
  }
  // Degrees of freedom of that: differences of neighbouring means overlap by half.
  double slip_noise_freedom() const noexcept { return 0.5 * slip_speed_.squares(0.0); }
  double omega_noise_rad2_s() const noexcept { return omega_p_.density(kNoiseScale_s); }
  // Clamp force at a cell: of the line where it reaches, else as measured.
  double clamp_force_N(const Cell& cell) const noexcept {
    return force_line_.valid && cell.t_s >= force_line_.begin_s ? force_line_.at(cell.t_s)
                                                                : cell.clamp_force_N;
  }
  double duration_s() const noexcept { return last_t_s_; }
  // When the torque's reading first stepped since the clamp force began to fall; infinite: never.
  double torque_stepped_s() const noexcept { return torque_stepped_s_; }
  // Until when that says anything of the reading: then the force comes back.
  double torque_counts_until_s() const noexcept { return lowered_until_s() - kTakingUp_s; }
  // When the clamp force was at its lowest, if it has been raised since; else infinity.
  double lowered_until_s() const noexcept;

 private:
  // Frames of 20 Hz and more are independent over this time; torque and slip hardly vary in it.
  static constexpr double kNoiseScale_s = 0.2;
  // As the force comes back, the shafts come back to one speed, which takes torque.
  static constexpr double kTakingUp_s = 0.5;

  void follow_force(const Cell& sample) noexcept;

  History history_;
  Trend force_, torque_, omega_p_;
  Trend slip_speed_;  // slip times speed
  Line force_line_, torque_line_;
  double torque_slow_variance_ = 0.0;
  std::vector<TorqueEstimate> torque_estimates_;  // at the end of each cell of the torque's trend
  std::size_t torque_estimate_count_ = 0;
  double last_held_s_ = 0.0;
  StepWatch torque_watch_;
  double first_force_N_ = 0.0;
  bool slips_ = false;
  bool lowered_ = false;  // since then the torque is watched
  double torque_stepped_s_ = std::numeric_limits<double>::infinity();
  double smooth_force_N_ = 0.0;
  double lowest_force_N_ = 0.0, lowest_force_s_ = 0.0;
  double last_t_s_ = 0.0;
  double last_omega_rad_s_ = 1.0;
};

}  // namespace beltgrip::estimator
