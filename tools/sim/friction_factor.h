// What a machine has beyond the nominal friction: another shape of its curve, and what the
// coefficient depends on, as one factor. Simulation only.
#pragma once

#include <algorithm>
#include <cmath>

#include "estimator/physics/machine_effects.h"
#include "tools/sim/friction_curve.h"

namespace beltgrip::sim {

struct FrictionConditions {
  double oil_degC = 80.0;
  double omega_p_rad_s = 105.0;
  double force_N = 3000.0;
  double low_share = 0.0;  // 1 at the low end stop, 0 at overdrive
  double time_s = 0.0;     // since the experiment began
  double slip_energy_kJ = 0.0;
  int experiment = 0;
};

inline FrictionCurve shaped(FrictionCurve curve, const estimator::MachineEffects& e) {
  if (e.peak_slip_percent > 0.0) curve.peak_slip_percent = e.peak_slip_percent;
  curve.fall_per_percent = std::max(0.0, curve.fall_per_percent + e.fall_per_percent);
  return curve;
}

// Most vehicles have few of the effects, and this is asked twice a step: what has no effect is 1
// without a logarithm or a power.
inline double friction_factor(const estimator::MachineEffects& e, const FrictionConditions& now) {
  constexpr double kLeast = 0.05;
  const double wear = (now.experiment >= e.wear_from ? 1.0 - e.wear_step : 1.0) *
                      (1.0 - e.wear_per_experiment * static_cast<double>(now.experiment));
  const double speed =
      e.friction_per_ln_speed == 0.0
          ? 1.0
          : 1.0 + e.friction_per_ln_speed * std::log(std::max(now.omega_p_rad_s, 5.0) / 105.0);
  const double load =
      e.friction_load_exponent == 0.0
          ? 1.0
          : std::pow(std::max(now.force_N, 1.0) / 3000.0, -e.friction_load_exponent);
  const double started =
      e.warm_up_per_start == 0.0
          ? 1.0
          : 1.0 + e.warm_up_per_start * -std::expm1(-std::max(now.time_s, 0.0) / 30.0);
  return std::max(kLeast, wear) * std::max(kLeast, 1.0 + e.friction_per_K * (now.oil_degC - 80.0)) *
         std::max(kLeast, speed) * load * (1.0 + now.low_share * e.friction_low_relative) *
         std::max(kLeast, 1.0 + e.warm_up_per_kJ * now.slip_energy_kJ) * started;
}

}  // namespace beltgrip::sim
