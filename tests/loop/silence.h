// Promises G2 and G5: the daemon dies, or every input falls silent, at instants spread over the
// whole ramp of a coast-down, and the belt stays inside its limits.
#pragma once

#include <map>
#include <string>

#include "tools/sim/vehicle_parameters.h"

namespace beltgrip::test {

struct SilenceResult {
  int runs = 0;
  double slip_max_share = 0.0;
  double slip_speed_max_m_s = 0.0;
  double energy_J = 0.0;                      // beyond the peak
  double ramp_s = 0.0;                        // length of the ramp without silence
  std::map<std::string, std::string> broken;  // invariants
};

// Silence from each step_s of the ramp on, each near_s within near_for_s of its end.
SilenceResult silence_over_the_ramp(sim::VehicleScenario scenario, double step_s, double near_s,
                                    double near_for_s);

}  // namespace beltgrip::test
