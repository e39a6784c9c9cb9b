// How hard a belt is clamped at the least loss: more force costs torque in bearings, belt and pump,
// less force costs micro-slip. Pure functions, SI but slip in percent, any thread.
#pragma once

#include "estimator/physics/parameters.h"

namespace beltgrip::estimator {

// Torque that a force costs at the primary shaft. Bearings and belt: 0.1 Nm per kN (chosen: the
// virtual vehicle's).
inline constexpr double kBeltLoss_Nm_per_N = 1e-4;
// And a pump of 19 cm3 a turn and an efficiency of 0.85 that turns with the primary and whose
// pressure is the clamping pressure (chosen: a passenger car's).
double pump_torque_Nm(double pressure_Pa);
double pump_loss_Nm_per_N(const VariatorParameters& variator);

// The force of least loss over the least force that holds the belt, at an end stop; > 0 all.
double least_loss_share(const VariatorParameters& variator, EndStop end_stop, double mu_max,
                        double sigma_peak_percent, double loss_Nm_per_N);

// The torque_reserve_Nm with which MinClampForce is that force at this torque; 0 where
// safety_factor alone is more.
double reserve_of_least_loss_Nm(const VariatorParameters& variator, double share, double torque_Nm);

}  // namespace beltgrip::estimator
