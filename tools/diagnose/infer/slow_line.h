// A line below those of line_test.h. There the friction curve, ramps and sweeps leave slow courses
// of their own, whose spectrum falls with frequency: what stands out is asked of the whitened
// residuals, with the scatter between experiments taken out.
#pragma once

#include "tools/diagnose/infer/line_test.h"

namespace beltgrip::diagnose {

// The strongest at the engine's state, from 0.2 to 0.7 Hz; each experiment has a phase of its own.
SpectralLine slow_line(const Engine& engine);

}  // namespace beltgrip::diagnose
