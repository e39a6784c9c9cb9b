// The figure by which a gain is to be seen.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "tools/diagnose/data/diagnosis.h"
#include "tools/diagnose/infer/gain.h"

namespace beltgrip::diagnose {

BeforeAfter change_of(const MuMaxError& error);

// What a cause is to be seen by: mu_max, or the signal that shows it; else what there is.
struct Shown {
  std::string metric;
  BeforeAfter change;
};
// acts_on: as in the contract (friction, clamp_force, torque, torque_gain, ratio). None: no gain.
std::optional<Shown> shown_by(const Gain& gain, std::string_view acts_on);

}  // namespace beltgrip::diagnose
