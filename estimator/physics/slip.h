// Slip and traction coefficient as the paper defines them (equations 3 and 5), with the direction
// of the torque. Pure functions, SI but slip in percent, any thread.
//
// Signs: the paper's slip is positive in drive and negative in overrun; multiplied by the sign of
// the direction it is positive where the belt slips the way the torque pulls, in both. What pulley
// deformation adds to it keeps its own sign.
#pragma once

#include "estimator/physics/parameters.h"

namespace beltgrip::estimator {

// Below this magnitude neither direction nor traction coefficient mean anything.
inline constexpr double kTorqueDeadBand_Nm = 3.0;

// Of the ratio at an end stop, by which it falls as the clamp force bends the pulleys open: 0.5 to
// 2 % at 5 kN from variator to variator. The softest of them.
inline constexpr double kDeformationMost_1_N = 4e-6;

// What stays fixed during one experiment.
struct OperatingPoint {
  Direction direction = Direction::kDrive;
  EndStop end_stop = EndStop::kOverdrive;
  double ratio_g0 = 0.0;          // r_g0 at the end stop
  double primary_radius_m = 0.0;  // R_p at the end stop
  double sign = 1.0;              // +1 drive, -1 overrun
};

OperatingPoint operating_point(const VariatorParameters& variator, EndStop end_stop,
                               Direction direction);

// The end stop whose ratio is nearest by factor; speed_ratio > 0.
EndStop nearest_end_stop(const VariatorParameters& variator, double speed_ratio);

// sigma* = 1 - r_s / r_g0, equation (3), in percent, positive in the direction of the torque.
// omega_p > 0.
double slip_percent(const OperatingPoint& point, double omega_p_rad_s, double omega_s_rad_s);

// mu* = T_p cos(theta) / (2 R_p F_s), equation (5), positive in the direction of the torque.
// clamp_force > 0.
double traction_coefficient(const VariatorParameters& variator, const OperatingPoint& point,
                            double torque_p_Nm, double clamp_force_N);

// The magnitude of the torque with which that force carries that mu*.
double torque_carried_Nm(const VariatorParameters& variator, EndStop end_stop, double clamp_force_N,
                         double mu);

// MinClampForce: what holds the torque with that maximum friction, with [variator] safety_factor
// and torque_reserve_Nm.
// mu_max > 0.
double min_clamp_force_N(const VariatorParameters& variator, EndStop end_stop, double torque_p_Nm,
                         double mu_max);

}  // namespace beltgrip::estimator
