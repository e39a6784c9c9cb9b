// The fit of the peak a second time, from the equations above PeakFit: points summed from nothing,
// a full covariance matrix in place of the filter of the slow error, every form by a QR
// decomposition of its own, the top of each by halving the interval in which its slope changes its
// sign.
#pragma once

#include <cstddef>

#include "estimator/record/experiment_record.h"
#include "estimator/robust/peak_fit.h"

namespace beltgrip::test {

struct PeakReference {
  estimator::PeakFitResult fit;
  // What happened on the way.
  std::size_t points = 0, of_stretch = 0, forms = 0;
  double scale = 1.0;       // of chi2
  double innovation = 0.0;  // of the residuals, made free of what they share by its covariance
  double tops_at_the_begin = 0.0;  // weight of the forms that fall over all of the data
};

PeakReference fit_peak(const estimator::ExperimentRecord& record, double traction_per_Nm_N,
                       double inertia_kg_m2, double stop_s);

}  // namespace beltgrip::test
