// How sure an interval is: every interval that leaves the estimator is one of 95 %.
#pragma once

namespace beltgrip::estimator {

inline constexpr double kTail95 = 0.025;                // left out at either end
inline constexpr double kUpper95 = 1.0 - kTail95;       // where the upper end lies
inline constexpr double kNormal95 = 1.959963984540054;  // half width in standard deviations
// Derived: the one-sided 99 % quantile, to three digits. A lower bound rests on it. A fifth smaller
// or larger moves 12 of 180 bounds by 0.2 % and more (tests/vary, as a number of
// robust/thresholds.h).
inline constexpr double kNormal99Upper = 2.33;

}  // namespace beltgrip::estimator
