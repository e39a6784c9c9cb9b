// An experiment that was not made yet: what the sensors would read in it, without their noise, were
// the machine as a state says. By algebra, no integration: the ramp is slow.
#pragma once

#include "tools/diagnose/infer/residuals.h"

namespace beltgrip::diagnose {

// A ramp of the clamp force down to the peak of friction and up again, all else held.
struct Ramp {
  bool is_low = false;  // the end stop
  double speed_rad_s = 0.0, torque_Nm = 0.0, oil_C = 0.0;
  double start_force_N = 0.0, ramp_N_s = 0.0;
  double grip_step_N = 0.0;        // up at once where it turns: a belt that slips has to grip again
  double turn_slip_percent = 0.0;  // where it turns, as it reads: with what the pulleys give way
};

// What every recipe has besides.
inline constexpr double kRecipeHold_s = 3.0;         // at the start
inline constexpr double kRecipeRestore_N_s = 400.0;  // up again
inline constexpr double kRecipeLength_s = 60.0;

// The campaign with nothing in it but this run, as the next one after those that were made: its
// number is the number of those.
Campaign planned_next(const Campaign& campaign, const Ramp& ramp, const ModelState& state);

}  // namespace beltgrip::diagnose
