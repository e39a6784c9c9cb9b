// How much of a swing the rounding of a reading may hide or make up. A torque that swings by less
// than a step is read as one that rests, and a speed that drifts across its steps as one that
// swings.
#pragma once

#include <vector>

#include "tools/diagnose/infer/residuals.h"

namespace beltgrip::diagnose {

// What it does to the residuals of each sample, a reading each: as if all that its rounding is off
// by were one swing. at: moved to the foot.
std::vector<ResidualColumns> rounding_swings(const Campaign& campaign, int run,
                                             const Residuals& at);

}  // namespace beltgrip::diagnose
