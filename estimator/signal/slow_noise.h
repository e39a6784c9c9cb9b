// The slow part of a channel's noise: an error that wanders (Ornstein-Uhlenbeck) and that readings
// close in time therefore share, however many they are. Pure functions.
#pragma once

#include <span>

namespace beltgrip::estimator {

// With which an error fades that readings share. Chosen: between the time over which frames are
// independent and the time of an experiment's top; recordings do not tell it from 0.6 or 2.4 s.
inline constexpr double kSlowTime_s = 1.2;

// Of a mean over this time, for an error of variance 1.
double slow_variance_of_mean(double length_s) noexcept;
// Covariance of two such means over times that do not overlap, whose middles are this far apart.
double slow_covariance_of_means(double a_s, double b_s, double apart_s) noexcept;
// Variance of the difference of two means of one length that begin `apart_s` after each other, at
// least a length.
double slow_variance_of_step(double length_s, double apart_s) noexcept;

// How second differences of neighbouring means scatter, divided by 6: white noise gives the
// variance of one mean.
struct Scatter {
  double length_s = 0.0;
  double variance = 0.0;
  double count = 0.0;  // of differences
};
// Variance of the slow error that explains what white noise of this density leaves; at least 0.
double slow_variance(std::span<const Scatter> scatter, double white_density) noexcept;

}  // namespace beltgrip::estimator
