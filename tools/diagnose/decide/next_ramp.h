// Which ramp to make next: of those that a rig or a car can make, the one that is expected to tell
// most of what is still open. By the linear fits at hand; nothing is simulated but the ramp itself.
#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include "tools/diagnose/infer/engine.h"
#include "tools/diagnose/infer/planned_run.h"

namespace beltgrip::diagnose {

struct NextRamp {
  Ramp ramp;
  // Of tell_apart: the log odds that it is expected to bring against what is not there. Of
  // look_for: by how much the log of the intervals' widths shrinks, weighted.
  double nats = 0.0;
  int slot = -1;  // of look_for: the one it shows most of
};

// Between explanations of the same data that fit as well, each fitted to its end: the expected
// divergence of what they predict, with their constants fitted anew, over all pairs (Box and Hill,
// 1967), by their evidence. The first is the one that is named. Nothing: no ramp tells them apart.
std::optional<NextRamp> tell_apart(const Engine& engine, const std::vector<Hypothesis>& rivals);

// What one may want to see: a slot, and how much its size matters.
struct WantedSlot {
  int slot = 0;
  double weight = 1.0;
};
// Beside the state of the engine. Nothing: no ramp shows any of them.
std::optional<NextRamp> look_for(const Engine& engine, const std::vector<WantedSlot>& wanted);

// Like the first that was made, but for what is varied: the level farthest from those made, by
// ratio or by difference.
enum class Varied { kRepeat, kSpeed, kTorque, kOil, kRate, kEndStop };
// Of the variable that a cause follows, as effects and cells name it.
Varied varied_by(std::string_view depends_on);
Ramp ramp_like_first(const Campaign& campaign, const ModelState& state, Varied varied);
// Experiments made as the first one was, that among them.
int repeats_of_first(const Campaign& campaign);
// Of speed, torque and oil temperature the one that was set to the fewest levels.
Varied least_varied(const Campaign& campaign);

}  // namespace beltgrip::diagnose
