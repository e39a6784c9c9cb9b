#include "tools/diagnose/run/shown_gain.h"

namespace beltgrip::diagnose {

BeforeAfter change_of(const MuMaxError& error) {
  return {error.before, error.after, error.low, error.high};
}

std::optional<Shown> shown_by(const Gain& gain, std::string_view acts_on) {
  const bool is_friction = acts_on == "friction" || acts_on == "clamp_force";
  if (is_friction && gain.mu_max) return Shown{"mu_max", change_of(*gain.mu_max)};
  const bool is_torque = acts_on == "torque" || acts_on == "torque_gain";
  const auto shown = gain.signals.find(is_torque ? "secondary_torque" : "secondary_speed");
  const auto used = shown != gain.signals.end() ? shown : gain.signals.begin();
  if (used == gain.signals.end()) return {};
  return Shown{used->first, used->second};
}

}  // namespace beltgrip::diagnose
