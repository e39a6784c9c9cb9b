// Shares and percentiles of the panel's tables.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

namespace beltgrip::panel {

inline double percentile(std::vector<double> values, double share) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto last = static_cast<double>(values.size() - 1);
  const auto k = static_cast<std::ptrdiff_t>(std::round(share * last));
  std::nth_element(values.begin(), values.begin() + k, values.end());
  return values[static_cast<std::size_t>(k)];
}

inline double share(int part, int whole) { return whole > 0 ? 100.0 * part / whole : 0.0; }

}  // namespace beltgrip::panel
