#include "tools/sim/rig_simulation.h"

#include <algorithm>
#include <cmath>

#include "tools/sim/friction_factor.h"
#include "tools/sim/learned_conditions.h"

namespace beltgrip::sim {

namespace {

constexpr double kStall_rad_s = 5.0;

RigScenario with_its_belt(RigScenario scenario) {
  FrictionCurve& belt = scenario.belts.at(scenario.belt);
  belt = shaped(belt, scenario.effects);
  return scenario;
}

VariatorParameters with_its_drag(VariatorParameters variator,
                                 const estimator::MachineEffects& effects) {
  variator.secondary_loss_Nm += effects.secondary_loss_constant_Nm;
  variator.secondary_loss_Nm_s += effects.secondary_loss_per_rad_s_Nm;
  return variator;
}

}  // namespace

RigSimulation::RigSimulation(const RigScenario& scenario)
    : Simulation(scenario),
      scenario_(with_its_belt(scenario)),
      plant_(with_its_drag(scenario.variator, scenario.effects), scenario_.friction()),
      command_force_N_(scenario.start_force_N),
      clamp_force_N_(scenario.start_force_N),
      clamping_(scenario.effects, step_s_),
      belt_force_N_(scenario.start_force_N),
      reference_force_N_(scenario.start_force_N),
      cycles_left_(std::round(scenario.cycles)) {
  signals_.oil_degC = scenario.oil_degC;
  signals_.omega_p_rad_s = scenario.primary_speed_rad_s;
  signals_.omega_s_rad_s = scenario.primary_speed_rad_s * scenario.variator.ratio;
  signals_.torque_p_Nm = scenario.primary_torque_Nm;
  act(true);
  plant_.settle(scenario.primary_speed_rad_s, scenario.primary_torque_Nm, belt_force_N_);
  load_torque_Nm_ = plant_.balancing_load_Nm(scenario.primary_torque_Nm, belt_force_N_);
  controller_torque_Nm_ = scenario.primary_torque_Nm + loss_Nm(0.0);
  signals_.omega_p_rad_s = plant_.state().omega_p_rad_s;
  signals_.omega_s_rad_s = plant_.state().omega_s_rad_s;
  signals_.torque_p_Nm = controller_torque_Nm_;
  signals_.torque_s_Nm = load_torque_Nm_;
  signals_.secondary_pressure_Pa = signals_.secondary_pressure_command_Pa =
      pressure_Pa(clamp_force_N_);
}

double RigSimulation::pressure_Pa(double clamp_force_N) const {
  return (clamp_force_N - scenario_.variator.secondary_spring_force_N) /
         scenario_.variator.secondary_piston_area_m2;
}

// Between the torque flange and the belt.
double RigSimulation::loss_Nm(double acceleration_rad_s2) const {
  const estimator::MachineEffects e =
      with_learned(scenario_.effects, scenario_.learned, conditions(signals_));
  return e.loss_constant_Nm + e.loss_per_kN_Nm * 1e-3 * belt_force_N_ +
         e.loss_per_rad_s_Nm * plant_.state().omega_p_rad_s + e.inertia_kg_m2 * acceleration_rad_s2;
}

// What else acts on force, ratio and friction, from the state before this step.
void RigSimulation::act(bool begin) {
  constexpr double kCreepMax = 0.2;
  const estimator::LearnedConditions now = conditions(signals_);
  const estimator::MachineEffects e = with_learned(scenario_.effects, scenario_.learned, now);
  // The spring of the effects is in already.
  belt_force_N_ = std::max(1.0, clamping_.step(clamp_force_N_, signals_.omega_s_rad_s) +
                                    e.spring_N - scenario_.effects.spring_N);
  if (begin) reference_force_N_ = belt_force_N_;
  const double kN = 1e-3 * belt_force_N_;
  const bool low = scenario_.variator.ratio < 1.0;
  // The primary force counts as constant: F_p / F_s grows as the clamp force falls.
  const double lost = (low ? 1.0 : -1.0) * std::log(reference_force_N_ / belt_force_N_);
  crept_ =
      std::clamp(crept_ + e.creep_rate * signals_.omega_p_rad_s * lost * step_s_, 0.0, kCreepMax);
  const double ratio = (1.0 + (low ? e.end_stop_low : e.end_stop_overdrive)) *
                       (1.0 - e.deformation_per_kN * kN - e.deformation_per_kN2 * kN * kN) *
                       (1.0 - e.tilt_per_Nm * signals_.torque_p_Nm) *
                       std::exp(low ? crept_ : -crept_);
  friction_factor_ =
      friction_factor(e, {signals_.oil_degC, signals_.omega_p_rad_s, belt_force_N_, low ? 1.0 : 0.0,
                          seconds(), slip_energy_kJ_, scenario_.experiment}) *
      (1.0 + learned_at(scenario_.learned, estimator::LearnedPoint::kFriction, now));
  plant_.set_factors(ratio, friction_factor_);
}

double RigSimulation::sigma_star() const {
  const PlantState& state = plant_.state();
  return 1.0 - state.omega_s_rad_s / state.omega_p_rad_s / scenario_.variator.ratio;
}

// The operator: hold, lower, notice the slip, let go, rest, and again.
void RigSimulation::operate() {
  const double now_s = seconds();
  const double in_mode_s = now_s - mode_since_s_;
  const auto enter = [&](RigMode mode) {
    signals_.mode = mode;
    mode_since_s_ = now_s;
  };
  switch (signals_.mode) {
    case RigMode::kHold:
      if (in_mode_s >= scenario_.hold_s) {
        enter(RigMode::kLowering);
        noticed_s_.reset();
        was_below_peak_ = false;
        truth_.push_back({});
        truth_.back().mu_max = friction_factor_ * scenario_.friction().mu_max;
        truth_.back().start_s = now_s;
      }
      break;
    case RigMode::kLowering: {
      const bool reacts = noticed_s_ && now_s - *noticed_s_ >= scenario_.reaction_s &&
                          scenario_.action != OperatorAction::kNone;
      if (!reacts) {
        command_force_N_ -= scenario_.ramp_N_per_s * step_s_;
      } else if (!truth_.back().let_go_s) {
        truth_.back().let_go_s = now_s;
      }
      if (reacts && scenario_.action == OperatorAction::kRestore) {
        command_force_N_ += scenario_.grip_step_N;
        enter(RigMode::kRestoring);
      }
      break;
    }
    case RigMode::kRestoring:
      command_force_N_ += scenario_.restore_N_per_s * step_s_;
      if (command_force_N_ >= scenario_.start_force_N) enter(RigMode::kRest);
      break;
    case RigMode::kRest:
      if (in_mode_s >= scenario_.rest_s) {
        cycles_left_ -= 1.0;
        finished_ = cycles_left_ < 0.5;
        enter(RigMode::kHold);
      }
      break;
  }
  command_force_N_ = std::clamp(command_force_N_, scenario_.variator.secondary_spring_force_N,
                                scenario_.start_force_N);
}

void RigSimulation::observe(double slip_before_share, double sigma_star_before) {
  if (signals_.mode != RigMode::kLowering) return;
  ExperimentTruth& truth = truth_.back();
  const double peak_slip_share = scenario_.friction().peak_slip_percent / 100.0;
  const double slip_share = std::abs(plant_.output(belt_force_N_).slip_share);
  const double sigma = std::abs(sigma_star());
  if (!truth.peak_s) truth.mu_max = friction_factor_ * scenario_.friction().mu_max;
  const bool has_peak = scenario_.friction().shape != CurveShape::kSaturating;
  // A belt that slips from the start has no peak to pass.
  if (slip_share < peak_slip_share) was_below_peak_ = true;
  if (has_peak && !truth.peak_s && was_below_peak_ && slip_share >= peak_slip_share) {
    const double share =
        (peak_slip_share - slip_before_share) / std::max(slip_share - slip_before_share, 1e-12);
    truth.peak_s = seconds() - (1.0 - share) * step_s_;
    truth.slip_peak_percent = scenario_.friction().peak_slip_percent;
    truth.sigma_star_peak_percent =
        100.0 * (sigma_star_before + share * (sigma - sigma_star_before));
    truth.clamp_force_peak_N = belt_force_N_;
  }
  truth.sigma_star_max_percent = std::max(truth.sigma_star_max_percent, 100.0 * sigma);
  if (!noticed_s_ && 100.0 * sigma >= scenario_.operator_slip_percent) {
    noticed_s_ = seconds();
  }
}

void RigSimulation::step() {
  operate();
  // The hydraulics follow the command with a first-order lag, exact for a constant command.
  const double share =
      scenario_.actuator_lag_s > 0.0 ? -std::expm1(-step_s_ / scenario_.actuator_lag_s) : 1.0;
  clamp_force_N_ += share * (command_force_N_ - clamp_force_N_);

  act(false);
  const double slip_before_share = std::abs(plant_.output(belt_force_N_).slip_share);
  const double sigma_star_before = std::abs(sigma_star());
  const double omega_p_before = plant_.state().omega_p_rad_s;
  const double error_rad_s = scenario_.primary_speed_rad_s - omega_p_before;
  controller_torque_Nm_ += scenario_.speed_controller_Nm * error_rad_s * step_s_;
  PlantInput input;
  input.clamp_force_N = belt_force_N_;
  input.drive_torque_Nm =
      controller_torque_Nm_ + scenario_.speed_controller_Nm_s * error_rad_s - loss_Nm(0.0);
  input.drive_torque_slope_Nm_s = -scenario_.speed_controller_Nm_s;
  input.load_torque_Nm = load_torque_Nm_;
  plant_.step(input, step_s_);
  now_ns_ += step_ns_;

  const PlantState& state = plant_.state();
  // The flange sits between the machine's rotor and the pulley; the rotor holds the inertia.
  const PlantOutput belt = plant_.output(belt_force_N_);
  const double acceleration = (state.omega_p_rad_s - omega_p_before) / step_s_;
  signals_.torque_p_Nm = belt.torque_p_Nm + loss_Nm(acceleration);
  slip_energy_kJ_ +=
      1e-3 * std::abs(belt.torque_p_Nm * belt.slip_share) * state.omega_p_rad_s * step_s_;
  turn(state.omega_p_rad_s, state.omega_s_rad_s);
  signals_.torque_s_Nm = load_torque_Nm_;
  signals_.secondary_pressure_Pa = pressure_Pa(clamp_force_N_);
  signals_.secondary_pressure_command_Pa = pressure_Pa(command_force_N_);
  observe(slip_before_share, sigma_star_before);
  // A shaft that nearly stands: the rig's own protection switches off, and slip is no longer
  // defined.
  const bool stalled = state.omega_p_rad_s < kStall_rad_s;
  const double limit_s = scenario_.duration_s * std::round(scenario_.cycles);
  finished_ = finished_ || stalled || now_ns_ >= std::llround(limit_s * 1e9);
}

}  // namespace beltgrip::sim
