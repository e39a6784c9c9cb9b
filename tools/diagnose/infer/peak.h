// The peak of a fitted friction curve: the highest point of what the data cover, wherever on the
// curve's own abscissa it lies.
#pragma once

#include <vector>

#include "tools/diagnose/infer/engine.h"

namespace beltgrip::diagnose {

// One sigma of what the fitted form leaves out of the height and the place of a peak, of their
// logarithms. Measured: rms beyond the fit's own sigma in 50 healthy campaigns of five foreign
// forms, whose runs end at 1.1 to 1.35 of the slip at the peak.
inline constexpr double kMuForm = 0.008, kSlipForm = 0.25;

struct FittedPeak {
  double ln_mu = 0.0, ln_mu_sigma = 0.0;
  double ln_slip = 0.0, ln_slip_sigma = 0.0;
  Eigen::VectorXd height;  // change of ln_mu per column of the fit
};

// What the samples of an end stop say of its curve's peak beside the form.
struct ReachedCurve {
  double end = 0.0;  // how far they go, in units of the curve's abscissa
  // Behind that sample the belt ran away: friction had come to its peak.
  struct RanAway {
    double x = 0.0;
    double rise = 0.0;  // of the logarithm of the friction, at most, from there to its peak
  };
  std::vector<RanAway> run_aways;
};
struct CurveHeight {
  double ln = 0.0, sigma = 0.0;
};
// The highest friction where the samples end below the peak that the form has: no less than they
// reach, no more than ln_peak, and what each run-away says of it. variance_of_one: of the friction
// in one experiment.
CurveHeight height_beyond(const CurveShape& curve, const ReachedCurve& reached, double ln_peak,
                          double variance_of_one);

// Of an end stop that the engine's experiments use; the hypothesis with its covariance.
FittedPeak fitted_peak(const Engine& engine, const Hypothesis& hypothesis, int stop);
bool uses_stop(const Engine& engine, int stop);

}  // namespace beltgrip::diagnose
