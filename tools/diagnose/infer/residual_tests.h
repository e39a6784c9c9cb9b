// Which assumptions the residuals of the nominal machine break, with the noise's autocorrelation
// and the scatter between experiments counted.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "tools/diagnose/infer/engine.h"

namespace beltgrip::diagnose {

struct ResidualTest {
  std::string acts_on;  // friction, ratio, torque; clamp force for the pressure's tracking
  std::string name;
  double p = 1.0;        // the chance of a healthy machine (beyond_healthy)
  double decades = 0.0;  // of whiteness: -log10(p)
};

// Of a chi-square what it is beyond those of healthy machines, whose residuals follow a little of
// everything: no equation is theirs to the noise of an hour.
double beyond_healthy(double chi2, int degrees);

// Whiteness of each residual; step of friction, ratio and torque with the direction of the clamp
// force, the sign of the torque and the end stop. Call with the engine's last noise model.
std::vector<ResidualTest> test_residuals(const Engine& engine, const ModelState& nominal);

// By how much each residual wanders slowly within the experiments, rms, in units of what healthy
// experiments scatter by. By kind of residual.
std::array<double, kResidualKinds> wander(const Engine& engine, const ModelState& state);

}  // namespace beltgrip::diagnose
