// Effects in the measuring chain: what the bus says differs from what is there.
#pragma once

#include "tools/diagnose/model/effects/effect.h"

namespace beltgrip::diagnose {
void apply_torque_bias(Context& c, const Slot& slot, double bias_Nm);
void apply_torque_gain(Context& c, const Slot& slot, double gain);
void apply_torque_delay(Context& c, const Slot& slot, double delay_s);
void apply_pressure_offset(Context& c, const Slot& slot, double offset_Pa);
void apply_pressure_gain(Context& c, const Slot& slot, double gain);
void apply_speed_scale_primary(Context& c, const Slot& slot, double scale);
void apply_speed_scale_secondary(Context& c, const Slot& slot, double scale);
void apply_channel_skew(Context& c, const Slot& slot, double delay_s);
}  // namespace beltgrip::diagnose
