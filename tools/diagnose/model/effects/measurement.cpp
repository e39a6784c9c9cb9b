// Effects in the measuring chain: what the bus says differs from what is there.
#include "tools/diagnose/model/effects/effect.h"

namespace beltgrip::diagnose {

namespace {
using Eigen::ArrayXd;

ArrayXd shift_change(const GridSignal& signal, double dt_s, double shift_s) {
  return shifted(signal, dt_s, shift_s) - signal.sharp;
}

void apply_torque_bias(Context& c, const Slot&, double bias_Nm) { c.torque -= bias_Nm; }
// Of the slow copy: dividing the samples themselves would also divide their noise, and the larger
// gain would fit better for that alone.
void apply_torque_gain(Context& c, const Slot&, double gain) {
  take_torque_share(ArrayXd::Constant(c.run.size(), gain / (1.0 + gain)), c);
}
void apply_torque_delay(Context& c, const Slot&, double delay_s) {
  c.torque += shift_change(c.run.torque, c.run.dt_s, delay_s);
}
void apply_pressure_offset(Context& c, const Slot&, double offset_Pa) { c.pressure -= offset_Pa; }
void apply_pressure_gain(Context& c, const Slot&, double gain) {
  c.pressure -= c.run.pressure.slow * gain / (1.0 + gain);
}
void apply_speed_scale_primary(Context& c, const Slot&, double scale) { c.omega_p /= 1.0 + scale; }
void apply_speed_scale_secondary(Context& c, const Slot&, double scale) {
  c.omega_s /= 1.0 + scale;
}

void apply_channel_skew(Context& c, const Slot& slot, double delay_s) {
  const double dt_s = c.run.dt_s;
  if (slot.role == "primary_speed") {
    c.omega_p += shift_change(c.run.omega_p, dt_s, delay_s);
    c.slope_p = shifted_slope(c.run.omega_p, dt_s, delay_s);
  } else if (slot.role == "secondary_speed") {
    c.omega_s += shift_change(c.run.omega_s, dt_s, delay_s);
    c.slope_s = shifted_slope(c.run.omega_s, dt_s, delay_s);
  } else {
    c.pressure += shift_change(c.run.pressure, dt_s, delay_s);
  }
}

// Of the torque it is torque_delay.
void of_each_channel(const Carried&, const AddSlot& add) {
  for (const std::string_view role : {"primary_speed", "secondary_speed", "secondary_pressure"}) {
    add(0, role);
  }
}

constexpr Equation kMeasurementEquations[] = {
    {"torque_bias", "bias_Nm", apply_torque_bias},
    {"torque_gain", "gain", apply_torque_gain},
    {"torque_delay", "delay_s", apply_torque_delay},
    {"pressure_offset", "offset_Pa", apply_pressure_offset},
    {"pressure_gain", "gain", apply_pressure_gain},
    {"speed_scale", "primary", apply_speed_scale_primary},
    {"speed_scale", "secondary", apply_speed_scale_secondary},
    {"channel_skew", "delay_s", apply_channel_skew, of_each_channel},
    {"speed_ripple", "primary", nullptr},
    {"speed_ripple", "secondary", nullptr},
};

}  // namespace

std::span<const Equation> measurement_equations() { return kMeasurementEquations; }

}  // namespace beltgrip::diagnose
