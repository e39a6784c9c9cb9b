// How sure a size is: what noise, disagreement between experiments, the friction curve's unknown
// form and the equations' own accuracy leave open.
#pragma once

#include <vector>

#include "tools/diagnose/infer/engine.h"

namespace beltgrip::diagnose {

struct Uncertainty {
  double sigma = 0.0;
  double degrees = 0.0;    // of freedom, of Student's t
  double stability = 0.0;  // share of the fits without one experiment in which it is there, 95 %
};

// Per slot of the hypothesis, in its order.
std::vector<Uncertainty> uncertainties(const Engine& engine, const Hypothesis& hypothesis);

}  // namespace beltgrip::diagnose
