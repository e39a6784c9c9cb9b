#include "tools/diagnose/report/finding_words.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>

#include "estimator/physics/machine_effects.h"

namespace beltgrip::diagnose {
namespace {

struct Words {
  std::string_view effect, parameter, words;
};
constexpr Words kWords[] = {
    {"torque_bias", "bias_Nm", "a measured torque that is too high by"},
    {"torque_gain", "gain", "a measured torque that is too high by the share"},
    {"inertia_torque", "inertia_kg_m2", "an inertia before the belt beyond the configured one"},
    {"torque_delay", "delay_s", "a torque that comes late"},
    {"torque_loss", "constant_Nm", "a drag before the belt"},
    {"torque_loss", "per_kN_Nm", "a drag that grows with the clamp force"},
    {"torque_loss", "per_rad_s_Nm", "a drag that grows with the primary speed"},
    {"centrifugal_force", "coefficient_N_s2", "a clamp force of the turning oil"},
    {"pressure_offset", "offset_Pa", "a measured pressure that is too high by"},
    {"pressure_gain", "gain", "a measured pressure that is too high by the share"},
    {"spring_force", "force_N", "a spring that is stronger than configured"},
    {"hydraulic_lag", "time_constant_s", "a pressure that acts with a lag"},
    {"hydraulic_lag", "delay_s", "a pressure that acts late"},
    {"clamp_hysteresis", "force_N", "friction in the clamp force's way, with play"},
    {"pulley_deformation", "per_kN", "pulleys that give way to the clamp force"},
    {"pulley_deformation", "per_kN2", "pulleys that give way to the clamp force's square"},
    {"radius_tilt", "per_Nm", "a ratio that the torque tilts"},
    {"end_stop_ratio", "low", "a ratio at the low end stop that is larger by the share"},
    {"end_stop_ratio", "overdrive",
     "a ratio at the overdrive end stop that is larger by the share"},
    {"ratio_creep", "rate", "a ratio that leaves its end stop as the holding force falls"},
    {"friction_temperature", "per_K", "friction that grows with the oil temperature"},
    {"friction_speed", "per_ln_speed", "friction that grows with the speed"},
    {"friction_load", "exponent", "friction that falls with the clamp force, exponent"},
    {"friction_ratio", "relative", "more friction at the low end stop, a share of"},
    {"friction_shape", "peak_slip_percent", "a peak of friction at another slip"},
    {"friction_shape", "fall_per_percent", "friction that falls faster behind its peak"},
    {"wear", "step", "less friction from one experiment on, a share of"},
    {"wear", "per_experiment", "friction that falls with each experiment, a share of"},
    {"warm_up_drift", "per_kJ", "friction that grows with the slip energy"},
    {"warm_up_drift", "per_start", "friction that grows in the first minute, a share of"},
    {"speed_scale", "primary", "a primary speed that is too high by the share"},
    {"speed_scale", "secondary", "a secondary speed that is too high by the share"},
    {"speed_ripple", "primary", "a ripple of the primary speed over its turn, a share of"},
    {"speed_ripple", "secondary", "a ripple of the secondary speed over its turn, a share of"},
    {"channel_skew", "delay_s", "a channel that comes late"},
    {"secondary_loss", "constant_Nm", "a drag behind the belt"},
    {"secondary_loss", "per_rad_s_Nm", "a drag behind the belt that grows with its speed"},
};

std::string rounded(double value, int digits) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%.*g", digits, value);
  return buffer;
}

// A value to the place of the second digit of its half width.
std::string size_of(const Interval& size) {
  const double half = 0.5 * (size.high - size.low);
  int digits = 3;
  if (half > 0.0 && size.value != 0.0 && std::isfinite(half)) {
    const double places =
        std::floor(std::log10(std::abs(size.value))) - std::floor(std::log10(half));
    digits = std::clamp(static_cast<int>(places) + 2, 2, 9);
  }
  const bool even = std::abs(size.high + size.low - 2.0 * size.value) < 0.1 * half;
  return even ? rounded(size.value, digits) + " +- " + rounded(half, 2)
              : rounded(size.value, digits) + " (" + rounded(size.low, digits) + " to " +
                    rounded(size.high, digits) + ")";
}

}  // namespace

std::string_view words_of(std::string_view effect, std::string_view parameter) {
  const auto found = std::find_if(std::begin(kWords), std::end(kWords), [&](const Words& each) {
    return each.effect == effect && each.parameter == parameter;
  });
  return found == std::end(kWords) ? std::string_view{} : found->words;
}

std::string_view unit_of(std::string_view effect, std::string_view parameter) {
  for (const estimator::EffectRow& row : estimator::effect_rows()) {
    if (row.id == effect && row.parameter == parameter) return row.unit;
  }
  return {};
}

std::string in_words(const Finding& finding) {
  std::string out;
  for (const auto& [name, size] : finding.parameters) {
    const std::string_view words = words_of(finding.effect, name);
    const bool leads_on = words.ends_with(" by") || words.ends_with(" of") ||
                          words.ends_with("share") || words.ends_with("exponent");
    out += (out.empty() ? "" : ", ") + std::string(words) + (leads_on ? " " : ", ") + size_of(size);
    const std::string unit(unit_of(finding.effect, name));
    if (!unit.empty()) out += " " + unit;
  }
  if (!finding.from_file.empty()) out += ", from " + finding.from_file + " on";
  return out + " (" + finding.effect + (finding.role.empty() ? "" : ", " + finding.role) + ")";
}

}  // namespace beltgrip::diagnose
