// Under which conditions an experiment was made.
#pragma once

#include <optional>

#include "tools/diagnose/data/experiment_data.h"

namespace beltgrip::diagnose {

// Means over the valid samples, of which there is at least one.
struct Conditions {
  int stop = kNoStop;
  double speed_rad_s = 0.0, torque_Nm = 0.0, pressure_Pa = 0.0;
  double rate_Pa_s = 0.0;  // of the pressure, magnitude
  std::optional<double> oil_C;
};
Conditions conditions_of(const ExperimentData& run);

}  // namespace beltgrip::diagnose
