// Conversions and names of numbers used throughout the estimator. SI inside; slip alone is in
// percent, because the paper's thresholds only make sense so.
#pragma once

namespace beltgrip::estimator {

inline constexpr double kPercent = 100.0;  // percent per unit
inline constexpr double kNanosecond_s = 1e-9;

}  // namespace beltgrip::estimator
