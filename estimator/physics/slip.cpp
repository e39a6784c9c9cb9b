#include "estimator/physics/slip.h"

#include <cmath>

#include "estimator/physics/units.h"

namespace beltgrip::estimator {

OperatingPoint operating_point(const VariatorParameters& variator, EndStop end_stop,
                               Direction direction) {
  const bool overdrive = end_stop == EndStop::kOverdrive;
  return {.direction = direction,
          .end_stop = end_stop,
          .ratio_g0 = overdrive ? variator.ratio_overdrive : variator.ratio_low,
          .primary_radius_m =
              overdrive ? variator.primary_radius_overdrive_m : variator.primary_radius_low_m,
          .sign = direction == Direction::kDrive ? 1.0 : -1.0};
}

EndStop nearest_end_stop(const VariatorParameters& variator, double speed_ratio) {
  // The geometric mean of the two ratios lies half-way.
  return speed_ratio * speed_ratio > variator.ratio_low * variator.ratio_overdrive
             ? EndStop::kOverdrive
             : EndStop::kLow;
}

double slip_percent(const OperatingPoint& point, double omega_p_rad_s, double omega_s_rad_s) {
  return point.sign * kPercent * (1.0 - omega_s_rad_s / omega_p_rad_s / point.ratio_g0);
}

double traction_coefficient(const VariatorParameters& variator, const OperatingPoint& point,
                            double torque_p_Nm, double clamp_force_N) {
  return point.sign * torque_p_Nm * std::cos(variator.half_wedge_angle_rad) /
         (2.0 * point.primary_radius_m * clamp_force_N);
}

double torque_carried_Nm(const VariatorParameters& variator, EndStop end_stop, double clamp_force_N,
                         double mu) {
  const double radius_m = end_stop == EndStop::kOverdrive ? variator.primary_radius_overdrive_m
                                                          : variator.primary_radius_low_m;
  return mu * 2.0 * radius_m * clamp_force_N / std::cos(variator.half_wedge_angle_rad);
}

double min_clamp_force_N(const VariatorParameters& variator, EndStop end_stop, double torque_p_Nm,
                         double mu_max) {
  const double radius_m = end_stop == EndStop::kOverdrive ? variator.primary_radius_overdrive_m
                                                          : variator.primary_radius_low_m;
  return variator.safety_factor * (std::abs(torque_p_Nm) + variator.torque_reserve_Nm) *
         std::cos(variator.half_wedge_angle_rad) / (2.0 * radius_m * mu_max);
}

}  // namespace beltgrip::estimator
