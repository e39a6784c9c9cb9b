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
// most_Hz: nothing is asked for above.
PooledSpectrum pooled_spectrum(const Channel& channel, double most_Hz);
// Of a channel as it is. Not varied.
inline constexpr double kChannelMost_Hz = 40.0;
// Chosen: of a shaft that swings, and what lies about it. A fifth less or more: the same verdicts
// of the sets named at kSwingLowest_Hz.
inline constexpr double kSwingMost_Hz = 14.0;

struct NarrowLine {
  double frequency_Hz = 0.0;
  double over_level = 0.0;  // power over that of the noise about it
  double share = 0.0;       // of all power above the slow courses
};
// The strongest; none of pieces too few to tell.
NarrowLine narrow_line(const PooledSpectrum& spectrum);

// The same of a shaft that swings at its own frequency: noise moves it, so that it is no line but a
// hump, half a Hz wide.
struct Hump {
  double frequency_Hz = 0.0;
  double excess = 0.0;  // over the higher one of the levels on either side, sigmas
  double share = 0.0;   // of the power from the lowest frequency that it is looked for at
};
Hump strongest_hump(const PooledSpectrum& spectrum);
// The one about a step of the spectrum; none where there is nothing to tell it from.
Hump hump_at(const PooledSpectrum& spectrum, std::size_t bin);
// Of three steps.
double power_about(const PooledSpectrum& spectrum, std::size_t bin);

}  // namespace beltgrip::diagnose
