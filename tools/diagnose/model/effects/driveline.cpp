// Effects between shafts and belt, and of the geometry: torque that does not reach the belt, radii
// that are not what the ratio says.
#include "tools/diagnose/model/effects/effect.h"

#include <algorithm>
#include <cmath>

namespace beltgrip::diagnose {
namespace {

// ln(1 + x), kept finite: a fit may try more than the machine could do.
double safe_ln(double x) { return std::log(std::max(x, 0.05)); }

void shift_ratio_at(Context& c, int stop, double relative) {
  const double change = safe_ln(1.0 + relative);
  for (Eigen::Index k = 0; k < c.ln_ratio.size(); ++k) {
    if (c.run.stop[static_cast<std::size_t>(k)] == stop) c.ln_ratio[k] += change;
  }
}

void apply_inertia_torque(Context& c, const Slot&, double inertia_kg_m2) {
  c.loss_Nm += inertia_kg_m2 * c.slope_p;
}
void apply_loss_constant(Context& c, const Slot&, double constant_Nm) { c.loss_Nm += constant_Nm; }
void apply_loss_per_kN(Context& c, const Slot&, double per_kN_Nm) {
  c.loss_Nm += per_kN_Nm * 1e-3 * c.force_N;
}
void apply_loss_per_speed(Context& c, const Slot&, double per_rad_s_Nm) {
  c.loss_Nm += per_rad_s_Nm * c.omega_p;
}
void apply_secondary_constant(Context& c, const Slot&, double constant_Nm) {
  c.secondary_loss_Nm += constant_Nm;
}
void apply_secondary_per_speed(Context& c, const Slot&, double per_rad_s_Nm) {
  c.secondary_loss_Nm += per_rad_s_Nm * c.omega_s;
}
void apply_deformation_linear(Context& c, const Slot&, double per_kN) {
  c.deformation += per_kN * 1e-3 * c.force_N;
}
void apply_deformation_quadratic(Context& c, const Slot&, double per_kN2) {
  const Eigen::ArrayXd deformation = per_kN2 * 1e-6 * c.force_N.square();
  c.deformation += deformation;
  c.deformation_bend += deformation;
}
void apply_radius_tilt(Context& c, const Slot&, double per_Nm) { c.ln_ratio -= per_Nm * c.torque; }
void apply_end_stop_low(Context& c, const Slot&, double relative) {
  shift_ratio_at(c, kLowStop, relative);
}
void apply_end_stop_overdrive(Context& c, const Slot&, double relative) {
  shift_ratio_at(c, kOverdriveStop, relative);
}

// Away from the stop at rate * omega_p * (fall of the holding force ratio since the start), back
// when it recovers, never beyond the stop. Without primary pressure the primary force counts as
// constant; the slot "clamp force" takes a falling F_s as the cause at either stop.
void apply_ratio_creep(Context& c, const Slot& slot, double rate) {
  const bool by_force = slot.role == "clamp force";
  const GridSignal& primary = c.run.pressure_p;
  double reference = std::nan("");
  double away = 0.0;
  for (Eigen::Index k = 0; k < c.ln_ratio.size(); ++k) {
    const int stop = c.run.stop[static_cast<std::size_t>(k)];
    const double force_N = c.variator.secondary_piston_area_m2 * c.read.pressure_Pa[k] +
                           c.variator.secondary_spring_force_N;
    if (stop == kNoStop || !(force_N > 0.0)) continue;
    double ln_force_ratio = -std::log(force_N);  // F_p / F_s
    if (primary.present && primary.value[k] > 0.0) ln_force_ratio += std::log(primary.value[k]);
    double hold = stop == kOverdriveStop ? ln_force_ratio : -ln_force_ratio;
    if (by_force) hold = std::log(force_N);
    if (!std::isfinite(reference)) reference = hold;
    away = std::max(
        0.0, away + std::abs(rate) * c.run.omega_p.value[k] * (reference - hold) * c.run.dt_s);
    const double toward_middle = stop == kOverdriveStop ? -1.0 : 1.0;
    c.ln_ratio[k] += std::copysign(1.0, rate) * toward_middle * std::min(away, 0.2);
  }
}

void at_low(const Carried& data, const AddSlot& add) {
  if (data.low) add(0, {});
}
void at_overdrive(const Carried& data, const AddSlot& add) {
  if (data.overdrive) add(0, {});
}
void with_secondary_torque(const Carried& data, const AddSlot& add) {
  if (data.secondary_torque) add(0, {});
}
void by_each_force(const Carried&, const AddSlot& add) {
  add(0, {});
  add(0, "clamp force");
}

constexpr Equation kDrivelineEquations[] = {
    {"inertia_torque", "inertia_kg_m2", apply_inertia_torque},
    {"torque_loss", "constant_Nm", apply_loss_constant},
    {"torque_loss", "per_kN_Nm", apply_loss_per_kN},
    {"torque_loss", "per_rad_s_Nm", apply_loss_per_speed},
    {"pulley_deformation", "per_kN", apply_deformation_linear},
    {"pulley_deformation", "per_kN2", apply_deformation_quadratic},
    {"radius_tilt", "per_Nm", apply_radius_tilt},
    {"end_stop_ratio", "low", apply_end_stop_low, at_low},
    {"end_stop_ratio", "overdrive", apply_end_stop_overdrive, at_overdrive},
    {"ratio_creep", "rate", apply_ratio_creep, by_each_force},
    {"secondary_loss", "constant_Nm", apply_secondary_constant, with_secondary_torque},
    {"secondary_loss", "per_rad_s_Nm", apply_secondary_per_speed, with_secondary_torque},
};

}  // namespace

std::span<const Equation> driveline_equations() { return kDrivelineEquations; }

}  // namespace beltgrip::diagnose
