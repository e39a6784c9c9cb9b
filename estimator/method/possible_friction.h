// What friction a metal belt can have at all: the one range that results and readings are held
// against. Pure functions, any thread.
//
// Metal on metal in oil carries 0.06 to 0.14. Beyond kBeltLeast to kBeltMost no belt has its peak;
// a pressure or a torque in the wrong unit does, or a constant of the variator that is not its own.
// The curve as it is read under constants that may be assumed is held against a wider range first.
#pragma once

#include "estimator/method/slip_curve_estimator.h"

namespace beltgrip::estimator {

inline constexpr double kBeltLeast = 0.05;
inline constexpr double kBeltMost = 0.15;
inline constexpr double kMuLeast = 0.04;
inline constexpr double kMuMost = 0.25;
// A reading goes beyond that by noise; by so much it does not for long.
inline constexpr double kMuReadMost = 0.4;

inline bool is_possible(double mu, double reach) noexcept {
  return mu >= kMuLeast / reach && mu <= kMuMost * reach;
}

// A value outside the range, or a lower bound above it, becomes no result. A bound below the range
// is little said, but not wrong.
inline void refuse_outside(PeakEstimate& peak, double least, double most) noexcept {
  const bool low_bound = peak.kind == PeakKind::kLowerBound && peak.mu_max < least;
  const bool inside = peak.mu_max >= least && peak.mu_max <= most;
  if (peak.kind == PeakKind::kNone || inside || low_bound) return;
  const double refused = peak.mu_max;
  peak = {.samples = peak.samples};
  peak.impossible = true;
  peak.mu_refused = refused;
}

// As read; reach: EstimatorSettings.reading_reach.
inline void refuse_impossible(PeakEstimate& peak, double reach) noexcept {
  refuse_outside(peak, kMuLeast / reach, kMuMost * reach);
}

// As weighed.
inline void refuse_no_belt(PeakEstimate& peak) noexcept {
  refuse_outside(peak, kBeltLeast, kBeltMost);
}

}  // namespace beltgrip::estimator
