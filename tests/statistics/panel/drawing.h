// The drawing of the panel: what a seed says. Written from the interface documents alone, without
// the estimator.
#pragma once

#include <cstdint>

#include "scenario.h"

namespace beltgrip::panel {

class Random;

inline constexpr double kPeakFrom_percent = 0.8, kPeakTo_percent = 8.0;
inline constexpr double kLeastFall_per_percent = 2e-4, kMostFall_per_percent = 12e-3;

FrictionCurve draw_curve(Random& random);
// A trace of the panel; the seed says all.
Scenario draw_scenario(std::uint64_t seed);
// The paper's experiment: 105 rad/s, 50 Nm, -26 N/s, overdrive; a rise to 0.105 or 0.100 at about
// 2 % and a linear fall, lab noise.
Scenario paper_scenario(std::uint64_t seed, double mu_max);
void set_noise(Scenario& scenario, NoiseClass noise);
// Draws constant sensor errors with the widths that a careful user would configure.
void plant_sensor_errors(Scenario& scenario);
// Draws when and how much.
void plant_disturbance(Scenario& scenario, Disturbance disturbance);

}  // namespace beltgrip::panel
