// How the noise of the slip and that of the torque weigh against each other. Where one is taken for
// more than it is, samples count too little where it stands in the residual, and a hypothesis whose
// friction curve puts more of them there fits better for that alone.
#pragma once

#include <vector>

#include "tools/diagnose/infer/residuals.h"

namespace beltgrip::diagnose {

// What the noise of a residual is at one sample: in units of what it should be, and which share of
// that is the slip's.
struct NoiseSample {
  double slip_share = 0.0;
  double noise = 0.0;
};
// Variances over what they should be, the larger of both 1.
struct NoiseFactors {
  double slip = 1.0, torque = 1.0;
};
NoiseFactors noise_factors(std::vector<NoiseSample> samples);

// Of both noises that which is taken for more than it is, by what the friction's residual says at
// this state, counts for what it is. That of the slip for no less than the rounding of the speeds:
// what rests on a step differs from its neighbours by nothing, and from the truth all the same. (A
// torque or a pressure that rests counts by itself, Whitening::Rest.)
void balance_noise(const ModelState& state, Campaign& campaign);

}  // namespace beltgrip::diagnose
