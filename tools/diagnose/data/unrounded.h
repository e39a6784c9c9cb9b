// A channel that moves in steps, without what is known of their rounding.
//
// Of a rounded sample x it is known that it lay within half a step of x. Where the channel moves
// slowly, rounding is no noise: it is off by a saw tooth as long as the time between two steps,
// which no mean takes out and which is told from a lag or from another friction by nothing but that
// it comes back. But the instant at which a step is crossed, and the shares of two values that
// noise mixes, tell where the channel was. So the course m is found that is most probable given
// the intervals, q being the step and s the noise before the rounding:
//   max  sum_i ln( Phi((x_i + q/2 - m_i) / s) - Phi((x_i - q/2 - m_i) / s) ) + sum_k ln p(bend of
//   m)
// Bends are second differences between nodes; by Student's t, so that a line costs nothing and a
// corner little. Where it stays on one step for long it is held there. Of a sample the mean error
// of what is rounded there is taken, and as much of its noise as rounding has added: it stays as
// noisy as it was before, so that what is fitted to it is told by no less noise than the sensor
// has.
#pragma once

#include <span>

#include "tools/diagnose/data/signal_table.h"

namespace beltgrip::diagnose {

// step: between two values that are neighbours in the rounding. noise: one sigma before it, in
// steps.
Channel unrounded(const Channel& channel, double step, double noise);

// The noise, in steps, that is most probable beside the courses of these channels of one sensor: by
// how wide it makes the crossing from one value to the next. Where nothing moves across, none is
// told from another by much.
double noise_before_rounding(std::span<const Channel* const> channels, double step);

}  // namespace beltgrip::diagnose
