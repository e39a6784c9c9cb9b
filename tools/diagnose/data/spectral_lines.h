// Narrow lines in a channel's own samples, up to half its rate: a shaft that swings, a pump. The
// grid of the residuals keeps nothing above a few Hz.
#pragma once

#include <vector>

#include "tools/diagnose/data/signal_table.h"

namespace beltgrip::diagnose {

// Power over frequency, summed over pieces of a few seconds; those of several experiments add up.
struct PooledSpectrum {
  static constexpr double kStep_Hz = 0.25;
  std::vector<double> power;  // from zero on, every kStep_Hz
  int pieces = 0;
  void add(const PooledSpectrum& other);
};
PooledSpectrum pooled_spectrum(const Channel& channel);

struct NarrowLine {
  double frequency_Hz = 0.0;
  double over_level = 0.0;  // power over that of the noise about it
  double share = 0.0;       // of all power above the slow courses
};
// The strongest; none of pieces too few to tell.
NarrowLine narrow_line(const PooledSpectrum& spectrum);

}  // namespace beltgrip::diagnose
