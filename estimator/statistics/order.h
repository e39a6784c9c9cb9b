// Values by their rank. Pure functions, any thread; they change the order of what they are given.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>

namespace beltgrip::estimator {

// Standard deviation of normal noise over the median of its magnitudes.
inline constexpr double kSigmaPerMedian = 1.4826;

// The one that has `rank` smaller ones before it; rank < values.size().
inline double at_rank(std::span<double> values, std::size_t rank) noexcept {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(rank);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

// Of an even number the upper one of the two in the middle. Not empty.
inline double median(std::span<double> values) noexcept {
  return at_rank(values, values.size() / 2);
}

}  // namespace beltgrip::estimator
