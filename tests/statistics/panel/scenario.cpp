#include "scenario.h"

#include <cmath>
#include <cstdio>

namespace beltgrip::panel {

const char* noise_name(NoiseClass noise) {
  constexpr const char* kNames[] = {"lab", "production", "harsh"};
  return kNames[static_cast<int>(noise)];
}

const char* plant_name(PlantKind plant) {
  constexpr const char* kNames[] = {"rig", "rig-heavy", "car-sensor", "car-engine"};
  return kNames[static_cast<int>(plant)];
}

const char* disturbance_name(Disturbance disturbance) {
  constexpr const char* kNames[kDisturbances] = {"none", "friction", "ratio", "torque", "rattle"};
  return kNames[static_cast<int>(disturbance)];
}

Point point_of(const Scenario& s) {
  return {s.low ? s.variator.primary_radius_low_m : s.variator.primary_radius_overdrive_m,
          s.low ? s.variator.ratio_low : s.variator.ratio_overdrive, s.overrun ? -1.0 : 1.0,
          std::cos(s.variator.half_wedge_angle_rad)};
}

std::string describe(const Scenario& s) {
  char text[300];
  std::snprintf(text, sizeof text,
                "%llu %s mu=%.4f pk=%.2f fall=%.2e shape=%.2f %s %s %s %s T=%.0f wp=%.0f ramp=%.0f "
                "def=%.2e J=%.2f start=%.3f floor=%.3f hold=%.1f fr=%g/%g/%g/%g",
                static_cast<unsigned long long>(s.seed), family_name(s.curve.family()),
                s.curve.mu_max(), s.curve.slip_peak_percent(), s.curve.fall_per_percent(),
                s.curve.shape(), s.overrun ? "overrun" : "drive", s.low ? "low" : "od",
                plant_name(s.plant), noise_name(s.noise), s.torque_Nm, s.omega_p_rad_s,
                s.ramp_N_per_s, s.deformation_per_N, s.secondary_inertia,
                s.mu_start / s.curve.mu_max(), s.mu_floor / s.curve.mu_max(), s.hold_s,
                s.omega_p.frame_rate_hz, s.omega_s.frame_rate_hz, s.pressure.frame_rate_hz,
                s.torque.frame_rate_hz);
  return text;
}

}  // namespace beltgrip::panel
