// What friction a metal belt can have at all: the one range that results and readings are held
// against. Pure functions, any thread.
//
// Metal on metal in oil carries 0.06 to 0.14. A third less than that, or nearly twice as much, no
// belt in order or out of it has; a pressure or a torque in the wrong unit does.
#pragma once

#include "estimator/slip_curve_estimator.h"

namespace beltgrip::estimator {

inline constexpr double kMuLeast = 0.04;
inline constexpr double kMuMost = 0.25;
// A reading goes beyond that by noise; by so much it does not for long.
inline constexpr double kMuReadMost = 0.4;

inline bool is_possible(double mu) noexcept { return mu >= kMuLeast && mu <= kMuMost; }

// A value outside the range, or a lower bound above it, becomes no result. A bound below the range
// is little said, but not wrong.
inline void refuse_impossible(PeakEstimate& peak) noexcept {
  const bool low_bound = peak.kind == PeakKind::kLowerBound && peak.mu_max < kMuLeast;
  if (peak.kind == PeakKind::kNone || is_possible(peak.mu_max) || low_bound) return;
  peak = {.samples = peak.samples};
  peak.impossible = true;
}

}  // namespace beltgrip::estimator
