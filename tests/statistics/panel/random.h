// Random numbers that are the same on every machine (splitmix64, Box-Muller): the standard
// library's distributions are not.
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

namespace beltgrip::panel {

class Random {
 public:
  // The seed is mixed first: neighbouring seeds would else give the same numbers, one place on.
  explicit Random(std::uint64_t seed) : state_(seed ^ 0x6A09E667F3BCC908ULL) {
    state_ = bits() * 0xD1342543DE82EF95ULL + seed;
  }
  std::uint64_t bits() {
    std::uint64_t z = (state_ += 0x9E3779B97F4A7C15ULL);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
    return z ^ (z >> 31);
  }
  double uniform() { return static_cast<double>(bits() >> 11) * 0x1p-53; }
  double between(double low, double high) { return low + (high - low) * uniform(); }
  double log_between(double low, double high) { return low * std::pow(high / low, uniform()); }
  bool chance(double probability) { return uniform() < probability; }
  int below(int count) { return static_cast<int>(uniform() * count); }
  double normal() {
    if (has_) {
      has_ = false;
      return spare_;
    }
    const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform()));
    const double angle = 2.0 * std::numbers::pi * uniform();
    spare_ = radius * std::sin(angle);
    has_ = true;
    return radius * std::cos(angle);
  }

 private:
  std::uint64_t state_;
  double spare_ = 0.0;
  bool has_ = false;
};

}  // namespace beltgrip::panel
