#include "drawing.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <numbers>

#include "random.h"

namespace beltgrip::panel {
namespace {

constexpr double kRpm = 2.0 * std::numbers::pi / 60.0;
constexpr double kVehicleInertia = 4.0;  // of the car at the secondary, kg m^2
constexpr double kMostLossShare = 0.02;  // of the torque, at each shaft

double pick(Random& random, std::initializer_list<double> values) {
  return *(values.begin() + random.below(static_cast<int>(values.size())));
}

}  // namespace

namespace {

constexpr double kRisingShare = 0.2;
constexpr int kFamiliesWithPeak = kFamilies - 1;  // rising comes last

double draw_shape(Random& r, Family family) {
  switch (family) {
    case Family::kMagic:
      return r.between(-4.0, 0.5);
    case Family::kStribeck:
      return r.between(1.0, 5.0);
    case Family::kPlateau:
      return r.between(0.0, 3.0);
    case Family::kExponential:
      return r.between(2.5, 6.0);
    case Family::kPower:
      return r.between(1.8, 4.0);
    case Family::kRising:
      return r.between(0.05, 0.6);
    case Family::kRational:
    case Family::kSpline:
      break;
  }
  return 0.0;
}

// On the rise a power law, each knot moved by up to this, kept in order.
Knots draw_knots(Random& r) {
  constexpr double kMoved = 0.03, kApart = 0.01;
  const double exponent = r.between(1.8, 3.5);
  Knots knots{};
  double below = 0.0;
  for (std::size_t i = 0; i < 3; ++i) {
    const double u = 0.25 * static_cast<double>(i + 1);
    const double plain = 1.0 - std::pow(1.0 - u, exponent);
    knots[i] = std::clamp(plain + r.between(-kMoved, kMoved), below + kApart, 1.0 - kApart);
    below = knots[i];
  }
  knots[3] = r.between(0.1, 0.45);
  knots[4] = r.between(1.2, 2.5);
  return knots;
}

}  // namespace

FrictionCurve draw_curve(Random& r) {
  const bool rising = r.chance(kRisingShare);
  const double mu_max = r.between(0.06, 0.14);
  const double slip_peak_percent = r.between(kPeakFrom_percent, kPeakTo_percent);
  const double fall = r.log_between(kLeastFall_per_percent, kMostFall_per_percent);
  // Not every family has a curve of this peak and fall: draw on until one has.
  for (;;) {
    const Family family =
        rising ? Family::kRising : static_cast<Family>(r.below(kFamiliesWithPeak));
    const double shape = draw_shape(r, family);
    const FrictionCurve curve(family, mu_max, slip_peak_percent, fall, shape, draw_knots(r));
    if (curve.possible()) return curve;
  }
}

namespace {

// Signals of a car: engine torque every 10 to 40 ms, late; a pressure that shares a multiplexed
// frame or comes slowly.
void set_car_signals(Scenario& s, Random& r) {
  if (s.plant == PlantKind::kCarEngine) {
    s.torque.frame_rate_hz = pick(r, {100.0, 50.0, 25.0});
    s.torque_lag_s = r.between(0.01, 0.08);
  }
  constexpr double kSlowShare = 0.35;
  if (r.chance(kSlowShare)) s.pressure.frame_rate_hz = pick(r, {25.0, 50.0 / 3.0, 12.5, 10.0, 5.0});
}

}  // namespace

void set_noise(Scenario& s, NoiseClass noise) {
  Random r(s.seed ^ 0xA5A5A5A5ULL);
  s.noise = noise;
  switch (noise) {
    case NoiseClass::kLab:
      s.omega_p = {0.02, pick(r, {0.0, 0.01}), 200.0, 0.0};
      s.omega_s = {0.03, pick(r, {0.0, 0.01}), 200.0, 0.0};
      s.pressure = {3e3, pick(r, {0.0, 1e3}), 200.0, 0.0};
      s.torque = {r.between(0.2, 0.5), pick(r, {0.0, 0.1}), 200.0, 0.0};
      break;
    case NoiseClass::kProduction:
      s.omega_p = {0.05, pick(r, {0.125, 0.25, 0.5}) * kRpm, pick(r, {100.0, 200.0}), 2e-4};
      s.omega_s = {0.08, pick(r, {0.125, 0.25, 0.5}) * kRpm, pick(r, {100.0, 200.0}), 2e-4};
      s.pressure = {10e3, pick(r, {2e3, 5e3, 10e3}), pick(r, {50.0, 100.0, 200.0}), 0.0};
      s.torque = {r.between(0.5, 1.0), pick(r, {0.25, 0.5, 1.0}), pick(r, {50.0, 100.0}), 0.0};
      break;
    case NoiseClass::kHarsh:
      s.omega_p = {0.12, pick(r, {0.25, 1.0}) * kRpm, pick(r, {50.0, 100.0}), 4e-4};
      s.omega_s = {0.20, pick(r, {0.25, 1.0}) * kRpm, pick(r, {50.0, 100.0}), 4e-4};
      s.pressure = {25e3, pick(r, {10e3, 20e3, 40e3}), pick(r, {20.0, 50.0, 100.0}), 0.0};
      s.torque = {r.between(1.5, 2.5), pick(r, {0.5, 1.0}), pick(r, {20.0, 50.0, 100.0}), 0.0};
      break;
  }
  if (is_car(s.plant) && noise != NoiseClass::kLab) set_car_signals(s, r);
}

Scenario draw_scenario(std::uint64_t seed) {
  Random r(seed);
  Scenario s;
  s.seed = seed;
  s.curve = draw_curve(r);
  s.overrun = r.chance(0.5);
  s.low = r.chance(0.4);
  s.torque_Nm = r.log_between(15.0, 100.0);
  s.ramp_N_per_s = r.log_between(26.0, 600.0);
  s.omega_p_rad_s = r.between(90.0, 220.0);
  const int plant = r.below(4);
  s.plant = static_cast<PlantKind>(plant);
  if (s.plant == PlantKind::kRigHeavy) s.secondary_inertia = r.between(1.0, 4.0);
  if (s.plant == PlantKind::kRig) s.secondary_inertia = r.between(0.3, 0.8);
  const bool car = plant >= 2;
  if (car) s.secondary_inertia = kVehicleInertia;
  s.variator.primary_inertia_kg_m2 = s.plant == PlantKind::kCarEngine ? r.between(0.12, 0.25) : 0.0;
  s.variator.secondary_centrifugal_N_s2 = r.chance(0.3) ? 9.5e-3 : 0.0;
  s.hold_s = r.between(0.8, 4.0);
  s.take_up_s = r.chance(0.15) ? r.between(0.2, 1.0) : 0.0;
  s.load_variation = r.chance(0.5) ? r.between(0.0, 0.01) : 0.0;
  s.hydraulic_lag_s = r.between(0.02, 0.2);
  s.primary_loss_share = r.between(0.0, kMostLossShare);
  s.secondary_loss_share = r.between(0.0, kMostLossShare);
  const double start = r.between(0.3, 0.65) * s.curve.mu_max();
  const Point p = point_of(s);
  const double force_peak = s.torque_Nm * p.cosine / (2.0 * p.radius * s.curve.mu_max());
  const double longest_s = 45.0;
  const double force_start =
      std::min(force_peak * s.curve.mu_max() / start, force_peak + s.ramp_N_per_s * longest_s);
  s.mu_start = force_peak * s.curve.mu_max() / force_start;
  const double deformation_at_5kN = (r.chance(0.25) ? -1.0 : 1.0) * r.between(0.0, 0.02);
  // A pulley that is clamped harder is a bigger one: at most 2 % at the start of any trace.
  s.deformation_per_N = deformation_at_5kN / std::max(5000.0, force_start);
  if (r.chance(0.1)) s.mu_floor = r.between(0.7, 0.97) * s.curve.mu_max();
  set_noise(s, static_cast<NoiseClass>(r.below(kNoiseClasses)));
  return s;
}

Scenario paper_scenario(std::uint64_t seed, double mu_max) {
  Random r(seed ^ 0x55AA55AAULL);
  Scenario s;
  s.seed = seed;
  const double slip_peak_percent = r.between(1.6, 2.4), fall = r.between(1e-3, 2.5e-3);
  s.curve = {Family::kExponential, mu_max, slip_peak_percent, fall, 4.4};
  s.torque_Nm = 50.0;
  s.ramp_N_per_s = 26.0;
  s.mu_start = 0.06;
  s.deformation_per_N = r.between(0.01, 0.02) / 5000.0;
  set_noise(s, NoiseClass::kLab);
  return s;
}

void plant_sensor_errors(Scenario& s) {
  Random r(s.seed ^ 0x77777777ULL);
  const double width = s.noise == NoiseClass::kLab ? 0.3 : 1.0;
  s.accuracies.torque = {width * 0.02 * s.torque_Nm, width * 0.02};
  const Point p = point_of(s);
  const double force = s.torque_Nm * p.cosine / (2.0 * p.radius * s.curve.mu_max());
  s.accuracies.secondary_pressure = {width * 0.02 * force / s.variator.secondary_piston_area_m2,
                                     width * 0.01};
  s.accuracies.omega_p = {0.0, 5e-4};
  s.accuracies.omega_s = {0.0, 5e-4};
  s.planted.torque = {s.accuracies.torque.bias * r.normal(), s.accuracies.torque.gain * r.normal()};
  s.planted.secondary_pressure = {s.accuracies.secondary_pressure.bias * r.normal(),
                                  s.accuracies.secondary_pressure.gain * r.normal()};
  s.planted.omega_p.gain = s.accuracies.omega_p.gain * r.normal();
  s.planted.omega_s.gain = s.accuracies.omega_s.gain * r.normal();
}

void plant_disturbance(Scenario& s, Disturbance disturbance) {
  Random r(s.seed ^ 0x66666666ULL);
  s.disturbance = disturbance;
  s.disturbed_from = r.between(0.75, 0.97);
  const double sign = r.chance(0.5) ? -1.0 : 1.0;
  constexpr double kLargest[kDisturbances] = {0.0, 0.08, 0.01, 0.1, 0.01};
  const double largest = kLargest[static_cast<int>(disturbance)];
  s.disturbed_by = sign * r.between(0.5 * largest, largest);
}

}  // namespace beltgrip::panel
