// What is possible at best on one trace, for the table.
#pragma once

#include "virtual_variator.h"

namespace beltgrip::panel {

// Cramer-Rao bound for the relative standard deviation of mu_max from the data up to stop_s: an
// efficient fit that is told the family of the curve, sees torque, slip and pressure frame by frame
// (rounding counted as white noise) and knows that the clamp force runs straight; unknown are the
// curve's parameters, the deformation and the force's line. 0 where there is no peak.
double mu_max_bound(const Scenario& scenario, const Trace& trace, double stop_s);

// The same for the largest mu* up to stop_s, where the slip is told without noise.
double reached_bound(const Scenario& scenario, const Trace& trace, double stop_s);

struct DetectionBound {
  double delay_s = 0.0;            // after the peak
  double slip_past_percent = 0.0;  // beyond the peak by then
};
// When a detector that knows the curve, the slip and the force exactly, and the torque before the
// peak, has seen enough of the torque to prefer the true curve to one that stays at its top, or at
// the slope that it had up to half a percent below, at odds of 100 to 1 in the mean.
DetectionBound detection_bound(const Scenario& scenario, const Trace& trace);

}  // namespace beltgrip::panel
