// Noise for tests of what is taken from samples.
#pragma once

#include <cstdint>

namespace beltgrip::diagnose {

// The same noise every time, about normal; one sigma is 1.
class Noise {
 public:
  double operator()() {
    double sum = 0.0;
    for (int i = 0; i < 12; ++i) {
      state_ = state_ * 6364136223846793005ULL + 1442695040888963407ULL;
      sum += static_cast<double>(state_ >> 11U) * 0x1p-53;
    }
    return sum - 6.0;
  }

 private:
  std::uint64_t state_ = 1;
};

}  // namespace beltgrip::diagnose
