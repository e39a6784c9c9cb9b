// Points of the friction curve for the reference of the fit (peak_reference.h): every mean summed
// from nothing.
#pragma once

#include <vector>

#include "estimator/record/experiment_record.h"

namespace beltgrip::test {

// Means over a stretch of time, and what is known of their errors.
struct ReferencePoint {
  double t_s = 0.0, duration_s = 0.0, slip_percent = 0.0, force_N = 0.0, torque_Nm = 0.0;
  double mu = 0.0, variance = 0.0, force_variance = 0.0, held_share = 0.0;
  double torque_variance = 0.0;           // without that of the speeds
  double speed_variance[2] = {0.0, 0.0};  // at its begin and its end
  double begin_s() const { return t_s - 0.5 * duration_s; }
  double end_s() const { return t_s + 0.5 * duration_s; }
};

// The oldest first; none where too little is recorded or the force has no line yet.
std::vector<ReferencePoint> reference_points(const estimator::ExperimentRecord& record,
                                             double traction_per_Nm_N, double inertia_kg_m2);

}  // namespace beltgrip::test
