// Under which conditions an experiment was made.
#pragma once

#include <optional>

#include "tools/diagnose/infer/residuals.h"

namespace beltgrip::diagnose {

// Means over the valid samples, of which there is at least one.
struct Conditions {
  int stop = kNoStop;
  double speed_rad_s = 0.0, torque_Nm = 0.0, pressure_Pa = 0.0;
  double rate_Pa_s = 0.0;  // of the pressure, magnitude
  std::optional<double> oil_C;
};
Conditions conditions_of(const ExperimentData& run);

// Where all experiments are the same ramp, time is the clamp force by another name: of the spread
// of the pressure nothing is left between samples of one time.
bool is_time_a_ramp(const Campaign& campaign);

}  // namespace beltgrip::diagnose
