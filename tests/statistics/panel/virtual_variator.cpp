#include "virtual_variator.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "random.h"

namespace beltgrip::panel {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;
constexpr double kStep_s = 1e-3;
constexpr double kVehicleInertia = 4.0;  // of the car at the secondary, kg m^2
constexpr double kRpm = kTurn / 60.0;

double pick(Random& random, std::initializer_list<double> values) {
  return *(values.begin() + random.below(static_cast<int>(values.size())));
}

// One channel as frames on a bus: noise, rounding, and linear interpolation to the sample instants.
class Channel {
 public:
  Channel(const ChannelNoise& noise, estimator::ChannelAccuracy error, Random& random)
      : noise_(noise),
        error_(error),
        random_(random.bits()),
        period_s_(1.0 / noise.frame_rate_hz),
        next_s_(random.uniform() * period_s_ - period_s_),
        phase_(random.uniform() * kTurn) {}
  // Truth between two instants that are less than a period apart.
  void advance(double t_s, double truth, double previous_t_s, double previous_truth) {
    angle_ += 0.5 * (truth + previous_truth) * (t_s - previous_t_s);
    while (next_s_ <= t_s) {
      const double part =
          t_s > previous_t_s ? (next_s_ - previous_t_s) / (t_s - previous_t_s) : 1.0;
      const double at = previous_truth + std::max(0.0, part) * (truth - previous_truth);
      double value = at * (1.0 + error_.gain + noise_.ripple * std::sin(angle_ + phase_)) +
                     error_.bias + noise_.white * random_.normal();
      if (noise_.quantum > 0.0) value = noise_.quantum * std::round(value / noise_.quantum);
      times_.push_back(next_s_);
      values_.push_back(value);
      next_s_ += period_s_;
    }
  }
  double at(double t_s) {
    while (position_ + 2 < times_.size() && times_[position_ + 1] < t_s) ++position_;
    if (position_ + 1 >= times_.size()) return values_.back();
    const double part = (t_s - times_[position_]) / (times_[position_ + 1] - times_[position_]);
    return values_[position_] +
           std::clamp(part, 0.0, 1.0) * (values_[position_ + 1] - values_[position_]);
  }

 private:
  ChannelNoise noise_;
  estimator::ChannelAccuracy error_;
  Random random_;
  double period_s_, next_s_, phase_;
  double angle_ = 0.0;
  std::vector<double> times_, values_;
  std::size_t position_ = 0;
};

// The curve as a table: the plant asks for it some fifty times a step.
class CurveTable {
 public:
  explicit CurveTable(const FrictionCurve& curve) {
    for (int i = 0; i <= kSize; ++i) values_.push_back(curve.value(kSpacing * i));
  }
  double value(double slip) const {
    const double place = std::min(std::abs(slip) / kSpacing, kSize - 1.0);
    const auto index = static_cast<std::size_t>(place);
    const double part = place - static_cast<double>(index);
    const double mu = values_[index] + part * (values_[index + 1] - values_[index]);
    return slip < 0.0 ? -mu : mu;
  }

 private:
  static constexpr double kSpacing = 0.004;  // percent
  static constexpr int kSize = 15000;
  std::vector<double> values_;
};

// Root of a function that rises with its argument, near start: bracket, then regula falsi with
// halving (Illinois).
template <typename Function>
double solve(double start, Function function) {
  double low = start - 0.02, high = start + 0.02;
  double f_low = function(low), f_high = function(high);
  while (f_low > 0.0 && low > start - 50.0) f_low = function(low -= 4.0 * (high - low));
  while (f_high < 0.0 && high < start + 50.0) f_high = function(high += 4.0 * (high - low));
  for (int i = 0; i < 60 && high - low > 1e-10; ++i) {
    const double middle =
        i % 8 == 7 ? 0.5 * (low + high) : high - f_high * (high - low) / (f_high - f_low);
    const double f = function(middle);
    if (std::abs(f) < 1e-10) return middle;
    if (f > 0.0) {
      high = middle;
      f_high = f;
      f_low *= 0.5;
    } else {
      low = middle;
      f_low = f;
      f_high *= 0.5;
    }
  }
  return 0.5 * (low + high);
}

struct Point {
  double radius, ratio, sign, cosine;
};

Point point_of(const Scenario& s) {
  return {s.low ? s.variator.primary_radius_low_m : s.variator.primary_radius_overdrive_m,
          s.low ? s.variator.ratio_low : s.variator.ratio_overdrive, s.overrun ? -1.0 : 1.0,
          std::cos(s.variator.half_wedge_angle_rad)};
}

}  // namespace

const char* noise_name(NoiseClass noise) {
  constexpr const char* kNames[] = {"lab", "production", "harsh"};
  return kNames[static_cast<int>(noise)];
}

const char* plant_name(PlantKind plant) {
  constexpr const char* kNames[] = {"rig", "rig-heavy", "car-sensor", "car-engine"};
  return kNames[static_cast<int>(plant)];
}

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
}

Scenario draw_scenario(std::uint64_t seed) {
  Random r(seed);
  Scenario s;
  s.seed = seed;
  FrictionCurve& c = s.curve;
  c.family = static_cast<Family>(r.below(kFamilies));
  if (c.family == Family::kMonotone && r.chance(0.5)) c.family = Family::kKink;
  c.mu_max = r.between(0.06, 0.14);
  c.slip_peak = r.log_between(0.8, 5.0);
  c.fall_per_percent = r.log_between(5e-4, 8e-3);
  switch (c.family) {
    case Family::kKink:
      c.shape = r.between(1.6, 3.0);
      break;
    case Family::kMagic:
      c.shape = r.between(1.15, 1.6);
      break;
    case Family::kStribeck: {
      c.shape = r.between(2.0, 3.5);
      const double d = std::min(0.6, c.fall_per_percent * c.slip_peak / c.mu_max * 4.0);
      const double largest = 0.8 * d * std::exp(-1.0) / (1.0 - d * (1.0 - std::exp(-1.0)));
      while (c.shape * (1.0 / std::tanh(c.shape) - std::tanh(c.shape)) > largest) c.shape += 0.1;
      break;
    }
    case Family::kFlatTop:
      c.shape = r.between(0.15, 0.5) * c.slip_peak;
      break;
    case Family::kBrush:
      break;
    case Family::kBurckhardt:
      c.shape = r.between(3.0, 5.5);
      break;
    case Family::kMonotone:
      c.shape = r.between(0.0, 0.3);
      break;
  }
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
  s.hydraulic_lag_s = r.between(0.02, 0.15);
  const double start = r.between(0.3, 0.65) * c.mu_max;
  const Point p = point_of(s);
  const double force_peak = s.torque_Nm * p.cosine / (2.0 * p.radius * c.mu_max);
  const double longest_s = 45.0;
  const double force_start =
      std::min(force_peak * c.mu_max / start, force_peak + s.ramp_N_per_s * longest_s);
  s.mu_start = force_peak * c.mu_max / force_start;
  const double deformation_at_5kN = (r.chance(0.25) ? -1.0 : 1.0) * r.between(0.0, 0.02);
  // A pulley that is clamped harder is a bigger one: at most 2 % at the start of any trace.
  s.deformation_per_N = deformation_at_5kN / std::max(5000.0, force_start);
  if (r.chance(0.1)) s.mu_floor = r.between(0.7, 0.97) * c.mu_max;
  set_noise(s, static_cast<NoiseClass>(r.below(kNoiseClasses)));
  return s;
}

Scenario paper_scenario(std::uint64_t seed, double mu_max) {
  Random r(seed ^ 0x55AA55AAULL);
  Scenario s;
  s.seed = seed;
  s.curve = {Family::kKink, mu_max, r.between(1.6, 2.4), r.between(1e-3, 2.5e-3), 2.2};
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
  const double force = s.torque_Nm * p.cosine / (2.0 * p.radius * s.curve.mu_max);
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

const char* disturbance_name(Disturbance disturbance) {
  constexpr const char* kNames[kDisturbances] = {"none", "friction", "ratio", "torque", "rattle"};
  return kNames[static_cast<int>(disturbance)];
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

double mu_max_of(const Scenario& s) {
  return s.curve.mu_max * (s.disturbance == Disturbance::kFriction ? 1.0 - s.disturbed_by : 1.0);
}

Trace simulate(const Scenario& s) {
  Random r(s.seed ^ 0x3C3C3C3C3CULL);
  const Point p = point_of(s);
  const FrictionCurve& curve = s.curve;
  const CurveTable table(curve);
  const bool monotone = curve.family == Family::kMonotone;
  const bool car = s.plant == PlantKind::kCarSensor || s.plant == PlantKind::kCarEngine;
  const double primary_inertia = s.plant == PlantKind::kCarEngine
                                     ? s.variator.primary_inertia_kg_m2
                                     : 0.18;  // car with a torque sensor behind the engine
  const double force_by_mu = s.torque_Nm * p.cosine / (2.0 * p.radius);
  const double force_start = force_by_mu / s.mu_start;
  const double force_floor =
      std::max({force_by_mu / s.mu_floor, 0.1 * force_start, s.variator.secondary_spring_force_N});
  const double slip_reached = curve.slip_reached(0.005);

  Channel omega_p_sensor(s.omega_p, s.planted.omega_p, r);
  Channel omega_s_sensor(s.omega_s, s.planted.omega_s, r);
  Channel pressure_sensor(s.pressure, s.planted.secondary_pressure, r);
  Channel torque_sensor(s.torque, s.planted.torque, r);
  Random load(r.bits());

  // Slow variation of the load: two sines of random period.
  const double period_a = load.between(0.7, 2.0), period_b = load.between(2.0, 8.0);
  const double phase_a = load.uniform() * kTurn, phase_b = load.uniform() * kTurn;

  // Speeds: the belt force acts between them through the true slip.
  const auto true_ratio = [&](double force) {
    return p.ratio * (1.0 - s.deformation_per_N * force);
  };
  double omega_p = s.omega_p_rad_s;
  double omega_s = omega_p * true_ratio(force_start);
  double command = force_start, force = force_start;
  double belt_Nm = 0.0;  // signed, at the primary
  Trace out;
  double previous[4] = {omega_p, omega_s, 0.0, 0.0};
  std::vector<double> t_grid;
  const double sample_s = 1.0 / s.sample_rate_hz;
  double next_sample_s = 0.0;
  double end_s = 1e9;
  double slip = 0.0;
  double disturbed_s = 1e9;  // since then
  double friction = 1.0;
  for (std::int64_t k = 0; k < 400000; ++k) {
    const double t = static_cast<double>(k) * kStep_s;
    const double take_up = s.take_up_s > 0.0 ? std::min(1.0, 0.05 + t / s.take_up_s) : 1.0;
    const double variation = 1.0 + s.load_variation * (std::sin(kTurn * t / period_a + phase_a) +
                                                       std::sin(kTurn * t / period_b + phase_b));
    const double torque = p.sign * s.torque_Nm * take_up * variation;
    if (t > s.hold_s)
      command = std::max(force_floor, force_start - s.ramp_N_per_s * (t - s.hold_s));
    force += (command - force) * kStep_s / s.hydraulic_lag_s;
    const double disturbed = t > disturbed_s ? s.disturbed_by : 0.0;
    constexpr double kDrift_s = 0.3;
    const double drift = s.disturbance == Disturbance::kRatio
                             ? disturbed * std::min(1.0, (t - disturbed_s) / kDrift_s)
                             : 0.0;
    const double ratio = true_ratio(force) * (1.0 - drift);
    if (s.disturbance == Disturbance::kFriction) friction = 1.0 - disturbed;
    // Implicit step in the speed that gives way (rig: secondary, car: primary); the other one is
    // held (rig) or slow (car).
    const auto belt = [&](double wp, double ws) {
      slip = p.sign * 100.0 * (1.0 - ws / (ratio * wp));
      return p.sign * 2.0 * friction * table.value(slip) * force * p.radius / p.cosine;
    };
    if (car) {
      omega_p = solve(omega_p, [&](double trial) {
        return trial - omega_p - kStep_s / primary_inertia * (torque - belt(trial, omega_s));
      });
      belt_Nm = belt(omega_p, omega_s);
      const double road_Nm = 0.97 * s.torque_Nm * p.sign / p.ratio;
      omega_s += kStep_s / s.secondary_inertia * (belt_Nm / p.ratio - road_Nm) -
                 kStep_s * (s.overrun ? 0.5 : 0.0);
    } else {
      omega_s = solve(omega_s, [&](double trial) {
        return trial - omega_s -
               kStep_s / s.secondary_inertia * (belt(omega_p, trial) - torque) / p.ratio;
      });
      belt_Nm = belt(omega_p, omega_s);
    }
    const double centrifugal = s.variator.secondary_centrifugal_N_s2 * omega_s * omega_s;
    const double pressure = (force - s.variator.secondary_spring_force_N - centrifugal) /
                            s.variator.secondary_piston_area_m2;
    const double shaft_Nm = s.plant == PlantKind::kCarEngine ? torque : belt_Nm;
    const double read_Nm =
        shaft_Nm * (1.0 + (s.disturbance == Disturbance::kTorque ? disturbed : 0.0));
    constexpr double kRattle_hz = 17.0;
    const double rattle =
        s.disturbance == Disturbance::kRattle ? disturbed * std::sin(kTurn * kRattle_hz * t) : 0.0;
    const double truth[4] = {omega_p * (1.0 + rattle), omega_s * (1.0 - 0.5 * rattle), pressure,
                             read_Nm};
    const double previous_t = k == 0 ? 0.0 : t - kStep_s;
    if (k == 0) std::copy(std::begin(truth), std::end(truth), std::begin(previous));
    omega_p_sensor.advance(t, truth[0], previous_t, previous[0]);
    omega_s_sensor.advance(t, truth[1], previous_t, previous[1]);
    pressure_sensor.advance(t, pressure, previous_t, previous[2]);
    torque_sensor.advance(t, read_Nm, previous_t, previous[3]);
    std::copy(std::begin(truth), std::end(truth), std::begin(previous));

    const double mu = friction * table.value(slip);
    const double slip_star = p.sign * 100.0 * (1.0 - omega_s / omega_p / p.ratio);
    const double mu_star = std::abs(belt_Nm) * p.cosine / (2.0 * p.radius * force);
    if (!monotone && out.t_reached_s > 1e8 && slip >= slip_reached) out.t_reached_s = t;
    if (!monotone && !out.peak_reached && slip >= curve.slip_peak) {
      out.peak_reached = true;
      out.t_peak_s = t;
      out.slip_star_peak = slip_star;
    }
    if (disturbed_s > 1e8 && mu >= s.disturbed_from * curve.mu_max) disturbed_s = t;
    if (!monotone && slip >= slip_reached && mu >= 0.995 * curve.mu_max) {
      out.slip_star_leave = std::max(out.slip_star_leave, slip_star);
    }
    if (t + 1e-9 >= next_sample_s) {
      t_grid.push_back(t);
      out.slip_star.push_back(slip_star);
      out.slip.push_back(slip);
      out.mu.push_back(mu_star);
      out.clamp_N.push_back(force);
      out.torque_belt_Nm.push_back(belt_Nm);
      out.mu_largest = std::max(out.mu_largest, mu);
      next_sample_s += sample_s;
    }
    // The trace goes on to 30 % of slip; or five seconds on the floor, thirty beyond the peak.
    const bool on_floor = command <= force_floor && t > s.hold_s;
    if (end_s > 1e8 && on_floor) end_s = t + 5.0;
    if (end_s < 1e8 && out.peak_reached) end_s = std::max(end_s, out.t_peak_s + 30.0);
    if (slip > 30.0 || t > end_s) break;
    if (car && (omega_p < 20.0 || omega_s < 5.0)) break;
  }
  if (!out.peak_reached) out.slip_star_peak = out.slip_star.back();
  for (std::size_t i = 0; i < t_grid.size(); ++i) {
    const double t = t_grid[i];
    out.samples.push_back({.t_ns = static_cast<std::int64_t>(std::llround(t * 1e9)) + 1'000'000'000,
                           .omega_p_rad_s = omega_p_sensor.at(t),
                           .omega_s_rad_s = omega_s_sensor.at(t),
                           .secondary_pressure_Pa = pressure_sensor.at(t),
                           .torque_Nm = torque_sensor.at(t),
                           .usable = true});
  }
  return out;
}

std::string describe(const Scenario& s) {
  char text[300];
  std::snprintf(text, sizeof text,
                "%llu %s mu=%.4f pk=%.2f fall=%.2e shape=%.2f %s %s %s %s T=%.0f wp=%.0f ramp=%.0f "
                "def=%.2e J=%.2f start=%.3f floor=%.3f hold=%.1f fr=%g/%g/%g/%g",
                static_cast<unsigned long long>(s.seed), family_name(s.curve.family),
                s.curve.mu_max, s.curve.slip_peak, s.curve.fall_per_percent, s.curve.shape,
                s.overrun ? "overrun" : "drive", s.low ? "low" : "od", plant_name(s.plant),
                noise_name(s.noise), s.torque_Nm, s.omega_p_rad_s, s.ramp_N_per_s,
                s.deformation_per_N, s.secondary_inertia, s.mu_start / s.curve.mu_max,
                s.mu_floor / s.curve.mu_max, s.hold_s, s.omega_p.frame_rate_hz,
                s.omega_s.frame_rate_hz, s.pressure.frame_rate_hz, s.torque.frame_rate_hz);
  return text;
}

}  // namespace beltgrip::panel
