// Effects between the measured pressure and the force that clamps the belt.
#pragma once

#include "tools/diagnose/model/effects/effect.h"

namespace beltgrip::diagnose {
void apply_hydraulic_lag(Context& c, const Slot& slot, double time_constant_s);
void apply_hydraulic_delay(Context& c, const Slot& slot, double delay_s);
void apply_centrifugal_force(Context& c, const Slot& slot, double coefficient_N_s2);
void apply_spring_force(Context& c, const Slot& slot, double force_N);
void apply_clamp_hysteresis(Context& c, const Slot& slot, double force_N);
}  // namespace beltgrip::diagnose
