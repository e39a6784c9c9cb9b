// What is possible at best on one trace, for the table.
#pragma once

#include <array>
#include <cstddef>

#include "virtual_variator.h"

namespace beltgrip::panel {

// Cramer-Rao bound for the relative standard deviation of mu_max from the data up to stop_s: an
// efficient fit that is told the family of the curve, sees torque, slip and pressure frame by frame
// (rounding counted as white noise) and knows that the clamp force runs straight; unknown are the
// curve's parameters, the deformation and the force's line. 0 where there is no peak.
double mu_max_bound(const Scenario& scenario, const Trace& trace, double stop_s);

// The same for the largest mu* up to stop_s, where the slip is told without noise.
double reached_bound(const Scenario& scenario, const Trace& trace, double stop_s);

inline constexpr std::size_t kPastSteps = 401;
inline constexpr double kPastStep_percent = 0.05;

// What no detector can beat that stops early, before mu* has come within half a percent of its
// top, on at most one in a hundred traces of any curve of the family: it is told the family, slip,
// force, load and inertia, and sees the belt's torque (with an engine: the speed) with its noise.
// By the lemma of Neyman and Pearson it has stopped with at most this probability by the time that
// the data tell the curve so far from the likest of its family whose top lies further on.
struct DetectionBound {
  double delay_s = 0.0;  // after the peak, median
  // Probability to have stopped when slip is i kPastStep_percent past the peak (a flat top's end).
  std::array<double, kPastSteps> stopped{};
};
DetectionBound detection_bound(const Scenario& scenario, const Trace& trace);

}  // namespace beltgrip::panel
