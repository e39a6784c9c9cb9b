// What a rig with one torque records, made up sample by sample.
#pragma once

#include "tools/diagnose/data/signal_table.h"

namespace beltgrip::diagnose {

struct RigSample {
  double omega_p_rad_s = 0.0, omega_s_rad_s = 0.0, pressure_Pa = 0.0, torque_Nm = 0.0;
};

// at: of the seconds since the first sample.
template <typename At>
SignalTable rig_table(int samples, double period_s, At at) {
  SignalTable out;
  for (int i = 0; i < samples; ++i) {
    const double t_s = period_s * i;
    const RigSample here = at(t_s);
    const auto add = [&](daemon::Role role, double value) {
      out[role].t_s.push_back(t_s);
      out[role].value.push_back(value);
    };
    add(daemon::Role::kPrimarySpeed, here.omega_p_rad_s);
    add(daemon::Role::kSecondarySpeed, here.omega_s_rad_s);
    add(daemon::Role::kSecondaryPressure, here.pressure_Pa);
    add(daemon::Role::kPrimaryTorque, here.torque_Nm);
  }
  return out;
}

}  // namespace beltgrip::diagnose
