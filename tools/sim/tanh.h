// tanh by one exponential, off by at most 2.3e-16 at any x: the library's, which is right relative
// to a small x too, takes 86 instructions a call. Simulation only.
#pragma once

#include <cmath>

namespace beltgrip::sim {

inline double tanh_of(double x) {
  const double e = std::exp(-2.0 * std::abs(x));
  return std::copysign((1.0 - e) / (1.0 + e), x);
}

}  // namespace beltgrip::sim
