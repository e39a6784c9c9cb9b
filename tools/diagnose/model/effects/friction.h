// Effects in the friction itself.
#pragma once

#include "tools/diagnose/model/effects/effect.h"

namespace beltgrip::diagnose {
void apply_friction_temperature(Context& c, const Slot& slot, double per_K);
void apply_friction_speed(Context& c, const Slot& slot, double per_ln_speed);
void apply_friction_load(Context& c, const Slot& slot, double exponent);
void apply_friction_ratio(Context& c, const Slot& slot, double relative);
void apply_peak_slip(Context& c, const Slot& slot, double relative);
void apply_fall(Context& c, const Slot& slot, double per_peak_slip);
void apply_wear_step(Context& c, const Slot& slot, double step);
void apply_wear_gradual(Context& c, const Slot& slot, double per_experiment);
void apply_warm_up_energy(Context& c, const Slot& slot, double per_kJ);
void apply_warm_up_time(Context& c, const Slot& slot, double per_start);
}  // namespace beltgrip::diagnose
