// The constants by which the robust method decides. Each with its unit and its origin: derived
// (from what), measured (by which command) or chosen (why).
#pragma once

namespace beltgrip::estimator {

// What a curve may still rise by beyond the data, as a share of its elasticity there. Derived: at
// most 1 for the tail of a power law, at most 1/2 for an exponential one. Measured
// (beltgrip_panel --first 10001 --traces 500 --robust-only): with 0, 0.3 and 0.6 there are 27, 22
// and 16 values where friction rises on, of which 21, 8 and 5 miss the truth; 0.6 costs 2 % of the
// values that are right.
inline constexpr double kRiseShare = 0.3;
// One-sided 95 % of that elasticity, in deviations.
inline constexpr double kRiseDeviations = 1.64;
// The further rise where the slope at the end cannot be told, as a share of mu. Chosen: the widest
// half of an interval that is a value by default.
inline constexpr double kUnknownRise = 0.05;
// Probability that the curve turns down within the data above which it does not rise further.
// Chosen: even odds.
inline constexpr double kTurnedDown = 0.5;

// Stretch of slip over which the slope at the end is taken: so many percent, or this share of the
// slip. Chosen: long enough for the noise of a car, short beside the rise.
inline constexpr double kEndLeast_percent = 0.5;
inline constexpr double kEndShare = 0.3;

}  // namespace beltgrip::estimator
