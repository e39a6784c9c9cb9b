// How a channel is rounded, from all experiments with the same sensor: one that holds it tells
// nothing of its steps.
#pragma once

#include <array>
#include <span>

#include "tools/diagnose/data/signal_table.h"

namespace beltgrip::diagnose {

struct Rounding {
  double step = 0.0;   // between neighbours, in the channel's unit; 0: it never moves
  bool rests = false;  // no noise carries it from one to the next
  // Where it rests and is asked for: one sigma of the noise before the rounding, in steps.
  double noise = 0.0;
};
using Roundings = std::array<Rounding, daemon::kRoleCount>;

// What all experiments with the same sensors say of them. The noise is that of the secondary
// pressure alone.
struct Sensors {
  Reaches reached{};
  Roundings roundings{};
};
Sensors sensors_of(std::span<const SignalTable* const> tables);

// How a channel's samples repeat the one before: on its bounds and elsewhere.
struct Repeats {
  struct Share {
    double samples = 0.0, repeats = 0.0;
    double share() const { return samples > 0.0 ? repeats / samples : 0.0; }
  } on_low, on_high, elsewhere;
  void add(const Channel& channel, const Reach& reach);
};

// One sigma of what no averaging removes, in the channel's unit: there the samples repeat their
// neighbours.
double held_rounding(const Channel& channel, const Rounding& rounding);
// The same of its mean size.
double held_rounding_share(const Channel& channel, const Rounding& rounding);

}  // namespace beltgrip::diagnose
