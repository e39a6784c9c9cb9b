// Causes outside the library: any smooth dependence of friction, ratio, torque or clamp force on a
// recorded variable, as three Legendre polynomials each.
#pragma once

#include <string>
#include <vector>

#include "tools/diagnose/decide/namer.h"
#include "tools/diagnose/infer/engine.h"

namespace beltgrip::diagnose {

// Every injection point times every variable, on top of the accepted effects.
std::vector<UnknownGroup> score_groups(const Engine& engine);

}  // namespace beltgrip::diagnose
