// A swing of the slip: one of the two shafts, or what reads it, moves to and fro and the other does
// not follow. The grid of the residuals keeps nothing above a few Hz.
#pragma once

#include "tools/diagnose/data/signal_table.h"
#include "tools/diagnose/data/spectral_lines.h"

namespace beltgrip::diagnose {

// Of one experiment, or of all together. Empty where the two speeds were not read together.
struct SlipSpectra {
  PooledSpectrum slip, primary_speed, secondary_speed;  // of the speeds' logarithms
  PooledSpectrum pressure;
  void add(const SlipSpectra& other);
};
// Where no shaft turns so that its own ripple would lie, folded back or not, among what is looked
// at: that is a line once per revolution (order_lines.h).
// rounding_share: one sigma of what rounding leaves in the slip where the readings rest
// (ExperimentData); as if all of it were one swing, that much counts as noise everywhere.
SlipSpectra slip_spectra(const SignalTable& table, double rounding_share);

// The strongest swing that nothing recorded drives.
Hump slip_swing(const SlipSpectra& spectra, const PooledSpectrum& torque,
                const PooledSpectrum& secondary_torque);

}  // namespace beltgrip::diagnose
