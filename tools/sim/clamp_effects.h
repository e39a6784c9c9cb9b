// From the force that the measured pressure tells to the force on the belt: what a model file says
// of lag, delay, further forces and play. SI. Simulation only.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "estimator/physics/machine_effects.h"

namespace beltgrip::sim {

class ClampEffects {
 public:
  ClampEffects(const estimator::MachineEffects& effects, double step_s)
      : effects_(effects),
        past_(static_cast<std::size_t>(std::max(0.0, effects.lag_delay_s) / step_s) + 1, 0.0),
        share_(effects.lag_time_constant_s > 0.0
                   ? -std::expm1(-step_s / effects.lag_time_constant_s)
                   : 1.0) {}

  // Force of pressure and spring in; begins at rest with the first one.
  double step(double force_N, double omega_s_rad_s) {
    if (!started_) {
      std::fill(past_.begin(), past_.end(), force_N);
      acting_N_ = play_N_ = force_N;
      started_ = true;
    }
    past_[now_] = force_N;
    now_ = (now_ + 1) % past_.size();
    acting_N_ += share_ * (past_[now_] - acting_N_);
    play_N_ =
        std::clamp(play_N_, acting_N_ - effects_.hysteresis_N, acting_N_ + effects_.hysteresis_N);
    return std::max(
        play_N_ + effects_.spring_N + effects_.centrifugal_N_s2 * omega_s_rad_s * omega_s_rad_s,
        1.0);
  }

 private:
  estimator::MachineEffects effects_;
  std::vector<double> past_;  // a ring
  std::size_t now_ = 0;
  double share_;
  double acting_N_ = 0.0, play_N_ = 0.0;
  bool started_ = false;
};

}  // namespace beltgrip::sim
