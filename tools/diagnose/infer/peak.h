// The peak of a fitted friction curve: the highest point of what the data cover, wherever on the
// curve's own abscissa it lies.
#pragma once

#include "tools/diagnose/infer/engine.h"

namespace beltgrip::diagnose {

// One sigma of what the fitted form leaves out of the height and the place of a peak, of their
// logarithms. Measured: rms beyond the fit's own sigma in 50 healthy campaigns of five foreign
// forms, whose runs end at 1.1 to 1.35 of the slip at the peak.
inline constexpr double kMuForm = 0.008, kSlipForm = 0.25;
// The same where the runs end before the peak, of what the friction still grows by. Chosen; a car's
// healthy campaign where that is an eighth is off by a tenth.
inline constexpr double kBeyondForm = 0.5;

struct FittedPeak {
  double ln_mu = 0.0, ln_mu_sigma = 0.0;
  double ln_slip = 0.0, ln_slip_sigma = 0.0;
};

// Of an end stop that the engine's experiments use; the hypothesis with its covariance.
FittedPeak fitted_peak(const Engine& engine, const Hypothesis& hypothesis, int stop);
bool uses_stop(const Engine& engine, int stop);

}  // namespace beltgrip::diagnose
