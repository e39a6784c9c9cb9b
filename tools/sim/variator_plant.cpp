#include "tools/sim/variator_plant.h"

#include <cmath>

#include "estimator/physics/variator_geometry.h"
#include "tools/sim/tanh.h"

namespace beltgrip::sim {

VariatorPlant::VariatorPlant(const VariatorParameters& variator, const FrictionCurve& friction)
    : variator_(variator),
      friction_(friction),
      cos_wedge_(std::cos(variator.half_wedge_angle_rad)),
      primary_radius_m_(estimator::running_radii(variator.ratio, variator.belt_length_m,
                                                 variator.centre_distance_m)
                            .primary_m) {}

double VariatorPlant::ratio_at(double clamp_force_N) const {
  return ratio_factor_ * variator_.ratio * (1.0 - variator_.deformation_per_N * clamp_force_N);
}

FrictionPoint VariatorPlant::friction_now(double slip_share) const {
  const FrictionPoint point = friction_at(friction_, slip_share);
  return {friction_factor_ * point.mu, friction_factor_ * point.slope};
}

double VariatorPlant::constant_drag_Nm(double clamp_force_N) const {
  return variator_.secondary_loss_Nm + variator_.secondary_loss_Nm_per_N * clamp_force_N;
}

double VariatorPlant::drag_Nm(double omega_s_rad_s, double clamp_force_N) const {
  // Smooth through standstill: full drag from about 1 rad/s on.
  return constant_drag_Nm(clamp_force_N) * tanh_of(omega_s_rad_s) +
         variator_.secondary_loss_Nm_s * omega_s_rad_s;
}

bool VariatorPlant::settle(double omega_p_rad_s, double torque_p_Nm, double clamp_force_N) {
  const double wanted =
      std::abs(torque_p_Nm) * cos_wedge_ / (2.0 * primary_radius_m_ * clamp_force_N);
  double low = 0.0;
  double high = friction_.peak_slip_percent / 100.0;
  if (!(friction_now(high).mu >= wanted)) return false;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (friction_now(middle).mu < wanted ? low : high) = middle;
  }
  const double slip_share = std::copysign(0.5 * (low + high), torque_p_Nm);
  state_.omega_p_rad_s = omega_p_rad_s;
  state_.omega_s_rad_s = (1.0 - slip_share) * ratio_at(clamp_force_N) * omega_p_rad_s;
  return true;
}

PlantOutput VariatorPlant::output(double clamp_force_N) const {
  PlantOutput out;
  out.geometric_ratio = ratio_at(clamp_force_N);
  out.slip_share = 1.0 - state_.omega_s_rad_s / (out.geometric_ratio * state_.omega_p_rad_s);
  out.mu = friction_now(out.slip_share).mu;
  out.torque_p_Nm = 2.0 * out.mu * clamp_force_N * primary_radius_m_ / cos_wedge_;
  out.torque_s_Nm = out.torque_p_Nm / out.geometric_ratio;
  return out;
}

double VariatorPlant::balancing_load_Nm(double torque_p_Nm, double clamp_force_N) const {
  return torque_p_Nm / ratio_at(clamp_force_N) - drag_Nm(state_.omega_s_rad_s, clamp_force_N);
}

bool VariatorPlant::finite() const {
  return std::isfinite(state_.omega_p_rad_s) && std::isfinite(state_.omega_s_rad_s);
}

VariatorPlant::Derivative VariatorPlant::derivative(const PlantState& state,
                                                    const PlantInput& input,
                                                    double omega_p_start_rad_s) const {
  const double ratio = ratio_at(input.clamp_force_N);
  const double slip_share = 1.0 - state.omega_s_rad_s / (ratio * state.omega_p_rad_s);
  const FrictionPoint friction = friction_now(slip_share);
  const double torque_per_mu = 2.0 * input.clamp_force_N * primary_radius_m_ / cos_wedge_;
  const double torque_p = torque_per_mu * friction.mu;
  const double torque_p_per_slip = torque_per_mu * friction.slope;
  const double slip_per_p =
      state.omega_s_rad_s / (ratio * state.omega_p_rad_s * state.omega_p_rad_s);
  const double slip_per_s = -1.0 / (ratio * state.omega_p_rad_s);
  const double drive = input.drive_torque_Nm +
                       input.drive_torque_slope_Nm_s * (state.omega_p_rad_s - omega_p_start_rad_s);
  const double t = tanh_of(state.omega_s_rad_s);
  const double drag_per_s =
      constant_drag_Nm(input.clamp_force_N) * (1.0 - t * t) + variator_.secondary_loss_Nm_s;

  Derivative d;
  d.p = (drive - torque_p) / variator_.primary_inertia_kg_m2;
  d.s = (torque_p / ratio - drag_Nm(state.omega_s_rad_s, input.clamp_force_N) -
         input.load_torque_Nm) /
        variator_.secondary_inertia_kg_m2;
  d.pp = (input.drive_torque_slope_Nm_s - torque_p_per_slip * slip_per_p) /
         variator_.primary_inertia_kg_m2;
  d.ps = -torque_p_per_slip * slip_per_s / variator_.primary_inertia_kg_m2;
  d.sp = torque_p_per_slip * slip_per_p / ratio / variator_.secondary_inertia_kg_m2;
  d.ss = (torque_p_per_slip * slip_per_s / ratio - drag_per_s) / variator_.secondary_inertia_kg_m2;
  return d;
}

void VariatorPlant::step(const PlantInput& input, double step_s) {
  // W = I - gamma h J;  W k1 = f(x);  W k2 = f(x + h k1) - 2 k1;  x += h (3 k1 + k2) / 2.
  const double gamma_h = (1.0 - std::sqrt(0.5)) * step_s;
  const double omega_p_start = state_.omega_p_rad_s;
  const Derivative first = derivative(state_, input, omega_p_start);
  const double a = 1.0 - gamma_h * first.pp;
  const double b = -gamma_h * first.ps;
  const double c = -gamma_h * first.sp;
  const double d = 1.0 - gamma_h * first.ss;
  const double determinant = a * d - b * c;
  const double k1_p = (d * first.p - b * first.s) / determinant;
  const double k1_s = (a * first.s - c * first.p) / determinant;
  const PlantState trial{state_.omega_p_rad_s + step_s * k1_p,
                         state_.omega_s_rad_s + step_s * k1_s};
  const Derivative second = derivative(trial, input, omega_p_start);
  const double rhs_p = second.p - 2.0 * k1_p;
  const double rhs_s = second.s - 2.0 * k1_s;
  const double k2_p = (d * rhs_p - b * rhs_s) / determinant;
  const double k2_s = (a * rhs_s - c * rhs_p) / determinant;
  state_.omega_p_rad_s += step_s * (1.5 * k1_p + 0.5 * k2_p);
  state_.omega_s_rad_s += step_s * (1.5 * k1_s + 0.5 * k2_s);
}

}  // namespace beltgrip::sim
