// What an experiment that has ended leaves to be evaluated.
#pragma once

#include "daemon/core/base/mono_time.h"
#include "estimator/method/slip_curve_estimator.h"

namespace beltgrip::daemon {

struct EndedExperiment {
  estimator::Direction direction = estimator::Direction::kDrive;
  estimator::EndStop end_stop = estimator::EndStop::kOverdrive;
  Duration duration = Duration::zero();
  bool ramped = true;             // else it was refused: the data hold no peak
  bool passed_a_peak = true;      // its slip is large enough for one, as far as is known
  bool ended_by_slip = false;     // the belt let go
  bool may_have_slipped = false;  // an input was doubted as slip had grown
  double mu_star_most = 0.0;
  double omega_s_start_rad_s = 0.0;
  double omega_s_end_rad_s = 0.0;
  double clamp_force_end_N = 0.0;
};

}  // namespace beltgrip::daemon
