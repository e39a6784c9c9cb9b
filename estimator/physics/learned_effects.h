// What learned functions are at one instant, beside the effects that have a name. Any thread; takes
// no memory.
#pragma once

#include <limits>
#include <span>

#include "estimator/physics/learned_term.h"
#include "estimator/physics/machine_effects.h"

namespace beltgrip::estimator {

// What the functions depend on; NaN where it is not known.
struct LearnedConditions {
  double oil_temperature_degC = std::numeric_limits<double>::quiet_NaN();
  double primary_speed_rad_s = std::numeric_limits<double>::quiet_NaN();
  double primary_pressure_Pa = std::numeric_limits<double>::quiet_NaN();
  double secondary_pressure_Pa = std::numeric_limits<double>::quiet_NaN();  // as measured
  double torque_Nm = std::numeric_limits<double>::quiet_NaN();
};

constexpr double condition(const LearnedConditions& now, LearnedVariable variable) noexcept {
  switch (variable) {
    case LearnedVariable::kOilTemperature:
      return now.oil_temperature_degC;
    case LearnedVariable::kPrimarySpeed:
      return now.primary_speed_rad_s;
    case LearnedVariable::kPrimaryPressure:
      return now.primary_pressure_Pa;
    case LearnedVariable::kSecondaryPressure:
      return now.secondary_pressure_Pa;
    case LearnedVariable::kTorque:
      break;
  }
  return now.torque_Nm;
}

// Sum of the functions that act at a point.
inline double learned_at(std::span<const LearnedTerm> terms, LearnedPoint point,
                         const LearnedConditions& now) noexcept {
  double sum = 0.0;
  for (const LearnedTerm& each : terms) {
    if (each.point == point) sum += each.at(condition(now, each.variable));
  }
  return sum;
}

// Each function as what it is at this instant: a drag, a gain, a force, a ratio. Friction has no
// constant among the effects and is left out.
inline MachineEffects with_learned(MachineEffects effects, std::span<const LearnedTerm> terms,
                                   const LearnedConditions& now) noexcept {
  const auto at = [&](LearnedPoint point) { return learned_at(terms, point, now); };
  effects.loss_constant_Nm += at(LearnedPoint::kTorque);
  effects.torque_gain = (1.0 + effects.torque_gain) * (1.0 + at(LearnedPoint::kTorqueGain)) - 1.0;
  effects.spring_N += at(LearnedPoint::kClampForce);
  const double ratio = at(LearnedPoint::kRatio);
  effects.end_stop_low = (1.0 + effects.end_stop_low) * (1.0 + ratio) - 1.0;
  effects.end_stop_overdrive = (1.0 + effects.end_stop_overdrive) * (1.0 + ratio) - 1.0;
  return effects;
}

}  // namespace beltgrip::estimator
