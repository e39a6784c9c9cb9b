// Experiments on a test rig, made for tests of the estimator: a variator at its end stop whose
// clamp force is ramped down under a held load until the belt slips. Own plant and own friction
// laws; the truth stands beside each sample.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "estimator/physics/parameters.h"
#include "estimator/physics/variator_sample.h"

namespace beltgrip::test {

// mu* over slip in percent, both as magnitudes.
using FrictionLaw = std::function<double(double)>;

// Rises in a straight line to the peak, falls in another: a corner.
FrictionLaw tent(double mu_max, double peak_percent, double fall_per_percent);
// mu_max 2 x / (1 + x^2), x = slip / peak: round.
FrictionLaw round_peak(double mu_max, double peak_percent);
// limit slip / (slip + half): rises for ever.
FrictionLaw saturating(double limit, double half_percent);

struct Rig {
  FrictionLaw friction = tent(0.105, 2.5, 2e-3);
  estimator::EndStop end_stop = estimator::EndStop::kOverdrive;
  double torque_Nm = 50.0;     // of the primary; negative: overrun
  double mu_begin = 0.075;     // at the begin of the ramp
  double ramp_N_per_s = 26.0;  // 0: clamp force held
  double restore_s = 1e9;      // when the force is raised again, by restore_N_per_s
  double restore_N_per_s = 3000.0;
  double rest_s = 2.0;   // before the ramp
  double end_s = 120.0;  // or:
  double end_slip_percent = 12.0;
  double secondary_inertia_kg_m2 = 0.5;      // what runs away once the belt slips
  double deformation_percent_per_kN = 0.18;  // of the ratio
  double noise = 1.0;                        // times 0.2 Nm, 1 kPa, 0.03 and 0.05 rad/s
  double speed_quantum_rad_s = 0.0;
  double reversal_s = 1e9;       // when the torque changes its sign
  double omega_p_rad_s = 105.0;  // at the begin
  double slowing_rad_s2 = 0.0;
  std::uint64_t seed = 1;
  double sample_rate_hz = 200.0;
};

struct TracePoint {
  estimator::VariatorSample sample;
  double slip_percent = 0.0;  // of the belt, without deformation; magnitude
  double mu = 0.0;            // on the belt
  double clamp_force_N = 0.0;
};

// With the default VariatorParameters; torque is that of the primary, as measured.
std::vector<TracePoint> rig_trace(const Rig& rig);
estimator::EstimatorSettings rig_settings(const Rig& rig);

}  // namespace beltgrip::test
