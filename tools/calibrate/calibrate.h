// What a recorded drive says of the constants in the configuration, with how well it says it, or
// why it does not: the speed ratio at the end stops, the zero of the pressure, the inertia between
// engine and belt, delays between channels. Pure functions on signal tables, SI. Tools only.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "daemon/core/config/options/config.h"
#include "tools/diagnose/data/signal_table.h"

namespace beltgrip::calibrate {

struct Finding {
  std::string key;              // of the configuration, or a name where there is no such key
  std::optional<double> value;  // nothing: refused
  double std = 0.0;             // half the width of the 95 % interval over kNormal95
  double configured = 0.0;
  std::string unit;
  std::string text;  // what it rests on, or why it is refused
};

// End stops: cells of 0.5 s near the configured ratio in which the ratio stands still are fitted by
//   ln r_s = ln r_g0 - c F - b mu* - d (omega'/omega)
// (variator-facts 3.3: the ratio falls with the clamping force F; creep with the traction in use;
// a delay d of the secondary speed). r_g0 is the ratio at zero force. c and b have wide priors, so
// that a drive under one clamping force says how little it knows.
struct PressureError {  // of what the logs say, Pa
  double zero = 0.0;
  double std = 0.0;
};
std::vector<Finding> end_stops(std::span<const diagnose::SignalTable> logs,
                               const daemon::Config& config, PressureError pressure);

// Pressure where engine and pulleys stand still: what it reads is its offset.
Finding pressure_zero(std::span<const diagnose::SignalTable> logs);

// Steps of the engine torque (fuel cut and its end): over each, with its own constant and slope for
// the load,
//   T_engine(t + delay) = J omega_p' + r (M omega_s' + c_0 + c_1 t)
// with J and M common to all. J is what the configuration calls primary_inertia_kg_m2; the
// vehicle's inertia M is told from it by different ratios, or by a ratio that moves.
std::vector<Finding> inertia(std::span<const diagnose::SignalTable> logs,
                             const daemon::Config& config);

// All of them.
std::vector<Finding> calibrate(std::span<const diagnose::SignalTable> logs,
                               const daemon::Config& config);

}  // namespace beltgrip::calibrate
