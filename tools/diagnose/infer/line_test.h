// Lines in the spectrum of the residuals that many experiments share: a ripple, a resonance.
#pragma once

#include <string>

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

}  // namespace beltgrip::diagnose
