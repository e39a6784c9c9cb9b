// MinClampForce against the controller's own clamping law, paired sample by sample: in one drive of
// the virtual vehicle with its own law, what the other law's force would cost in the same sample,
// at the same torque and speed. Two drives of their own would differ by more than the laws do.
// Computed by the virtual vehicle's loss model, not measured on a car.
#pragma once

#include <cstdint>

#include "tools/sim/vehicle_scenario.h"
#include "tools/sim/vehicle_simulation.h"

namespace beltgrip::saving {

// F = safety_factor (|T| + reserve) cos / (2 R_p mu_max), never above the controller's own force,
// never below what its pressure floor makes.
struct Law {
  double safety_factor = 1.3;
  double reserve_Nm = 10.0;
};

// Means of one side while the lock-up is closed.
struct Side {
  double force_N = 0.0;
  double belt_W = 0.0;  // bearings and clamp
  double slip_W = 0.0;
  double pump_W = 0.0;
  double at_top_s = 0.0;  // torque beyond what the belt holds
  double without_pump_W() const { return belt_W + slip_W; }
  double with_pump_W() const { return without_pump_W() + pump_W; }
};

struct Paired {
  Side own, min_clamp;
  double locked_s = 0.0;
};
Paired paired_drive(const sim::VehicleScenario& scenario, std::uint64_t seed, const Law& law);

// The same car driven with that law in place of its own: time with the slip beyond the peak.
double gross_slip_s(sim::VehicleScenario scenario, std::uint64_t seed, const Law& law);

// Pieces, for their tests. The command of the law, from that of the own law at the same instant.
double min_clamp_command_N(const sim::VehicleScenario& scenario, const Law& law, double own_force_N,
                           double primary_radius_m, double omega_s_rad_s);
// Slip at which the belt carries that coefficient, on the rise of its curve, as a fraction; the
// peak's where it does not.
double carrying_slip_share(const sim::FrictionCurve& curve, double mu);

}  // namespace beltgrip::saving
