// Random numbers of the simulation: the same on every machine and library, which the standard
// distributions do not promise. One independent stream for each purpose, by name. Simulation only.
#pragma once

#include <cmath>
#include <cstdint>
#include <string_view>

namespace beltgrip::sim {

class Random {
 public:
  Random(std::uint64_t seed, std::string_view purpose) : state_(seed * 0x9E3779B97F4A7C15u) {
    for (const char c : purpose) state_ = mix(state_ ^ static_cast<unsigned char>(c));
  }

  // Uniform in [0, 1), 53 bits (SplitMix64).
  double uniform() {
    state_ += 0x9E3779B97F4A7C15u;
    return static_cast<double>(mix(state_) >> 11) * 0x1p-53;
  }

  // Mean 0, standard deviation 1 (polar method of Marsaglia).
  double normal() {
    if (has_spare_) {
      has_spare_ = false;
      return spare_;
    }
    double x = 0.0, y = 0.0, square = 0.0;
    do {
      x = 2.0 * uniform() - 1.0;
      y = 2.0 * uniform() - 1.0;
      square = x * x + y * y;
    } while (square >= 1.0 || square == 0.0);
    const double factor = std::sqrt(-2.0 * std::log(square) / square);
    spare_ = y * factor;
    has_spare_ = true;
    return x * factor;
  }

 private:
  static std::uint64_t mix(std::uint64_t z) {
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
  }

  std::uint64_t state_;
  double spare_ = 0.0;
  bool has_spare_ = false;
};

}  // namespace beltgrip::sim
