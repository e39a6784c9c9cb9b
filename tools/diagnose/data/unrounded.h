// A channel that moves in steps, without what is known of their rounding.
//
// Of a rounded sample x it is known that it lay within half a step of x. Where the channel moves
// slowly, rounding is no noise: it is off by a saw tooth as long as the time between two steps,
// which no mean takes out and which is told from a lag or from another friction by nothing but that
// it comes back. But the instant at which a step is crossed, and the shares of two values that
// noise mixes, tell where the channel was. So the course m is found that is most probable given
// the intervals, q being the step and s the noise before the rounding, which is found with it:
//   max  sum_i ln( Phi((x_i + q/2 - m_i) / s) - Phi((x_i - q/2 - m_i) / s) ) + sum_k ln p(bend of
//   m)
// Bends are second differences between nodes; by Student's t, so that a line costs nothing and a
// corner little. Of a sample the mean error of what is rounded there is taken, and as much of its
// noise as rounding has added: it stays as noisy as it was before, so that what is fitted to it
// is told by no less noise than the sensor has.
#pragma once

#include "tools/diagnose/data/signal_table.h"

namespace beltgrip::diagnose {

// step: between two values that are neighbours in the rounding.
Channel unrounded(const Channel& channel, double step);

}  // namespace beltgrip::diagnose
