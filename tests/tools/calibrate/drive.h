// A drive of a vehicle with a pushbelt variator, for calibration: its truth is the few lines here,
// which share nothing with the code under test. SI.
#pragma once

#include <cstdint>
#include <string>

#include "tools/diagnose/data/signal_table.h"

namespace beltgrip::test {

struct DriveTruth {
  double ratio_low = 0.405, ratio_overdrive = 2.25;  // at zero clamping force
  double deformation_per_kN = 0.001;
  double creep = 0.2;                // slip per mu*, at little of it
  double mu_max = 0.0;               // toward which creep grows; 0: it does not
  double inertia_kg_m2 = 0.18;       // engine to belt
  double vehicle_kg_m2 = 4.0;        // at the secondary shaft
  double pressure_zero_Pa = 30e3;    // what the sensor reads at none
  double secondary_delay_s = 0.004;  // after the primary speed
  double torque_delay_s = 0.03;
};

struct DriveKind {
  double duration_s = 600.0;
  bool key_on = true;             // begins with five seconds before the engine starts
  bool pressure_clipped = false;  // the sensor reads nothing below 0
  bool lifts = true;              // the foot leaves the pedal every few seconds
  bool reaches_overdrive = true;
  bool one_force = false;      // the clamp stays within a seventh of 7 kN
  bool rests_at_stops = true;  // else the ratio wanders near them
  double speed_noise_rad_s = 0.05, speed_step_rad_s = 0.1047;  // 1 rpm
  double torque_step_Nm = 0.5, pressure_step_Pa = 1e3;
  double engine_lag_s = 0.03;
  double torque_rate_Nm_s = 350.0;  // of what the driver wants
};

diagnose::SignalTable drive(const DriveTruth& truth, const DriveKind& kind, std::uint64_t seed);

// The same as a candump log of kDriveDbc's messages.
std::string drive_log(const diagnose::SignalTable& table);
extern const char* const kDriveDbc;
extern const char* const kDriveToml;  // configuration for it, beside drive.dbc

}  // namespace beltgrip::test
