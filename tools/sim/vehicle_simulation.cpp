#include "tools/sim/vehicle_simulation.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tools/sim/learned_conditions.h"

namespace beltgrip::sim {

namespace {

constexpr double kAbsFrequency_Hz = 8.0;
constexpr double kRolling_m_s = 3.0;
constexpr double kSettle_s = 3.0;  // before time zero: hydraulics and controller find their state

}  // namespace

VehicleSimulation::VehicleSimulation(const VehicleScenario& scenario, std::uint64_t seed)
    : Simulation(scenario),
      scenario_(scenario),
      driver_(scenario.driver, scenario.duration_s, seed),
      engine_(scenario.engine),
      plant_(scenario),
      tcu_(scenario, faults_),
      secondary_(scenario.hydraulics, scenario.step_s),
      primary_(scenario.hydraulics, scenario.step_s),
      clamping_(scenario.effects, scenario.step_s),
      end_ns_(std::llround(scenario.duration_s * 1e9)),
      cycle_ns_(std::llround(scenario.tcu.cycle_s * 1e9)) {
  const double speed = scenario.driver.start_speed_m_s;
  const double omega_s = speed * scenario.body.final_drive / scenario.body.wheel_radius_m;
  const double ratio = std::clamp(omega_s / scenario.tcu.coast_engine_speed_rad_s,
                                  scenario.variator.ratio_low, scenario.variator.ratio_overdrive);
  plant_.settle(speed, ratio, scenario.engine.idle_rad_s);
  secondary_.settle(1e6);
  primary_.settle(1e6);
  // Clutch, pressures and ratio settle at standing start conditions; then time begins.
  now_ns_ = -std::llround(kSettle_s * 1e9);
  next_cycle_ns_ = now_ns_;
  signals_.oil_degC = scenario.hydraulics.oil_start_degC;
  while (now_ns_ < 0) step();
}

void VehicleSimulation::deliver(const can::CanFrame& frame, std::int64_t t_ns) {
  to_tcu_.push_back({t_ns, frame});
}

void VehicleSimulation::control(double t_s, const DriverOutput& driver) {
  while (!to_tcu_.empty() && to_tcu_.front().t_ns <= now_ns_) {
    tcu_.receive(to_tcu_.front().frame, t_s);
    to_tcu_.pop_front();
  }
  if (now_ns_ < next_cycle_ns_) return;
  next_cycle_ns_ += cycle_ns_;
  TcuInput input;
  input.omega_e_rad_s = plant_.state().omega_e_rad_s;
  input.omega_p_rad_s = plant_.state().omega_p_rad_s;
  input.omega_s_rad_s = plant_.state().omega_s_rad_s;
  input.speed_m_s = plant_.speed_m_s();
  input.torque_e_Nm = engine_.reported_torque_Nm();
  input.torque_requested_Nm = engine_.requested_torque_Nm();
  input.ratio = plant_.state().ratio;
  input.accelerator = driver.accelerator;
  input.brake_m_s2 = driver.brake_m_s2;
  input.oil_degC = signals_.oil_degC;
  input.engine_running = engine_.running();
  input.wheel_slip = faults_.active(FaultKind::kAbs, t_s) != nullptr;
  input.primary_radius_m = plant_.primary_radius_m(input.ratio);
  tcu_.cycle(t_s, input);
}

void VehicleSimulation::step() {
  const double t_s = seconds();
  const HydraulicParameters& hydraulics = scenario_.hydraulics;
  DriverOutput driver = driver_.step(std::max(t_s, 0.0), plant_.speed_m_s(), step_s_);
  if (const FaultStep* fault = faults_.active(FaultKind::kAccelerator, t_s)) {
    driver = {fault->size, 0.0};
  }
  if (const FaultStep* fault = faults_.active(FaultKind::kBrake, t_s)) {
    driver = {0.0, fault->size};
  }
  control(t_s, driver);

  if (t_s >= 0.0) {
    signals_.oil_degC +=
        step_s_ / hydraulics.oil_warming_s * (hydraulics.oil_end_degC - signals_.oil_degC);
  }
  double slow = oil_slowness(hydraulics, signals_.oil_degC);
  if (const FaultStep* fault = faults_.active(FaultKind::kHydraulicLag, t_s)) slow *= fault->size;
  const TcuOutput& tcu = tcu_.output();
  const double follows = secondary_.follows(slow);
  const double p_s = secondary_.step(tcu.secondary_pressure_Pa, slow, follows);
  const double p_p = primary_.step(tcu.primary_pressure_Pa, slow, follows);

  const DrivelineState& state = plant_.state();
  const VariatorParameters& v = scenario_.variator;
  DrivelineInput input;
  input.conditions = conditions(signals_);
  input.conditions.primary_speed_rad_s = state.omega_p_rad_s;
  const double model_force_N =
      v.secondary_piston_area_m2 * p_s + v.secondary_spring_force_N +
      v.secondary_centrifugal_N_s2 * state.omega_s_rad_s * state.omega_s_rad_s;
  input.secondary_force_N =
      clamping_.step(play_.step(model_force_N, hydraulics.friction_force_N), state.omega_s_rad_s);
  input.secondary_force_N =
      std::max(1.0, input.secondary_force_N + learned_at(scenario_.learned,
                                                         estimator::LearnedPoint::kClampForce,
                                                         input.conditions));
  input.primary_force_N = v.primary_piston_area_m2 * p_p +
                          v.primary_centrifugal_N_s2 * state.omega_p_rad_s * state.omega_p_rad_s;
  const FaultStep* torque_step = faults_.active(FaultKind::kTorqueStep, t_s);
  input.engine_torque_Nm = engine_.step(driver.accelerator, state.omega_e_rad_s,
                                        torque_step != nullptr ? torque_step->size : 0.0, step_s_);
  input.lockup_capacity_Nm = tcu.lockup_capacity_Nm;
  input.brake_Nm = driver.brake_m_s2 * scenario_.body.mass_kg * scenario_.body.wheel_radius_m /
                   scenario_.body.final_drive;
  if (const FaultStep* fault = faults_.active(FaultKind::kAbs, t_s)) {
    const double phase = 2.0 * std::numbers::pi * kAbsFrequency_Hz * faults_.since_s(*fault, t_s);
    input.disturbance_Nm += fault->size * (0.5 - 0.5 * std::cos(phase));
  }
  if (const FaultStep* fault = faults_.active(FaultKind::kPothole, t_s)) {
    input.disturbance_Nm += fault->size;
  }
  input.oil_degC = signals_.oil_degC;
  input.wear = t_s >= scenario_.belt.wear_at_s ? scenario_.belt.wear_step : 0.0;
  input.time_s = t_s;
  input.slip_energy_kJ = slip_energy_kJ_;
  plant_.step(input, step_s_);
  slip_energy_kJ_ += 1e-3 * plant_.output().slip_power_W * step_s_;
  now_ns_ += step_ns_;

  turn(state.omega_p_rad_s, state.omega_s_rad_s);
  signals_.omega_e_rad_s = state.omega_e_rad_s;
  signals_.torque_e_Nm = engine_.reported_torque_Nm();
  signals_.accelerator = driver.accelerator;
  signals_.secondary_pressure_Pa = p_s;
  signals_.primary_pressure_Pa = p_p;
  signals_.secondary_pressure_command_Pa = std::max(0.0, tcu.secondary_pressure_Pa);
  signals_.speed_m_s = plant_.speed_m_s();
  signals_.brake_pressed = driver.brake_m_s2 > 0.0 ? 1.0 : 0.0;
  signals_.lockup_closed = tcu.lockup_closed ? 1.0 : 0.0;
  signals_.experiment_permitted = tcu.permitted ? 1.0 : 0.0;
  truth_.belt = plant_.output();
  truth_.secondary_force_N = input.secondary_force_N;
  truth_.ratio = state.ratio;
  truth_.obeying = tcu.obeying;
  truth_.own_force_N = tcu.own_force_N;
  truth_.engine_running = engine_.running();
  truth_.stalls = engine_.stalls();
  count_coast_downs(driver);
  observe(seconds());
}

void VehicleSimulation::count_coast_downs(const DriverOutput& driver) {
  const bool coasting = driver.accelerator <= 0.0 && driver.brake_m_s2 <= 0.0 &&
                        plant_.speed_m_s() > kRolling_m_s && now_ns_ > 0;
  const double before_s = coasting_s_;
  coasting_s_ = coasting ? coasting_s_ + step_s_ : 0.0;
  if (before_s < VehicleTruth::kCoast_s && coasting_s_ >= VehicleTruth::kCoast_s) {
    ++truth_.coast_downs;
  }
}

void VehicleSimulation::observe(double t_s) {
  const int begun = tcu_.output().requests;
  if (static_cast<int>(requests_.size()) < begun) {
    if (!requests_.empty()) requests_.back().over = true;
    requests_.push_back({});
    requests_.back().begin_s = t_s;
    requests_.back().end_s = t_s;
    requests_.back().force_min_N = truth_.secondary_force_N;
  }
  if (requests_.empty() || requests_.back().over) return;
  RequestTruth& request = requests_.back();
  const DrivelineOutput& belt = truth_.belt;
  const double slip_share = std::abs(belt.slip_share);
  if (truth_.obeying) {
    request.end_s = t_s;
    request.slip_at_end_share = slip_share;
  } else if (t_s > request.end_s + RequestTruth::kAfter_s) {
    request.over = true;
    return;
  }
  if (!request.peak_passed) {
    request.mu_max = belt.mu_max;
    request.peak_passed = slip_share >= belt.peak_slip_share;
    request.peak_passed_s = t_s;
  }
  request.slip_max_share = std::max(request.slip_max_share, slip_share);
  request.slip_speed_max_m_s = std::max(request.slip_speed_max_m_s, belt.slip_speed_m_s);
  request.mu_star_max = std::max(request.mu_star_max, std::abs(belt.mu));
  request.force_min_N = std::min(request.force_min_N, truth_.secondary_force_N);
  if (slip_share > belt.fall_slip_share) request.macro_energy_J += belt.slip_power_W * step_s_;
}

}  // namespace beltgrip::sim
