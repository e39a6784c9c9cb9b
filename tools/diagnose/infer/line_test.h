// Lines in the spectrum of the residuals that many experiments share: a ripple, a resonance.
#pragma once

#include <string>
#include <vector>

#include "tools/diagnose/infer/engine.h"

namespace beltgrip::diagnose {

struct SpectralLine {
  std::string acts_on;  // friction, torque
  double frequency_Hz = 0.0;
  double excess = 0.0;  // of the pooled ordinate over the noise's, in its sigmas
  double share = 0.0;   // of the residual's power
};
// The strongest one at the state; no frequency: too short.
SpectralLine strongest_line(const Campaign& campaign, const ModelState& state);

// Where sums and differences of the frequencies that drive the machine lie, in so many steps of
// 0.025 Hz. A bent curve, of which the model knows the bend only so far, answers there too.
std::vector<bool> driven(const ExperimentData& run, std::size_t bins, double lowest_Hz,
                         double highest_Hz);

}  // namespace beltgrip::diagnose
