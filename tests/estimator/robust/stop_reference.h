// The stop of the robust method a second time, from the equations above StopDetector: plain sums
// and general least squares, every window from nothing at every look, no tables.
#pragma once

#include <array>
#include <cstddef>

#include "estimator/method/stop_reason.h"
#include "estimator/record/experiment_record.h"

namespace beltgrip::test {

class StopReference {
 public:
  StopReference(double traction_per_Nm_N, double inertia_kg_m2)
      : c_(traction_per_Nm_N), inertia_kg_m2_(inertia_kg_m2) {}
  // After each cell of the record.
  estimator::StopReason step(const estimator::ExperimentRecord& record);
  double slope() const { return slope_; }
  bool level() const { return level_; }
  bool rising() const { return seen_ && !level_; }
  double smallest_slip_percent() const { return smallest_slip_percent_; }

 private:
  struct Look {
    bool counts = false;
    double gained_percent = 0.0, slip_percent = 0.0, duration_s = 0.0;
    double k = 0.0, k_deviation = 0.0, hold = 0.0, hold_deviation = 0.0, level = 0.0;
  };
  Look look(const estimator::ExperimentRecord& record, double window_s) const;
  estimator::StopReason backup(const estimator::ExperimentRecord& record) const;
  void follow_smallest_slip(const estimator::ExperimentRecord& record);

  double c_, inertia_kg_m2_;
  std::size_t looks_ = 0;
  double smallest_slip_percent_ = 1e9;
  double slope_ = 0.0;
  bool seen_ = false, level_ = false;
  double level_from_percent_ = 0.0, level_until_s_ = 0.0;
};

}  // namespace beltgrip::test
