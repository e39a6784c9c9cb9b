// Eight ramps of a rig of its own equations in which something swings, and the machine fitted to
// them.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "tests/tools/diagnose/noise.h"
#include "tests/tools/diagnose/rig_table.h"
#include "tools/diagnose/decide/namer.h"

namespace beltgrip::diagnose {

// What swings: shares of the clamp force, unseen by the pressure's sensor, and of the torque, which
// its sensor sees but for its steps.
struct Swings {
  double force_share = 0.0, force_Hz = 0.0;
  double torque_share = 0.0, torque_Hz = 0.0;
  double torque_step_Nm = 0.0;  // 0: finer than its noise
};

// Friction 2x / (1 + x^2); each ramp's swings have phases of their own.
inline SignalTable ramp(const estimator::VariatorParameters& variator, const Swings& swings,
                        int number, Noise& noise) {
  constexpr double kOmega_rad_s = 100.0, kMuMax = 0.1, kPeakSlip_share = 0.02;
  const auto turn = [&](double hertz, double t_s) {
    return 2.0 * std::numbers::pi * hertz * t_s + 2.4 * static_cast<double>(number);
  };
  SignalTable out = rig_table(2600, 0.01, [&](double t_s) {
    const double told_N = 7000.0 - 140.0 * t_s;
    const double force_N =
        told_N * (1.0 + swings.force_share * std::sin(turn(swings.force_Hz, t_s)));
    const double belt_Nm = (number % 2 == 0 ? 50.0 : 44.0) *
                           (1.0 + swings.torque_share * std::cos(turn(swings.torque_Hz, t_s)));
    const double capacity_Nm = 2.0 * variator.primary_radius_overdrive_m * kMuMax * force_N /
                               std::cos(variator.half_wedge_angle_rad);
    const double y = std::min(belt_Nm / capacity_Nm, 1.0);
    const double slip = kPeakSlip_share * (1.0 - std::sqrt(1.0 - y * y)) / y;
    const double ratio = variator.ratio_overdrive * (1.0 - 1e-6 * force_N);
    const double step_Nm = swings.torque_step_Nm;
    const double told_Nm = belt_Nm + 1.0 + 5e-5 * force_N + 0.1 * noise();
    return RigSample{
        .omega_p_rad_s = kOmega_rad_s * (1.0 + 5e-5 * noise()),
        .omega_s_rad_s = kOmega_rad_s * ratio * (1.0 - slip) * (1.0 + 5e-5 * noise()),
        .pressure_Pa =
            (told_N - variator.secondary_spring_force_N) / variator.secondary_piston_area_m2 +
            800.0 * noise(),
        .torque_Nm = step_Nm > 0.0 ? step_Nm * std::round(told_Nm / step_Nm) : told_Nm};
  });
  out.name = "ramp" + std::to_string(number);
  return out;
}

inline Engine fitted(const Swings& swings) {
  const estimator::VariatorParameters variator;
  Noise noise;
  std::vector<ExperimentData> runs;
  for (int number = 0; number < 8; ++number) {
    runs.push_back(prepare(ramp(variator, swings, number, noise), variator));
  }
  Engine engine(make_campaign(std::move(runs), nominal_model(variator)));
  engine.fit_machine();
  engine.update_noise();
  return engine;
}

}  // namespace beltgrip::diagnose
