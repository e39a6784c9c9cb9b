// The constants by which the robust method decides. Each with its unit and its origin: derived
// (from what), measured (by which command) or chosen (why).
#pragma once

namespace beltgrip::estimator {

// Maximum friction is the largest up to this slip, percent. Given: what a value is held against
// where friction rises on; no belt is driven further.
inline constexpr double kFrictionTo_percent = 10.0;
// Root mean square of the slope, as a share of mu per percent, by which friction that was not seen
// to turn down rises on beyond the data, whatever its slope at their end is. Measured on 4,800
// traces of other make (estimator/ACCURACY.md): values on 97.8 / 97.3 / 77.6 % of the peaks, lab /
// production / harsh, and 4.4 / 7.8 / 7.7 % of those where friction rises on miss; a fifth less
// 98.0 / 97.8 / 79.3 and 5.5 / 10.0 / 9.2 %; a fifth more 97.7 / 96.0 / 75.6 and 3.6 / 6.8 / 6.5 %.
inline constexpr double kUnseenRise = 0.007;

// One-sided 99 % of what a lower bound rests on, in deviations. Derived: a normal quantile.
inline constexpr double kBoundDeviations = 2.33;

// Where a backup stop ended it, a value needs a curve that was followed up from below this share of
// its top. Chosen: one that begins nearer may have slipped over its top before. Measured
// (worn_belt_test): a worn belt that slips at once read 13 % too low without it, at 0.87 of its
// top.
inline constexpr double kRisenFrom = 0.9;

}  // namespace beltgrip::estimator
