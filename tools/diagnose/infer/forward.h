// The simulation run forward: the variator integrated over one experiment, driven by what drives
// the machine, for the reader's eye and for the gain. No name rests on it: near its peak friction
// hardly resists, and beyond it a departure of a percent changes a whole run-away.
//   rig:     J_s d(omega_s)/dt = T_belt / r_g - T_s   by omega_p, pressures, T_s (without that
//            role: what the torque before the belt leaves for it)
//   vehicle: J_p d(omega_p)/dt = T_e - loss - T_belt   by T_e, omega_s, pressures
// All else, effects included, is evaluate()'s.
#pragma once

#include <string_view>
#include <vector>

#include "tools/diagnose/infer/residuals.h"

namespace beltgrip::diagnose {

// One predicted signal on the experiment's grid, as its sensor reads it.
struct ForwardSignal {
  std::string_view name;  // the role; "slip": share, by the configured ratio of the end stop
  Eigen::ArrayXd measured, simulated;
};

struct Forward {
  std::vector<ForwardSignal> signals;  // empty: nothing usable
  // Simulated here: both the simulated and the measured belt grip (slip below that at the peak). It
  // ends at the peak and begins anew, at rest on the curve, where both grip again.
  std::vector<bool> grips;
};

Forward run_forward(const Campaign& campaign, int run, const ModelState& state);

}  // namespace beltgrip::diagnose
