#include "tools/sim/vehicle_plant.h"

#include <algorithm>
#include <cmath>

#include "estimator/physics/variator_geometry.h"
#include "tools/sim/friction_factor.h"
#include "tools/sim/tanh.h"

namespace beltgrip::sim {

namespace {

constexpr double kGravity_m_s2 = 9.81;
constexpr double kAirDensity_kg_m3 = 1.2;
constexpr double kClutchWidth_rad_s = 0.5;   // slip at which the lock-up carries 76 % of its torque
constexpr double kConverter_Nm_s2 = 2.0e-3;  // 150 Nm at 2600 rpm against a standing turbine
constexpr double kLeastSpeed_rad_s = 5.0;    // slip is relative to at least this
constexpr double kCoulombWidth_rad_s = 1.0;  // brakes and bearings through standstill
constexpr double kReferenceForce_N = 3000.0;  // where the belt's mu_max is given
constexpr double kReferenceSpeed_rad_s = 105.0;
constexpr double kReferenceTemperature_degC = 80.0;

// (1 + cos^2(theta)) / sin(2 theta), variator-facts 3.4.
double wedge_factor(double half_angle_rad) {
  const double cosine = std::cos(half_angle_rad);
  return (1.0 + cosine * cosine) / std::sin(2.0 * half_angle_rad);
}

// I - gamma h J of three shafts in a row, of which the first and the last do not see each other, by
// its cofactors: one division and no question, for several right sides.
class Inverse {
 public:
  using Matrix = std::array<std::array<double, 3>, 3>;
  explicit Inverse(const Matrix& w) {
    const double first = w[0][1] * w[1][0], last = w[1][2] * w[2][1];
    const double rest = w[1][1] * w[2][2] - last;
    const double scale = 1.0 / (w[0][0] * rest - first * w[2][2]);
    inverse_ = {
        {{scale * rest, -scale * w[0][1] * w[2][2], scale * w[0][1] * w[1][2]},
         {-scale * w[1][0] * w[2][2], scale * w[0][0] * w[2][2], -scale * w[0][0] * w[1][2]},
         {scale * w[1][0] * w[2][1], -scale * w[0][0] * w[2][1],
          scale * (w[0][0] * w[1][1] - first)}}};
  }
  std::array<double, 3> times(const std::array<double, 3>& b) const {
    std::array<double, 3> x{};
    for (std::size_t i = 0; i < 3; ++i) {
      x[i] = inverse_[i][0] * b[0] + inverse_[i][1] * b[1] + inverse_[i][2] * b[2];
    }
    return x;
  }

 private:
  Matrix inverse_;
};

}  // namespace

VehiclePlant::VehiclePlant(const VehicleScenario& scenario)
    : variator_(scenario.variator),
      belt_(scenario.belt),
      effects_(scenario.effects),
      learned_(scenario.learned),
      experiment_(scenario.experiment),
      body_(scenario.body),
      engine_inertia_kg_m2_(scenario.engine.inertia_kg_m2),
      secondary_inertia_kg_m2_(variator_.secondary_inertia_kg_m2 +
                               body_.mass_kg *
                                   std::pow(body_.wheel_radius_m / body_.final_drive, 2)),
      cos_wedge_(std::cos(variator_.half_wedge_angle_rad)),
      wedge_factor_(wedge_factor(variator_.half_wedge_angle_rad)),
      ln_ratio_low_(std::log(variator_.ratio_low)),
      ln_span_(std::log(variator_.ratio_overdrive) - ln_ratio_low_) {
  belt_.overdrive = shaped(belt_.overdrive, effects_);
  variator_.secondary_loss_Nm += effects_.secondary_loss_constant_Nm;
  variator_.secondary_loss_Nm_s += effects_.secondary_loss_per_rad_s_Nm;
  for (int i = 0; i < kRadii; ++i) {
    const double ratio = variator_.ratio_low * std::exp(ln_span_ * i / (kRadii - 1));
    radius_m_[static_cast<std::size_t>(i)] =
        estimator::running_radii(ratio, variator_.belt_length_m, variator_.centre_distance_m)
            .primary_m;
  }
}

double VehiclePlant::primary_radius_m(double ratio) const {
  return radius_at(std::clamp((std::log(ratio) - ln_ratio_low_) / ln_span_, 0.0, 1.0));
}

double VehiclePlant::radius_at(double way) const {
  if (std::isnan(way)) return way;  // what is no number stays none; the run ends on it
  const double place = way * static_cast<double>(kRadii - 1);
  const auto i = std::min(static_cast<std::size_t>(place), static_cast<std::size_t>(kRadii - 2));
  const double share = place - static_cast<double>(i);
  return radius_m_[i] + share * (radius_m_[i + 1] - radius_m_[i]);
}

double VehiclePlant::speed_m_s() const {
  return state_.omega_s_rad_s * body_.wheel_radius_m / body_.final_drive;
}

void VehiclePlant::settle(double speed_m_s, double ratio, double idle_rad_s) {
  state_.ratio = ratio;
  state_.omega_s_rad_s = speed_m_s * body_.final_drive / body_.wheel_radius_m;
  state_.omega_p_rad_s = state_.omega_s_rad_s / ratio;
  state_.omega_e_rad_s = std::max(state_.omega_p_rad_s, idle_rad_s);
  observe({});
}

const VehiclePlant::RatioGeometry& VehiclePlant::ratio_geometry() {
  if (place_.ratio != state_.ratio) {
    const double ln_ratio = std::log(state_.ratio);
    const double way = std::clamp((ln_ratio - ln_ratio_low_) / ln_span_, 0.0, 1.0);
    place_ = {state_.ratio, 1.0 - way, radius_at(way), ln_ratio};
  }
  return place_;
}

double VehiclePlant::load_factor(double secondary_force_N) {
  if (secondary_force_N != loaded_N_) {
    loaded_N_ = secondary_force_N;
    load_factor_ =
        std::pow(std::max(secondary_force_N, 1.0) / kReferenceForce_N, -belt_.load_exponent);
  }
  return load_factor_;
}

VehiclePlant::StepConstants VehiclePlant::step_constants(const DrivelineInput& input) {
  StepConstants held;
  const double low_share = ratio_geometry().low_share;
  held.curve = belt_.overdrive;
  held.curve.peak_slip_percent +=
      low_share * (belt_.low_peak_slip_percent - belt_.overdrive.peak_slip_percent);
  const double speed = std::max(state_.omega_p_rad_s, kLeastSpeed_rad_s) / kReferenceSpeed_rad_s;
  held.curve.mu_max *=
      (1.0 + low_share * (belt_.low_mu_factor - 1.0)) * (1.0 - input.wear) *
      std::max(0.2, 1.0 + belt_.temperature_per_K * (input.oil_degC - kReferenceTemperature_degC)) *
      std::max(0.2, 1.0 + belt_.speed_per_ln * ln_speed_.of(speed)) *
      load_factor(input.secondary_force_N) *
      friction_factor(effects_, {input.oil_degC, state_.omega_p_rad_s, input.secondary_force_N,
                                 low_share, input.time_s, input.slip_energy_kJ, experiment_}) *
      (1.0 + learned_at(learned_, estimator::LearnedPoint::kFriction, input.conditions));
  const double kN = 1e-3 * input.secondary_force_N;
  const double end_stop =
      low_share * effects_.end_stop_low + (1.0 - low_share) * effects_.end_stop_overdrive;
  const double learned_ratio =
      learned_at(learned_, estimator::LearnedPoint::kRatio, input.conditions);
  held.ratio = state_.ratio * (1.0 + end_stop) * (1.0 + learned_ratio) *
               (crept_ == 0.0 ? 1.0 : std::exp(low_share > 0.5 ? crept_ : -crept_)) *
               (1.0 - variator_.deformation_per_N * input.secondary_force_N -
                effects_.deformation_per_kN * kN - effects_.deformation_per_kN2 * kN * kN -
                (variator_.deformation_per_Nm + effects_.tilt_per_Nm) * output_.belt_torque_Nm);
  held.radius_m = ratio_geometry().radius_m;
  held.torque_per_mu = 2.0 * input.secondary_force_N * held.radius_m / cos_wedge_;
  return held;
}

VehiclePlant::Slip VehiclePlant::slip_of(double ratio, double omega_p_rad_s, double omega_s_rad_s) {
  const double difference = ratio * omega_p_rad_s - omega_s_rad_s;
  const double primary = ratio * omega_p_rad_s;
  const double secondary = 0.5 * omega_s_rad_s;  // macro slip of a stalled engine ends at -100 %
  const double least = ratio * kLeastSpeed_rad_s;
  if (primary >= secondary && primary >= least) {
    return {difference / primary, omega_s_rad_s / (primary * omega_p_rad_s), -1.0 / primary};
  }
  if (secondary >= least) {
    return {difference / secondary, ratio / secondary,
            -1.0 / secondary - 0.5 * difference / (secondary * secondary)};
  }
  return {difference / least, ratio / least, -1.0 / least};
}

VehiclePlant::Loads VehiclePlant::loads(const DrivelineInput& input) const {
  const double speed_per_omega = body_.wheel_radius_m / body_.final_drive;
  const double weight_N = body_.mass_kg * kGravity_m_s2;
  return {.primary_Nm = variator_.primary_loss_Nm + effects_.loss_constant_Nm +
                        (variator_.primary_loss_Nm_per_N + 1e-3 * effects_.loss_per_kN_Nm) *
                            input.secondary_force_N,
          .learned_Nm = learned_at(learned_, estimator::LearnedPoint::kTorque, input.conditions),
          .speed_per_omega = speed_per_omega,
          .coulomb_Nm = variator_.secondary_loss_Nm + input.brake_Nm +
                        weight_N * body_.rolling_resistance * speed_per_omega,
          .air = 0.5 * kAirDensity_kg_m3 * body_.drag_area_m2 * speed_per_omega,
          .grade_Nm = weight_N * body_.grade_percent / 100.0 * speed_per_omega};
}

template <bool kWithJacobian>
VehiclePlant::Rates VehiclePlant::rates(const std::array<double, 3>& omega,
                                        const DrivelineInput& input, const StepConstants& held,
                                        const Loads& loads) const {
  const Slip slip = slip_of(held.ratio, omega[1], omega[2]);
  const FrictionPoint friction = friction_at(held.curve, slip.value);
  const double belt = held.torque_per_mu * friction.mu;

  const double difference = omega[0] - omega[1];
  const double t = tanh_of(difference / kClutchWidth_rad_s);
  const double clutch =
      input.lockup_capacity_Nm * t + kConverter_Nm_s2 * difference * std::abs(difference);

  const double loss = loads.primary_Nm + effects_.loss_per_rad_s_Nm * omega[1] + loads.learned_Nm;
  const double tp = tanh_of(omega[1] / kCoulombWidth_rad_s);
  const double ts = tanh_of(omega[2] / kCoulombWidth_rad_s);
  const double speed = omega[2] * loads.speed_per_omega;
  const double road = loads.coulomb_Nm * ts + variator_.secondary_loss_Nm_s * omega[2] +
                      loads.air * speed * std::abs(speed) + loads.grade_Nm + input.disturbance_Nm;

  Rates r;
  const double je = engine_inertia_kg_m2_;
  const double jp = variator_.primary_inertia_kg_m2 + effects_.inertia_kg_m2;
  const double js = secondary_inertia_kg_m2_;
  r.value = {(input.engine_torque_Nm - clutch) / je, (clutch - loss * tp - belt) / jp,
             (belt / held.ratio - road) / js};
  if constexpr (kWithJacobian) {
    const double belt_per_p = held.torque_per_mu * friction.slope * slip.per_p;
    const double belt_per_s = held.torque_per_mu * friction.slope * slip.per_s;
    const double clutch_slope = input.lockup_capacity_Nm * (1.0 - t * t) / kClutchWidth_rad_s +
                                2.0 * kConverter_Nm_s2 * std::abs(difference);
    const double road_slope = loads.coulomb_Nm * (1.0 - ts * ts) / kCoulombWidth_rad_s +
                              variator_.secondary_loss_Nm_s +
                              2.0 * loads.air * std::abs(speed) * loads.speed_per_omega;
    r.jacobian[0] = {-clutch_slope / je, clutch_slope / je, 0.0};
    r.jacobian[1] = {
        clutch_slope / jp,
        (-clutch_slope - loss * (1.0 - tp * tp) / kCoulombWidth_rad_s - belt_per_p) / jp,
        -belt_per_s / jp};
    r.jacobian[2] = {0.0, belt_per_p / held.ratio / js,
                     (belt_per_s / held.ratio - road_slope) / js};
  }
  return r;
}

void VehiclePlant::shift(const DrivelineInput& input, double step_s) {
  const double ln_force_ratio =
      std::log(std::max(input.primary_force_N, 1.0) / std::max(input.secondary_force_N, 1.0));
  const double capacity_Nm =
      2.0 * output_.mu_max * input.secondary_force_N * output_.primary_radius_m / cos_wedge_;
  const double load = std::clamp(output_.belt_torque_Nm / std::max(capacity_Nm, 1.0), -1.0, 1.0);
  const double equilibrium =
      variator_.force_ratio_slope * ratio_geometry().ln_ratio + variator_.force_ratio_load * load;
  const double rate = std::max(state_.omega_p_rad_s, 0.0) * variator_.shift_gain * wedge_factor_ *
                      state_.ratio * (ln_force_ratio - equilibrium);
  state_.ratio =
      std::clamp(state_.ratio + rate * step_s, variator_.ratio_low, variator_.ratio_overdrive);
  creep(ln_force_ratio, step_s);
}

// Held by the stop, the ratio gives way as the force ratio falls from where it was at arrival.
void VehiclePlant::creep(double ln_force_ratio, double step_s) {
  constexpr double kCreepMax = 0.2;
  const bool low = state_.ratio <= variator_.ratio_low;
  if (!low && state_.ratio < variator_.ratio_overdrive) {
    on_stop_ = false;
    crept_ = 0.0;
    return;
  }
  if (!on_stop_) reference_ln_ = ln_force_ratio;
  on_stop_ = true;
  const double lost = (low ? -1.0 : 1.0) * (reference_ln_ - ln_force_ratio);
  crept_ = std::clamp(crept_ + effects_.creep_rate * state_.omega_p_rad_s * lost * step_s, 0.0,
                      kCreepMax);
}

void VehiclePlant::observe(const DrivelineInput& input) {
  const StepConstants held = step_constants(input);
  const Slip slip = slip_of(held.ratio, state_.omega_p_rad_s, state_.omega_s_rad_s);
  output_.slip_share = slip.value;
  output_.mu = friction_at(held.curve, slip.value).mu;
  output_.mu_max = held.curve.mu_max;
  output_.peak_slip_share = held.curve.peak_slip_percent / 100.0;
  output_.fall_slip_share = held.curve.fall_slip_share();
  output_.geometric_ratio = held.ratio;
  output_.primary_radius_m = held.radius_m;
  output_.belt_torque_Nm = held.torque_per_mu * output_.mu;
  const double secondary_radius_m = held.radius_m / held.ratio;
  output_.slip_speed_m_s =
      std::abs(held.ratio * state_.omega_p_rad_s - state_.omega_s_rad_s) * secondary_radius_m;
  output_.slip_power_W = std::abs(output_.belt_torque_Nm) * output_.slip_speed_m_s / held.radius_m;
}

void VehiclePlant::step(const DrivelineInput& input, double step_s) {
  // W = I - gamma h J;  W k1 = f(x);  W k2 = f(x + h k1) - 2 k1;  x += h (3 k1 + k2) / 2.
  const StepConstants held = step_constants(input);
  const double gamma_h = (1.0 - std::sqrt(0.5)) * step_s;
  const std::array<double, 3> x{state_.omega_e_rad_s, state_.omega_p_rad_s, state_.omega_s_rad_s};
  const Loads fixed = loads(input);
  const Rates first = rates<true>(x, input, held, fixed);
  std::array<std::array<double, 3>, 3> w{};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      w[i][j] = (i == j ? 1.0 : 0.0) - gamma_h * first.jacobian[i][j];
    }
  }
  const Inverse inverse(w);
  const std::array<double, 3> k1 = inverse.times(first.value);
  std::array<double, 3> trial{};
  for (std::size_t i = 0; i < 3; ++i) trial[i] = x[i] + step_s * k1[i];
  Rates second = rates<false>(trial, input, held, fixed);
  for (std::size_t i = 0; i < 3; ++i) second.value[i] -= 2.0 * k1[i];
  const std::array<double, 3> k2 = inverse.times(second.value);
  state_.omega_e_rad_s += step_s * (1.5 * k1[0] + 0.5 * k2[0]);
  state_.omega_p_rad_s += step_s * (1.5 * k1[1] + 0.5 * k2[1]);
  state_.omega_s_rad_s += step_s * (1.5 * k1[2] + 0.5 * k2[2]);
  shift(input, step_s);
  observe(input);
}

bool VehiclePlant::finite() const {
  return std::isfinite(state_.omega_e_rad_s) && std::isfinite(state_.omega_p_rad_s) &&
         std::isfinite(state_.omega_s_rad_s) && std::isfinite(state_.ratio);
}

}  // namespace beltgrip::sim
