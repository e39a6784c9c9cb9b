#include "tests/statistics/campaign/reach.h"

#include <algorithm>
#include <cmath>

#include "tools/sim/friction_curve.h"
#include "tools/sim/vehicle_simulation.h"

namespace beltgrip::test {

namespace {

// Chosen: the slip rate of the crossing. Slower costs energy, faster runs past.
constexpr double kSlipRate_1_s = 0.03;
constexpr double kSlipDetectable_share = 0.008;       // chosen: to tell a flat top
constexpr double kSlipDetectableSteep_share = 0.003;  // and a steep fall
constexpr double kDecision_s = 0.05;                  // chosen: of a detector, after that slip
constexpr double kFrame_s = 0.01;                     // a clamp frame every 10 ms
constexpr double kSlipSpeed_m_s = 0.8;                // promise G1
constexpr double kEnergy_J = 100.0;                   // promise G1
// Measured on a simulation of other make: the steepest fall that ends inside G1, of the steepest
// that is caught at all.
constexpr double kInsideG1 = 0.8;
constexpr double kSpare_s = 0.5;  // before the drive takes the way away again
constexpr double kLook_s = 0.01;
// How far behind the peak its fall is looked for.
constexpr double kFallOver = 0.02;
// Between the classes of tests/statistics/panel/drawing.cpp: 0.023, 0.058 and 0.142 % of slip at
// 105 and 236 rad/s; the geometric means.
constexpr double kLabMost_percent = 0.036;
constexpr double kProductionMost_percent = 0.091;
constexpr double kPercent = 100.0;

double steepest_fall(const sim::FrictionCurve& curve) {
  constexpr int kSteps = 40;
  double steepest = 0.0;
  for (int i = 1; i <= kSteps; ++i) {
    const double slip_share = curve.fall_slip_share() + kFallOver * i / kSteps;
    steepest = std::max(steepest, -sim::friction_at(curve, slip_share).slope);
  }
  return steepest;
}

// The least force that a request brings onto the belt: the valve's floor or the user's, whichever
// is higher, the controller's, and what sticks in the cylinder.
double floor_N(const sim::VehicleScenario& scenario, const RequestKeys& keys, double omega_s) {
  const sim::VariatorParameters& v = scenario.variator;
  const double pressure_Pa =
      std::max(keys.pressure_floor_Pa, scenario.hydraulics.pressure_floor_Pa);
  const double valve_N = v.secondary_spring_force_N + v.secondary_piston_area_m2 * pressure_Pa +
                         v.secondary_centrifugal_N_s2 * omega_s * omega_s;
  return std::max(valve_N, scenario.tcu.force_floor_N) + scenario.hydraulics.friction_force_N;
}

ReachPoint point_of(const sim::VehicleSimulation& vehicle, const RequestKeys& keys) {
  const sim::VehicleScenario& scenario = vehicle.scenario();
  const sim::DrivelineOutput& belt = vehicle.truth().belt;
  ReachPoint point;
  point.torque_Nm = std::abs(belt.belt_torque_Nm);
  point.omega_p_rad_s = vehicle.signals().omega_p_rad_s;
  point.primary_radius_m = belt.primary_radius_m;
  point.wedge_cosine = std::cos(scenario.variator.half_wedge_angle_rad);
  point.inertia_kg_m2 = scenario.engine.inertia_kg_m2 + scenario.variator.primary_inertia_kg_m2;
  point.own_force_N = vehicle.truth().own_force_N;
  point.floor_N = floor_N(scenario, keys, vehicle.signals().omega_s_rad_s);
  point.mu_max = belt.mu_max;
  point.peak_slip_share = belt.peak_slip_share;
  point.fall = kPercent * keys.fall_max_per_percent;
  point.dead_time_s = scenario.hydraulics.dead_time_s;
  point.lag_s = scenario.hydraulics.lag_s;
  return point;
}

// One coast-down at a time: since when it lasts, and how far its instants come.
class CoastDown {
 public:
  explicit CoastDown(const RequestKeys& keys) : keys_(keys) {}

  void step(double t_s, const sim::VehicleSimulation& vehicle) {
    const bool coasts = vehicle.tcu().permitted && vehicle.signals().accelerator <= 0.0 &&
                        vehicle.truth().belt.belt_torque_Nm < 0.0;
    if (!coasts) {
      end(t_s);
      return;
    }
    if (!coasts_) begun_s_ = t_s;
    coasts_ = true;
    const ReachPoint point = point_of(vehicle, keys_);
    Wall wall = wall_at(point);
    if (wall == Wall::kNone) {
      // A request first lowers the force that far.
      const double ramp_s =
          (point.own_force_N - reach_peak_force_N(point)) / keys_.ramp_rate_max_N_per_s;
      wall = Wall::kTime;
      if (t_s >= begun_s_ + ramp_s && first_s_ < 0.0) first_s_ = t_s;
    }
    furthest_ = std::max(furthest_, wall);
  }
  void end(double t_s) {
    if (first_s_ >= 0.0 && t_s >= first_s_ + kSpare_s) {
      furthest_ = Wall::kNone;
      if (t_s - first_s_ > to_s_ - from_s_) {
        from_s_ = first_s_;
        to_s_ = t_s;
      }
    }
    coasts_ = false;
    first_s_ = -1.0;
  }
  Wall furthest() const { return furthest_; }
  double from_s() const { return from_s_; }
  double to_s() const { return to_s_; }

 private:
  RequestKeys keys_;
  bool coasts_ = false;
  double begun_s_ = 0.0;
  double first_s_ = -1.0;  // in reach, of this coast-down
  double from_s_ = 0.0, to_s_ = 0.0;
  Wall furthest_ = Wall::kFloor;
};

}  // namespace

double reach_peak_force_N(const ReachPoint& point) {
  return point.torque_Nm * point.wedge_cosine / (2.0 * point.primary_radius_m * point.mu_max);
}

bool caught(const ReachPoint& point) {
  const double fall = point.fall / kInsideG1;
  const double w = point.torque_Nm / (point.inertia_kg_m2 * point.omega_p_rad_s);
  const double a = w * fall / point.mu_max;
  const double y = kSlipRate_1_s / w;
  const double told_s = kDecision_s + kFrame_s + point.dead_time_s;
  const double g = point.own_force_N / reach_peak_force_N(point) - 1.0 + y;
  const double slip_share =
      (kSlipDetectableSteep_share + w * y / a) * std::exp(a * told_s) - w * y / a;
  return slip_share < point.mu_max / fall * (g / (1.0 + a * point.lag_s) - y);
}

double crossing_energy_J(const ReachPoint& point) {
  const double lasts_s = kSlipDetectable_share / kSlipRate_1_s + kDecision_s + kFrame_s +
                         point.dead_time_s + point.lag_s;
  return point.torque_Nm * point.omega_p_rad_s * point.peak_slip_share * lasts_s;
}

double slip_noise_percent2_s(const SpeedNoise& primary, const SpeedNoise& secondary,
                             double omega_p_rad_s, double omega_s_rad_s) {
  const double white =
      std::hypot(primary.white_rad_s / omega_p_rad_s, secondary.white_rad_s / omega_s_rad_s);
  return std::hypot(white, std::hypot(primary.ripple, secondary.ripple) / std::sqrt(2.0));
}

Wall wall_at(const ReachPoint& point) {
  if (point.floor_N >= reach_peak_force_N(point)) return Wall::kFloor;
  const double slip_most_share = kSlipSpeed_m_s / (point.omega_p_rad_s * point.primary_radius_m);
  if (point.peak_slip_share + kSlipDetectable_share >= slip_most_share) return Wall::kSlipSpeed;
  if (crossing_energy_J(point) >= kEnergy_J) return Wall::kEnergy;
  return caught(point) ? Wall::kNone : Wall::kFall;
}

Reach reach_of(const sim::VehicleScenario& scenario, const RequestKeys& keys, std::uint64_t seed) {
  sim::VehicleSimulation vehicle(scenario, seed);
  CoastDown coast(keys);
  Reach reach;
  double next_s = 0.0, omega_p_rad_s = 0.0, omega_s_rad_s = 0.0, t_s = 0.0;
  while (!vehicle.finished() && vehicle.finite()) {
    vehicle.step();
    t_s = static_cast<double>(vehicle.now_ns()) * 1e-9;
    if (t_s < next_s) continue;
    next_s += kLook_s;
    coast.step(t_s, vehicle);
    if (!vehicle.tcu().permitted) continue;
    omega_p_rad_s = vehicle.signals().omega_p_rad_s;
    omega_s_rad_s = vehicle.signals().omega_s_rad_s;
    reach.peak_slip_percent = kPercent * vehicle.truth().belt.peak_slip_share;
  }
  coast.end(t_s);
  reach.wall = coast.furthest();
  reach.from_s = coast.from_s();
  reach.to_s = coast.to_s();
  const sim::FrictionCurve& curve = scenario.belt.overdrive;
  if (curve.shape == sim::CurveShape::kSaturating) reach.wall = Wall::kNoPeak;
  const bool falls = steepest_fall(curve) > kPercent * keys.fall_max_per_percent;
  if (reach.wall == Wall::kNone && falls) reach.wall = Wall::kFall;
  const sim::SensorParameters& s = scenario.sensors;
  if (omega_p_rad_s > 0.0) {
    reach.slip_noise_percent =
        kPercent * slip_noise_percent2_s({s.primary_speed.noise, s.primary_ripple},
                                         {s.secondary_speed.noise, s.secondary_ripple},
                                         omega_p_rad_s, omega_s_rad_s);
  }
  reach.noise = reach.slip_noise_percent < kLabMost_percent          ? NoiseBand::kLab
                : reach.slip_noise_percent < kProductionMost_percent ? NoiseBand::kProduction
                                                                     : NoiseBand::kHarsh;
  return reach;
}

}  // namespace beltgrip::test
