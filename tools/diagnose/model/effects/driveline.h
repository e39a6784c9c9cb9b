// Effects between shaft and belt, and of the geometry: torque that does not reach the belt, radii
// that are not what the ratio says.
#pragma once

#include "tools/diagnose/model/effects/effect.h"

namespace beltgrip::diagnose {
void apply_inertia_torque(Context& c, const Slot& slot, double inertia_kg_m2);
void apply_loss_constant(Context& c, const Slot& slot, double constant_Nm);
void apply_loss_per_kN(Context& c, const Slot& slot, double per_kN_Nm);
void apply_loss_per_speed(Context& c, const Slot& slot, double per_rad_s_Nm);
void apply_deformation_linear(Context& c, const Slot& slot, double per_kN);
void apply_deformation_quadratic(Context& c, const Slot& slot, double per_kN2);
void apply_radius_tilt(Context& c, const Slot& slot, double per_Nm);
void apply_end_stop_low(Context& c, const Slot& slot, double relative);
void apply_end_stop_overdrive(Context& c, const Slot& slot, double relative);
void apply_ratio_creep(Context& c, const Slot& slot, double rate);
}  // namespace beltgrip::diagnose
