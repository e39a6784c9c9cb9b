// The constants by which the robust method decides. Each with its unit and its origin: derived
// (from what), measured (by which command) or chosen (why).
#pragma once

namespace beltgrip::estimator {

// Maximum friction is the largest up to this slip, percent. Given: what a value is held against
// where friction rises on; no belt is driven further.
inline constexpr double kFrictionTo_percent = 10.0;
// One-sided 95 % of the slope at the end of the data, in deviations.
inline constexpr double kRiseDeviations = 1.64;
// The further rise where the slope at the end cannot be told, as a share of mu. Chosen: the widest
// half of an interval that is a value by default.
inline constexpr double kUnknownRise = 0.05;

// One-sided 99 % of what a lower bound rests on, in deviations. Derived: a normal quantile.
inline constexpr double kBoundDeviations = 2.33;

// Stretch of slip over which the slope at the end is taken: so many percent, or this share of the
// slip. Chosen: long enough for the noise of a car, short beside the rise.
inline constexpr double kEndLeast_percent = 0.5;
inline constexpr double kEndShare = 0.3;

// Where a backup stop ended it, a value needs a curve that was followed up from below this share of
// its top. Chosen: one that begins nearer may have slipped over its top before. Measured
// (worn_belt_test): a worn belt that slips at once read 13 % too low without it, at 0.87 of its
// top.
inline constexpr double kRisenFrom = 0.9;

}  // namespace beltgrip::estimator
