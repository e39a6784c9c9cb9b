// Effects between the measured pressure and the force that clamps the belt.
#include "tools/diagnose/model/effects/effect.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace beltgrip::diagnose {
namespace {

using Eigen::ArrayXd;

// lag(x) - x of a first-order lag, exact for an input that is linear between samples. Odd in the
// time constant, so that derivatives at zero exist.
ArrayXd lag_change(const ArrayXd& in, double dt_s, double time_constant_s) {
  const double tau_s = std::abs(time_constant_s);
  const double keep = std::exp(-dt_s / tau_s);
  ArrayXd out = ArrayXd::Zero(in.size());
  double y = std::nan("");
  for (Eigen::Index k = 0; k < in.size(); ++k) {
    const double x = in[k];
    if (!std::isfinite(x)) {
      y = std::nan("");
      continue;
    }
    if (!std::isfinite(y)) {
      y = x;
    } else {
      const double before = in[k - 1];
      y = keep * y + x - keep * before - tau_s * (1.0 - keep) * (x - before) / dt_s;
    }
    out[k] = std::copysign(1.0, time_constant_s) * (y - x);
  }
  return out;
}

void apply_hydraulic_lag(Context& c, const Slot& slot, double time_constant_s) {
  if (slot.role == "command") {
    c.track += lag_change(c.run.command.sharp, c.run.dt_s, time_constant_s);
  } else {
    c.pressure += lag_change(c.run.pressure.sharp, c.run.dt_s, time_constant_s);
  }
}

void apply_hydraulic_delay(Context& c, const Slot& slot, double delay_s) {
  const GridSignal& input = slot.role == "command" ? c.run.command : c.run.pressure;
  const ArrayXd change = shifted(input, c.run.dt_s, -delay_s) - input.sharp;
  (slot.role == "command" ? c.track : c.pressure) += change;
}

void apply_centrifugal_force(Context& c, const Slot&, double coefficient_N_s2) {
  c.force_N += coefficient_N_s2 * c.omega_s.square();
}

void apply_spring_force(Context& c, const Slot&, double force_N) { c.force_N += force_N; }

void apply_clamp_hysteresis(Context& c, const Slot& slot, double force_N) {
  c.play_N += force_N;
  c.play_from = slot.role == "raised" ? -1.0 : slot.role == "lowered" ? 1.0 : 0.0;
}

void of_each_input(const Carried& data, const AddSlot& add) {
  if (data.pressure_varies) add(0, {});
  if (data.command) add(0, "command");
}
// The clamp force before each experiment: unknown, raised to where it begins, lowered.
void from_each_side(const Carried&, const AddSlot& add) {
  for (const std::string_view before : {"", "raised", "lowered"}) add(0, before);
}

constexpr std::array kFarLags_s{0.2};
constexpr std::array kFarPlays_N{120.0};

constexpr Equation kClampingEquations[] = {
    {"centrifugal_force", "coefficient_N_s2", apply_centrifugal_force},
    {"spring_force", "force_N", apply_spring_force},
    {"hydraulic_lag", "time_constant_s", apply_hydraulic_lag, of_each_input, false, nullptr,
     nullptr, kFarLags_s},
    {"hydraulic_lag", "delay_s", apply_hydraulic_delay, of_each_input},
    {"clamp_hysteresis", "force_N", apply_clamp_hysteresis, from_each_side, false, nullptr, nullptr,
     kFarPlays_N},
};

}  // namespace

std::span<const Equation> clamping_equations() { return kClampingEquations; }

}  // namespace beltgrip::diagnose
