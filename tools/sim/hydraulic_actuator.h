// One pressure circuit: dead time, first-order lag, floor and ceiling; and the Coulomb friction of
// a cylinder as play. SI. Simulation only.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "tools/sim/vehicle_parameters.h"

namespace beltgrip::sim {

// Lag and dead time of cold oil over those of warm oil.
inline double oil_slowness(const HydraulicParameters& hydraulics, double oil_degC) {
  constexpr double kWarmOil_degC = 60.0;
  const double cold = std::clamp((kWarmOil_degC - oil_degC) / kWarmOil_degC, 0.0, 1.5);
  return 1.0 + (hydraulics.cold_factor - 1.0) * cold;
}

class HydraulicActuator {
 public:
  HydraulicActuator(const HydraulicParameters& parameters, double step_s)
      : parameters_(parameters), step_s_(step_s), past_(kPast, 0.0) {}

  void settle(double pressure_Pa) {
    pressure_Pa_ = limit(pressure_Pa);
    std::fill(past_.begin(), past_.end(), pressure_Pa_);
  }
  // slowness multiplies lag and dead time: cold oil, a fault.
  double step(double command_Pa, double slowness) {
    return step(command_Pa, slowness, follows(slowness));
  }
  // The same, of another circuit that has asked how it follows.
  double step(double command_Pa, double slowness, double follows) {
    past_[now_] = limit(command_Pa);
    const auto delay =
        std::min(kPast - 1, static_cast<std::size_t>(parameters_.dead_time_s * slowness / step_s_));
    const double delayed_Pa = past_[(now_ + kPast - delay) % kPast];
    now_ = (now_ + 1) % kPast;
    pressure_Pa_ -= follows * (delayed_Pa - pressure_Pa_);
    return pressure_Pa_;
  }
  // The share of its way that it has left behind after a step, less 1. Kept: warm oil stays as it
  // is.
  double follows(double slowness) {
    if (slowness != slowness_) {
      slowness_ = slowness;
      follows_ = std::expm1(-step_s_ / (parameters_.lag_s * slowness));
    }
    return follows_;
  }
  double pressure_Pa() const { return pressure_Pa_; }

 private:
  double limit(double pressure_Pa) const {
    return std::clamp(pressure_Pa, parameters_.pressure_floor_Pa, parameters_.pressure_max_Pa);
  }
  static constexpr std::size_t kPast = 2048;
  HydraulicParameters parameters_;
  double step_s_;
  std::vector<double> past_;  // commands, a ring
  std::size_t now_ = 0;
  double pressure_Pa_ = 0.0;
  double slowness_ = std::numeric_limits<double>::quiet_NaN();
  double follows_ = 0.0;
};

// The force behind Coulomb friction follows the force before it within +/- friction.
class CoulombPlay {
 public:
  double step(double force_N, double friction_N) {
    out_N_ = started_ ? std::clamp(out_N_, force_N - friction_N, force_N + friction_N) : force_N;
    started_ = true;
    return out_N_;
  }

 private:
  double out_N_ = 0.0;
  bool started_ = false;
};

}  // namespace beltgrip::sim
