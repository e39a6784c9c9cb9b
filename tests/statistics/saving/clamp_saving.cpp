#include "tests/statistics/saving/clamp_saving.h"

#include <algorithm>
#include <cmath>

#include "estimator/physics/least_loss.h"
#include "tools/sim/hydraulic_actuator.h"

namespace beltgrip::saving {
namespace {

constexpr double kTurning_rad_s = 50.0;  // slower the belt carries nothing that counts
constexpr std::int64_t kSample_ns = 10'000'000;

// The friction that an experiment finds, where it is least.
double known_friction(const sim::VehicleScenario& s) {
  return s.belt.overdrive.mu_max * std::min(1.0, s.belt.low_mu_factor);
}

// What one side of the pair loses in this sample.
void count(const sim::VehicleScenario& s, const sim::VehicleTruth& truth, double omega_p_rad_s,
           double force_N, double pressure_Pa, double for_s, Side& side) {
  const sim::DrivelineOutput& belt = truth.belt;
  sim::FrictionCurve curve = s.belt.overdrive;
  curve.mu_max = belt.mu_max;
  curve.peak_slip_percent = 100.0 * belt.peak_slip_share;
  const double torque_Nm = std::abs(belt.belt_torque_Nm);
  const double mu = torque_Nm * std::cos(s.variator.half_wedge_angle_rad) /
                    (2.0 * belt.primary_radius_m * force_N);
  if (mu >= curve.mu_max) side.at_top_s += for_s;
  const double belt_Nm = s.variator.primary_loss_Nm + s.variator.primary_loss_Nm_per_N * force_N;
  side.force_N += force_N * for_s;
  side.belt_W += belt_Nm * omega_p_rad_s * for_s;
  side.slip_W += torque_Nm * omega_p_rad_s * carrying_slip_share(curve, mu) * for_s;
  side.pump_W += estimator::pump_torque_Nm(pressure_Pa) * omega_p_rad_s * for_s;
}

// The secondary circuit as it would be under the law.
class OtherCircuit {
 public:
  OtherCircuit(const sim::VehicleScenario& scenario, const Law& law)
      : scenario_(scenario), law_(law), actuator_(scenario.hydraulics, scenario.step_s) {}

  void step(const sim::VehicleSimulation& vehicle) {
    const sim::VariatorParameters& v = scenario_.variator;
    const double omega_s = vehicle.signals().omega_s_rad_s;
    const sim::VehicleTruth& truth = vehicle.truth();
    const double beside_N =
        v.secondary_spring_force_N + v.secondary_centrifugal_N_s2 * omega_s * omega_s;
    const double command_N = min_clamp_command_N(scenario_, law_, truth.own_force_N,
                                                 truth.belt.primary_radius_m, omega_s);
    const double command_Pa = (command_N - beside_N) / v.secondary_piston_area_m2;
    if (!started_) actuator_.settle(command_Pa);
    started_ = true;
    pressure_Pa_ = actuator_.step(
        command_Pa, sim::oil_slowness(scenario_.hydraulics, vehicle.signals().oil_degC));
    force_N_ = play_.step(v.secondary_piston_area_m2 * pressure_Pa_ + beside_N,
                          scenario_.hydraulics.friction_force_N);
  }
  double force_N() const { return force_N_; }
  double pressure_Pa() const { return pressure_Pa_; }

 private:
  const sim::VehicleScenario& scenario_;
  Law law_;
  sim::HydraulicActuator actuator_;
  sim::CoulombPlay play_;
  bool started_ = false;
  double force_N_ = 0.0, pressure_Pa_ = 0.0;
};

void divide(Side& side, double time_s) {
  for (double* each : {&side.force_N, &side.belt_W, &side.slip_W, &side.pump_W}) *each /= time_s;
}

bool counts(const sim::VehicleSimulation& vehicle) {
  return vehicle.signals().omega_p_rad_s >= kTurning_rad_s && vehicle.signals().lockup_closed > 0.5;
}

}  // namespace

double min_clamp_command_N(const sim::VehicleScenario& s, const Law& law, double own_force_N,
                           double primary_radius_m, double omega_s_rad_s) {
  const sim::VariatorParameters& v = s.variator;
  const double per_mu_Nm_per_N = 2.0 * primary_radius_m / std::cos(v.half_wedge_angle_rad);
  // The torque that the own law reckons with; at its floor, that which it would hold there.
  const double torque_Nm =
      own_force_N * per_mu_Nm_per_N * s.tcu.design_friction - s.tcu.torque_reserve_Nm;
  const double needed_N =
      law.safety_factor * (torque_Nm + law.reserve_Nm) / (per_mu_Nm_per_N * known_friction(s));
  const double floor_N = v.secondary_spring_force_N +
                         v.secondary_centrifugal_N_s2 * omega_s_rad_s * omega_s_rad_s +
                         v.secondary_piston_area_m2 * s.hydraulics.pressure_floor_Pa;
  return std::min(own_force_N, std::max(needed_N, floor_N));
}

double carrying_slip_share(const sim::FrictionCurve& curve, double mu) {
  double low = 0.0, high = curve.peak_slip_percent / 100.0;
  if (mu >= curve.mu_max) return high;
  for (int i = 0; i < 30; ++i) {
    const double middle = 0.5 * (low + high);
    (sim::friction_at(curve, middle).mu < mu ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

Paired paired_drive(const sim::VehicleScenario& scenario, std::uint64_t seed, const Law& law) {
  sim::VehicleSimulation vehicle(scenario, seed);
  OtherCircuit other(scenario, law);
  Paired sum;
  std::int64_t next_ns = 0;
  while (!vehicle.finished()) {
    vehicle.step();
    other.step(vehicle);
    if (vehicle.now_ns() < next_ns) continue;
    next_ns += kSample_ns;
    if (!counts(vehicle)) continue;
    const double for_s = 1e-9 * static_cast<double>(kSample_ns);
    const double omega_p = vehicle.signals().omega_p_rad_s;
    sum.locked_s += for_s;
    count(scenario, vehicle.truth(), omega_p, vehicle.truth().secondary_force_N,
          vehicle.signals().secondary_pressure_Pa, for_s, sum.own);
    count(scenario, vehicle.truth(), omega_p, other.force_N(), other.pressure_Pa(), for_s,
          sum.min_clamp);
  }
  divide(sum.own, sum.locked_s);
  divide(sum.min_clamp, sum.locked_s);
  return sum;
}

double gross_slip_s(sim::VehicleScenario scenario, std::uint64_t seed, const Law& law) {
  scenario.tcu.design_friction = known_friction(scenario) / law.safety_factor;
  scenario.tcu.torque_reserve_Nm = law.reserve_Nm;
  sim::VehicleSimulation vehicle(scenario, seed);
  double slipping_s = 0.0;
  while (!vehicle.finished()) {
    vehicle.step();
    const sim::DrivelineOutput& belt = vehicle.truth().belt;
    if (counts(vehicle) && std::abs(belt.slip_share) > belt.fall_slip_share)
      slipping_s += scenario.step_s;
  }
  return slipping_s;
}

}  // namespace beltgrip::saving
