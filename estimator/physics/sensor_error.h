// What constant errors of the sensors do to mu*, to first order. Pure functions, any thread.
#pragma once

#include "estimator/physics/parameters.h"

namespace beltgrip::estimator {

inline constexpr double kSmallestStd = 1e-9;  // mu_max_std > 0 holds for data without any noise too

// Standard deviation of mu* relative to mu* from bias and gain of torque and pressure at one
// operating point: d ln mu* = dT/T - A dp/F. Speeds enter through the centrifugal part of F only;
// their part in slip moves the peak sideways, not its height.
double relative_sensor_deviation(const VariatorParameters& variator,
                                 const SensorAccuracies& accuracies, double torque_magnitude_Nm,
                                 double clamp_force_N, double omega_s_rad_s);

}  // namespace beltgrip::estimator
