// By how much experiments differ from each other, and by how much those that repeat each other do.
#pragma once

#include <vector>

#include "tools/diagnose/infer/engine.h"

namespace beltgrip::diagnose {

// Per experiment the group of those that repeat it: same end stop, speed, torque, temperature and
// course of the clamp force. -1: it stands alone, or has no valid samples.
std::vector<int> replicate_groups(const Campaign& campaign);

struct ScatterBase {
  Scatter scatter;               // to be expected
  bool from_replicates = false;  // else what rigs usually scatter by
  double degrees = 0.0;          // of freedom that tell it, the usual scatter's among them
};
ScatterBase scatter_base(const Engine& engine);

// What the experiments scatter by at the engine's state over that base, standard deviations; level
// of friction, seat of the ratio, zero of the torque.
struct ScatterRatios {
  double friction = 0.0, ratio = 0.0, torque = 0.0;
};
ScatterRatios scatter_ratios(const Engine& engine, const Scatter& base);

}  // namespace beltgrip::diagnose
