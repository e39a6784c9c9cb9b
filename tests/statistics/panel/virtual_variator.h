// The panel's virtual variator: the trace that its sensors would give.
// Independent of the estimator and of the simulator of tools/: only the geometry's numbers are the
// same. SI, slip in percent.
#pragma once

#include <vector>

#include "estimator/physics/variator_sample.h"
#include "scenario.h"

namespace beltgrip::panel {

struct Trace {
  std::vector<estimator::VariatorSample> samples;
  // Truth at each sample; slip in terms of sigma* (deformation included), in the torque's
  // direction.
  std::vector<double> slip_star_percent, slip_percent, clamp_N, torque_belt_Nm;
  // mu* of eq. 5 with the torque at the shaft, without noise: the loss of the primary counts.
  std::vector<double> mu;
  // The top of it, after a step of the friction: at the slip of the peak; where friction rises on,
  // at kRisingTo_percent.
  double mu_max = 0.0;
  bool peak_reached = false;  // true slip went past the peak
  double t_reached_s = 1e9;   // mu* first within 0.5 % of its peak
  double t_peak_s = 1e9;
  double slip_star_peak_percent = 0.0;  // sigma* at the peak
  double slip_star_leave_percent =
      0.0;  // where friction has left the top by 0.2 % (end of trace: last)
};

Trace simulate(const Scenario& scenario);

}  // namespace beltgrip::panel
