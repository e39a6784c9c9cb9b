#include "tests/statistics/blind/generator.h"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <numbers>

namespace beltgrip::blind {

double Random::uniform() {
  state_ += 0x9E3779B97F4A7C15ULL;
  std::uint64_t z = state_;
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
  return static_cast<double>((z ^ (z >> 31)) >> 11) * 0x1.0p-53;
}
double Random::log_uniform(double low, double high) {
  return low * std::pow(high / low, uniform());
}
double Random::normal() {
  if (have_spare_) {
    have_spare_ = false;
    return spare_;
  }
  const double r = std::sqrt(-2.0 * std::log(1.0 - uniform()));
  const double a = 2.0 * std::numbers::pi * uniform();
  spare_ = r * std::sin(a);
  have_spare_ = true;
  return r * std::cos(a);
}

namespace {

constexpr double kStep_s = 1e-3;
constexpr double kCosTheta = 0.98162718344766398;  // cos 11 degrees
constexpr double kArea_m2 = 0.0113;
constexpr double kBeltLength_m = 0.703;
constexpr double kSpring_N = 500.0;
constexpr double kConfiguredInertia = 0.18;

// Everything the planted effects change, by name; absent is zero.
class Faults {
 public:
  explicit Faults(const std::vector<Planted>& planted) {
    for (const Planted& each : planted) {
      for (const auto& [name, value] : each.parameters) {
        values_[each.effect + "." + name] = value;
      }
      if (each.effect == "channel_skew") skew_role_ = each.role;
    }
  }
  double operator()(const std::string& name) const {
    const auto found = values_.find(name);
    return found == values_.end() ? 0.0 : found->second;
  }
  double skew_s(const std::string& role) const {
    return role == skew_role_ ? (*this)("channel_skew.delay_s") : 0.0;
  }

 private:
  std::map<std::string, double> values_;
  std::string skew_role_;
};

double curve(Law law, double s, double fall) {  // s = slip / slip at the peak, >= 0
  double rise = 0.0;
  switch (law) {
    case Law::kTanh:
      rise = std::tanh(2.2 * s) / std::tanh(2.2);
      break;
    case Law::kExponential:
      rise = (1.0 - std::exp(-3.0 * s)) / (1.0 - std::exp(-3.0));
      break;
    case Law::kStribeck:
      rise = 1.06 * s * (1.9 + s) / (0.55 + 1.5 * s + 1.024 * s * s);
      break;
  }
  if (law == Law::kStribeck) return rise / (1.06 * 2.9 / 3.074);
  if (s <= 1.0) return rise;
  return 1.0 - fall * (s - 1.0);
}

// A history of one quantity on the 1 ms grid, read at any time.
class Track {
 public:
  void push(double v) { values_.push_back(v); }
  double at(double t_s) const {
    const double x = std::clamp(t_s / kStep_s, 0.0, static_cast<double>(values_.size() - 1));
    const auto i = std::min(static_cast<std::size_t>(x), values_.size() - 2);
    const double f = x - static_cast<double>(i);
    return (1.0 - f) * values_[i] + f * values_[i + 1];
  }
  double mean(double t_s, double width_s) const {  // anti-alias: the mean over the sample period
    double sum = 0.0;
    for (int i = 0; i < 5; ++i) sum += at(t_s - width_s * (i + 0.5) / 5.0 + 0.5 * width_s);
    return sum / 5.0;
  }

 private:
  std::vector<double> values_;
};

struct History {
  Track omega_p, omega_s, pressure, command, torque_p, torque_s, temperature, pressure_p;
  Track angle_p, angle_s;
};

class Experiment {
 public:
  Experiment(const Trial& trial, int index, Random& random)
      : trial_(trial), m_(trial.machine), fault_(trial.planted), index_(index), random_(random) {}

  History run();

 private:
  double friction_level(double t_s, double force_N, double omega_p, double omega_s,
                        double energy_J);
  double deformation(double force_kN) const;
  double ratio_now(double force_N, double torque_Nm) const;

  const Trial& trial_;
  const Machine& m_;
  Faults fault_;
  int index_;
  Random& random_;
  double level_ = 0.0, seat_ = 0.0, zero_Nm_ = 0.0;
  double creep_ = 0.0;
  double temperature_C_ = 80.0;
  double hidden_phase_ = 0.0, belt_phase_ = 0.0;
  double pressure_p_Pa_ = 0.0, torque_now_Nm_ = 0.0;
};

double Experiment::friction_level(double t_s, double force_N, double omega_p, double omega_s,
                                  double energy_J) {
  double mu = m_.mu_max * (1.0 + level_);
  mu *= 1.0 + fault_("friction_temperature.per_K") * (temperature_C_ - 80.0);
  mu *= 1.0 + fault_("friction_speed.per_ln_speed") * std::log(omega_p / 105.0);
  mu *= std::pow(force_N / 3000.0, -fault_("friction_load.exponent"));
  if (trial_.plan[static_cast<std::size_t>(index_)].low) {
    mu *= 1.0 + fault_("friction_ratio.relative");
  }
  if (fault_("wear.step") != 0.0 && index_ >= static_cast<int>(fault_("wear.at"))) {
    mu *= 1.0 - fault_("wear.step");
  }
  mu *= 1.0 - fault_("wear.per_experiment") * index_;
  mu *= 1.0 + fault_("warm_up_drift.per_kJ") * energy_J * 1e-3;
  mu *= 1.0 + fault_("warm_up_drift.per_start") * (1.0 - std::exp(-t_s / 30.0));
  // Outside the library.
  mu *= 1.0 + fault_("x_friction_primary_pressure.size") * (pressure_p_Pa_ / 1e6 - 1.5);
  mu *= 1.0 + fault_("x_friction_torque.size") * (std::abs(torque_now_Nm_) - 50.0) / 50.0;
  mu *= 1.0 +
        fault_("x_friction_speed_bump.size") * std::exp(-std::pow((omega_p - 150.0) / 25.0, 2.0));
  mu *= 1.0 - std::abs(fault_("x_friction_dip.size")) *
                  std::exp(-std::pow((temperature_C_ - 70.0) / 8.0, 2.0));
  mu *= 1.0 + fault_("x_friction_hidden.size") * std::sin(0.9 * t_s + hidden_phase_);
  static_cast<void>(omega_s);
  return mu;
}

// From 0 to 1 about 6 kN, most of it within 1 kN.
double sets_in(double force_kN) { return 0.5 * (1.0 + std::tanh((force_kN - 6.0) / 0.5)); }

double Experiment::deformation(double force_kN) const {
  return (m_.deformation_per_kN + fault_("pulley_deformation.per_kN")) * force_kN +
         fault_("pulley_deformation.per_kN2") * force_kN * force_kN;
}

double Experiment::ratio_now(double force_N, double torque_Nm) const {
  const bool low = trial_.plan[static_cast<std::size_t>(index_)].low;
  const double kN = force_N * 1e-3;
  double ratio = low ? 0.405 * (1.0 + m_.ratio_error_low) : 2.25 * (1.0 + m_.ratio_error_overdrive);
  ratio *= 1.0 + fault_(low ? "end_stop_ratio.low" : "end_stop_ratio.overdrive") + seat_;
  ratio *= 1.0 - deformation(kN);
  ratio *= 1.0 - fault_("radius_tilt.per_Nm") * torque_Nm;
  ratio *= 1.0 + fault_("x_ratio_temperature.size") * (temperature_C_ - 80.0) / 50.0;
  ratio *= 1.0 + fault_("x_ratio_force_step.size") * sets_in(kN);
  ratio *= 1.0 + fault_("x_belt_passage.size") * std::sin(belt_phase_);
  return ratio * std::exp(low ? creep_ : -creep_);
}

History Experiment::run() {
  const PlannedRun& plan = trial_.plan[static_cast<std::size_t>(index_)];
  const double radius = plan.low ? 0.0324 : 0.0784;
  const double nominal_ratio = plan.low ? 0.405 : 2.25;
  const double peak_slip_share =
      (plan.low ? m_.peak_slip_low_share : m_.peak_slip_overdrive_share) *
      (1.0 + fault_("friction_shape.peak_slip_relative"));
  const double fall = std::max(0.0, m_.fall_per_unit + fault_("friction_shape.fall_per_unit"));
  level_ = std::hypot(m_.scatter_friction, fault_("x_friction_between.size")) * random_.normal();
  seat_ = m_.scatter_ratio * random_.normal();
  zero_Nm_ = m_.scatter_torque_Nm * random_.normal();
  hidden_phase_ = random_.uniform(0.0, 6.28);
  const double drift_K = random_.uniform(-3.0, 6.0);
  const bool car = m_.setting == Setting::kCar;
  const double sign = plan.torque_Nm < 0.0 ? -1.0 : 1.0;
  const double held_N = std::abs(plan.torque_Nm) * kCosTheta / (2.0 * radius * m_.mu_max);

  History h;
  double force_wanted_N = 1.9 * held_N;
  double omega_p = plan.speed_rad_s, omega_s = omega_p * nominal_ratio * 0.995;
  double slip_share = 0.0, energy_J = 0.0, acting_Pa = -1.0, play_N = 0.0, swing_Pa = 0.0;
  double angle_p = random_.uniform(0.0, 6.28), angle_s = random_.uniform(0.0, 6.28);
  double belt_before = plan.torque_Nm;
  double hold_s = 3.0;
  int direction = -1;
  const double slip_limit_share = random_.uniform(1.35, 2.2) * peak_slip_share;
  const double sweep_phase = random_.uniform(0.0, 6.28);
  const double step_period_s = random_.uniform(4.0, 7.0);
  bool first = true;
  Track command_track;
  const int steps = static_cast<int>(plan.duration_s / kStep_s) + 100;
  for (int i = 0; i < steps; ++i) {
    const double t = i * kStep_s;
    temperature_C_ = plan.temperature_C + drift_K * (1.0 - std::exp(-t / 40.0));
    // The operator: clamp force.
    const bool moves = plan.profile == Profile::kRamps || plan.profile == Profile::kTriangles ||
                       plan.profile == Profile::kMixed;
    if (hold_s > 0.0) {
      hold_s -= kStep_s;
    } else if (moves) {
      if (plan.profile == Profile::kTriangles) {
        force_wanted_N += direction * plan.ramp_N_s * kStep_s;
        if (force_wanted_N < 1.18 * held_N) direction = 1;
        if (force_wanted_N > 1.9 * held_N) direction = -1;
      } else if (direction < 0) {
        force_wanted_N -= plan.ramp_N_s * kStep_s;
        if (std::abs(slip_share) > slip_limit_share || force_wanted_N < 0.5 * held_N) direction = 1;
      } else {
        force_wanted_N += 8.0 * held_N * kStep_s;
        if (force_wanted_N >= 1.9 * held_N) {
          force_wanted_N = 1.9 * held_N;
          direction = -1;
          hold_s = 2.0;
        }
      }
    } else {
      force_wanted_N = 1.35 * held_N;
    }
    // Speed and torque set points.
    double speed = plan.speed_rad_s, speed_rate = 0.0;
    double torque = plan.torque_Nm;
    if (plan.profile == Profile::kSpeedSweep || plan.profile == Profile::kMixed) {
      const double a = plan.profile == Profile::kMixed ? 0.06 : 0.25;
      const double w = 2.0 * std::numbers::pi / (plan.profile == Profile::kMixed ? 11.0 : 9.0);
      speed *= 1.0 + a * std::sin(w * t + sweep_phase);
      speed_rate = plan.speed_rad_s * a * w * std::cos(w * t + sweep_phase);
    }
    if (plan.profile == Profile::kTorqueSteps) {
      const double x = std::fmod(t, step_period_s) / step_period_s;
      const double edge = std::clamp((x < 0.5 ? x : x - 0.5) * step_period_s / 0.4, 0.0, 1.0);
      const double smooth = edge * edge * (3.0 - 2.0 * edge);
      torque *= x < 0.5 ? 0.65 + 0.35 * smooth : 1.0 - 0.35 * smooth;
    }
    torque_now_Nm_ = torque;
    // Pressure and force.
    if (m_.pressure_swings_Pa > 0.0) {
      constexpr double kOver_s = 0.3;
      swing_Pa += -swing_Pa * kStep_s / kOver_s +
                  m_.pressure_swings_Pa * std::sqrt(2.0 * kStep_s / kOver_s) * random_.normal();
    }
    const double pressure_wanted =
        std::max(2e4, (force_wanted_N - kSpring_N) / kArea_m2 + swing_Pa);
    command_track.push(pressure_wanted);
    const double tau = fault_("hydraulic_lag.time_constant_s");
    const double in =
        i > 1 ? command_track.at(t - fault_("hydraulic_lag.delay_s")) : pressure_wanted;
    if (acting_Pa < 0.0) acting_Pa = in;
    acting_Pa = tau > 0.0 ? acting_Pa + (in - acting_Pa) * (1.0 - std::exp(-kStep_s / tau)) : in;
    double force = kArea_m2 * acting_Pa + kSpring_N +
                   fault_("centrifugal_force.coefficient_N_s2") * omega_s * omega_s +
                   fault_("spring_force.force_N");
    const double friction_N = fault_("clamp_hysteresis.force_N");
    if (friction_N > 0.0) {
      // Where it rests when the recording begins: whatever went before.
      if (first) play_N = force + friction_N * (static_cast<double>(trial_.seed % 3) - 1.0);
      play_N = std::clamp(play_N, force - friction_N, force + friction_N);
      force = play_N;
    }
    force *= 1.0 +
             fault_("x_force_ripple.size") *
                 std::sin(2.0 * std::numbers::pi * fault_("x_force_ripple.hz") * t + hidden_phase_);
    force = std::max(force, 100.0);
    pressure_p_Pa_ = (plan.low ? 0.6e6 : 1.6e6) + 0.35e6 * std::sin(0.35 * t + sweep_phase);
    if (const double rate = fault_("ratio_creep.rate"); rate > 0.0 && !first) {
      // The holding side loses: primary pressure below its start at overdrive, above it in low.
      const double begin = (plan.low ? 0.6e6 : 1.6e6) + 0.35e6 * std::sin(sweep_phase);
      const double begin_N = 1.9 * held_N;
      const double ln_force_ratio = std::log(pressure_p_Pa_ / begin) - std::log(force / begin_N);
      const double lost = plan.low ? ln_force_ratio : -ln_force_ratio;
      creep_ = std::max(0.0, creep_ + rate * omega_p * lost * kStep_s);
    }
    // Belt: one implicit step in slip. T_belt = 2 R F mu(slip) / cos(theta).
    const double mu = friction_level(t, force, omega_p, omega_s, energy_J);
    const double ratio = ratio_now(force, belt_before);
    const double torque_ratio =
        m_.torque_ratio_stays ? ratio / (1.0 - deformation(force * 1e-3)) : ratio;
    const double capacity = 2.0 * radius * force * mu / kCosTheta;
    const auto belt = [&](double s) {
      const double x = std::abs(s) / peak_slip_share;
      const double wave = 1.0 + fault_("x_friction_form.size") * std::sin(12.0 * x);
      return std::copysign(capacity * wave * curve(m_.law, x, fall), s);
    };
    double belt_torque = 0.0;
    const double loss = m_.loss_Nm + m_.loss_per_speed_Nms * omega_p +
                        fault_("torque_loss.constant_Nm") +
                        fault_("torque_loss.per_kN_Nm") * force * 1e-3 +
                        fault_("torque_loss.per_rad_s_Nm") * omega_p +
                        fault_("x_loss_temperature.size") * (80.0 - temperature_C_) / 40.0 +
                        fault_("x_loss_force_step.size") * sets_in(force * 1e-3);
    const auto drag = [&](double w) {
      return m_.secondary_loss_Nm + fault_("secondary_loss.constant_Nm") +
             (m_.secondary_loss_per_speed_Nms + fault_("secondary_loss.per_rad_s_Nm")) * w;
    };
    double acceleration_p = 0.0, acceleration_s = 0.0;
    double torque_p = 0.0, load_s = 0.0;
    if (!car) {
      omega_p = speed;
      acceleration_p = speed_rate;
      load_s =
          torque / nominal_ratio - m_.secondary_inertia_kg_m2 * speed_rate * nominal_ratio * 0.0;
      if (first) omega_s = omega_p * ratio * (1.0 - sign * 0.3 * peak_slip_share);
      // J_s d(omega_s)/dt = T_belt(omega_s_next) / ratio - load
      const auto residual = [&](double w) {
        return w - omega_s -
               kStep_s / m_.secondary_inertia_kg_m2 *
                   (belt(1.0 - w / (omega_p * ratio)) / torque_ratio - load_s - drag(w));
      };
      double low = omega_p * ratio * 0.3, high = omega_p * ratio * 1.9;
      double w = omega_s;
      for (int k = 0; k < 60; ++k) {  // safeguarded secant on a monotone stretch
        const double r = residual(w);
        (r > 0.0 ? high : low) = w;
        const double d = 1e-6 * omega_p;
        const double slope = (residual(w + d) - r) / d;
        double next = slope > 0.0 ? w - r / slope : 0.5 * (low + high);
        if (!(next > low && next < high)) next = 0.5 * (low + high);
        if (std::abs(next - w) < 1e-10 * omega_p) break;
        w = next;
      }
      acceleration_s = (w - omega_s) / kStep_s;
      omega_s = w;
      slip_share = 1.0 - omega_s / (omega_p * ratio);
      belt_torque = belt(slip_share);
      // The sensor sits between the drive's inertia and the pulley: no inertia torque in it.
      torque_p = belt_torque + loss + fault_("inertia_torque.inertia_kg_m2") * acceleration_p;
    } else {
      omega_s = speed * nominal_ratio;
      acceleration_s = speed_rate * nominal_ratio;
      const double inertia = m_.primary_inertia_kg_m2 + fault_("inertia_torque.inertia_kg_m2");
      if (first) omega_p = omega_s / (ratio * (1.0 - sign * 0.3 * peak_slip_share));
      const auto residual = [&](double w) {
        return w - omega_p -
               kStep_s / inertia * (torque - loss - belt(1.0 - omega_s / (w * ratio)));
      };
      double low = omega_s / ratio * 0.5, high = omega_s / ratio * 2.0;
      double w = omega_p;
      for (int k = 0; k < 60; ++k) {
        const double r = residual(w);
        (r > 0.0 ? high : low) = w;
        const double d = 1e-6 * omega_p;
        const double slope = (residual(w + d) - r) / d;
        double next = slope > 0.0 ? w - r / slope : 0.5 * (low + high);
        if (!(next > low && next < high)) next = 0.5 * (low + high);
        if (std::abs(next - w) < 1e-10 * omega_p) break;
        w = next;
      }
      acceleration_p = (w - omega_p) / kStep_s;
      omega_p = w;
      slip_share = 1.0 - omega_s / (omega_p * ratio);
      belt_torque = belt(slip_share);
      torque_p = torque;
      load_s =
          belt_torque / torque_ratio - m_.secondary_inertia_kg_m2 * acceleration_s - drag(omega_s);
    }
    belt_before = belt_torque;
    energy_J += std::abs(belt_torque * slip_share) * omega_p * kStep_s;
    angle_p += omega_p * kStep_s;
    belt_phase_ += 2.0 * std::numbers::pi * omega_p * radius / kBeltLength_m * kStep_s;
    angle_s += omega_s * kStep_s;
    h.omega_p.push(omega_p);
    h.omega_s.push(omega_s);
    h.pressure.push(
        pressure_wanted);  // without a command in the table, lag and delay come after it
    h.command.push(pressure_wanted);
    h.torque_p.push((torque_p + zero_Nm_) *
                    (1.0 + fault_("x_gain_temperature.size") * (temperature_C_ - 80.0) / 50.0 +
                     fault_("x_gain_speed.size") * (omega_p - 105.0) / 100.0));
    h.torque_s.push(load_s);
    h.temperature.push(temperature_C_);
    h.pressure_p.push(pressure_p_Pa_);
    h.angle_p.push(angle_p);
    h.angle_s.push(angle_s);
    first = false;
  }
  return h;
}

void append(std::string& out, double value, char end) {
  char buffer[32];
  const auto result =
      std::to_chars(buffer, buffer + sizeof buffer, value, std::chars_format::general, 9);
  out.append(buffer, result.ptr);
  out.push_back(end);
}

}  // namespace

Recording record(const Trial& trial) {
  Recording out;
  const Machine& m = trial.machine;
  const Faults fault(trial.planted);
  for (std::size_t e = 0; e < trial.plan.size(); ++e) {
    Random random(trial.seed * 1000003ULL + e * 7919ULL + 17ULL);
    History h = Experiment(trial, static_cast<int>(e), random).run();
    const bool car = m.setting == Setting::kCar;
    const bool output = m.setting == Setting::kRig;
    std::string csv = "t[s],primary_speed[rad/s],secondary_speed[rad/s],secondary_pressure[Pa],";
    csv += car ? "engine_torque[Nm]" : "primary_torque[Nm]";
    if (output) csv += ",secondary_torque[Nm]";
    if (m.has_primary_pressure) csv += ",primary_pressure[Pa]";
    if (m.has_temperature) csv += ",oil_temperature[degC]";
    csv += "\n";
    const double period = 1.0 / m.sample_rate_hz;
    const auto noise = [&] {
      double z = random.normal();
      if (m.heavy_tails) {  // Student's t with four degrees of freedom, unit variance
        double chi = 0.0;
        for (int i = 0; i < 4; ++i) {
          const double g = random.normal();
          chi += g * g;
        }
        z *= std::sqrt(2.0 / chi);
      }
      return z;
    };
    double coloured = 0.0;
    const int samples = static_cast<int>(trial.plan[e].duration_s * m.sample_rate_hz);
    for (int i = 0; i < samples; ++i) {
      const double stamp = i * period;
      const double t = std::max(0.0, stamp + 2e-4 * random.normal());  // clock jitter
      const auto speed = [&](const Track& track, const Track& angle, const char* role) {
        const double at = t - fault.skew_s(role);
        double w = track.mean(at, period);
        const bool primary = role[0] == 'p';
        w *= 1.0 + fault(primary ? "speed_scale.primary" : "speed_scale.secondary");
        w *= 1.0 + fault(primary ? "speed_ripple.primary" : "speed_ripple.secondary") *
                       std::sin(angle.at(at));
        w *= 1.0 + m.noise_speed * noise();
        return std::round(w / 0.01) * 0.01;
      };
      append(csv, 12.5 + stamp, ',');
      append(csv, speed(h.omega_p, h.angle_p, "primary_speed"), ',');
      append(csv, speed(h.omega_s, h.angle_s, "secondary_speed"), ',');
      const double p = h.pressure.mean(t - fault.skew_s("secondary_pressure"), period) *
                           (1.0 + fault("pressure_gain.gain")) +
                       fault("pressure_offset.offset_Pa") + m.noise_pressure_Pa * noise();
      append(csv, std::round(p / m.pressure_step_Pa) * m.pressure_step_Pa, ',');
      coloured = 0.97 * coloured + 0.03 * 4.0 * noise();
      const double torque =
          h.torque_p.mean(t - fault("torque_delay.delay_s") -
                              fault.skew_s(car ? "engine_torque" : "primary_torque"),
                          period) *
              (1.0 + fault("torque_gain.gain")) +
          fault("torque_bias.bias_Nm") + m.noise_torque_Nm * (noise() + 0.2 * coloured);
      append(csv, torque, output || m.has_primary_pressure || m.has_temperature ? ',' : '\n');
      if (output) {
        append(csv, h.torque_s.mean(t, period) + m.noise_torque_Nm * noise(),
               m.has_primary_pressure || m.has_temperature ? ',' : '\n');
      }
      if (m.has_primary_pressure) {
        append(csv, h.pressure_p.mean(t, period) + m.noise_pressure_Pa * noise(),
               m.has_temperature ? ',' : '\n');
      }
      if (m.has_temperature) {
        append(csv, std::round(2.0 * (h.temperature.mean(t, period) + 0.1 * noise())) / 2.0, '\n');
      }
    }
    out.csv.push_back(std::move(csv));
    out.seconds += trial.plan[e].duration_s;
  }
  return out;
}

Machine draw_machine(Random& random) {
  Machine m;
  const double which = random.uniform();
  m.setting = which < 0.6   ? Setting::kRig
              : which < 0.8 ? Setting::kRigNoOutputTorque
                            : Setting::kCar;
  m.law = static_cast<Law>(random.below(3));
  m.mu_max = random.uniform(0.088, 0.112);
  m.peak_slip_overdrive_share = random.uniform(0.013, 0.026);
  m.peak_slip_low_share = m.peak_slip_overdrive_share * random.uniform(1.1, 1.8);
  m.fall_per_unit = random.uniform(0.01, 0.05);
  m.deformation_per_kN = random.uniform(0.4e-3, 1.8e-3);
  m.loss_Nm = random.uniform(0.0, 1.2);
  m.loss_per_speed_Nms = random.uniform(0.0, 0.008);
  m.ratio_error_overdrive = 4e-4 * random.normal();
  m.ratio_error_low = 4e-4 * random.normal();
  m.secondary_inertia_kg_m2 = random.uniform(0.1, 0.5);
  m.primary_inertia_kg_m2 = kConfiguredInertia;
  m.scatter_friction = random.uniform(1e-3, 5e-3);
  m.scatter_ratio = random.uniform(0.5e-4, 2e-4);
  m.scatter_torque_Nm = random.uniform(0.02, 0.1);
  m.noise_speed = random.log_uniform(1e-4, 6e-4);
  m.noise_pressure_Pa = random.log_uniform(500.0, 4000.0);
  m.noise_torque_Nm = random.log_uniform(0.1, 0.5);
  m.sample_rate_hz = random.uniform() < 0.75 ? 100.0 : 200.0;
  // From a stream of its own: what follows is drawn as it was before there was any drag.
  Random behind_belt(std::bit_cast<std::uint64_t>(m.mu_max));
  if (behind_belt.uniform() < 0.5) {
    m.secondary_loss_Nm = behind_belt.uniform(0.0, 1.5);
    m.secondary_loss_per_speed_Nms = behind_belt.uniform(0.0, 0.004);
  }
  return m;
}

std::vector<PlannedRun> draw_plan(Random& random, Setting setting, int runs) {
  std::vector<PlannedRun> plan;
  const auto draw = [&] {
    PlannedRun run;
    run.low = random.uniform() < 0.35;
    constexpr std::array<double, 5> kSpeeds{80.0, 105.0, 150.0, 200.0, 250.0};
    run.speed_rad_s =
        kSpeeds[static_cast<std::size_t>(random.below(5))] * random.uniform(0.95, 1.05);
    run.torque_Nm = random.uniform(15.0, run.low ? 60.0 : 110.0);
    if (setting == Setting::kCar && random.uniform() < 0.4) {
      run.torque_Nm = -random.uniform(20.0, 40.0);
    }
    constexpr std::array<double, 4> kTemperatures{40.0, 60.0, 80.0, 100.0};
    run.temperature_C =
        kTemperatures[static_cast<std::size_t>(random.below(4))] + random.uniform(-4.0, 4.0);
    run.ramp_N_s = random.log_uniform(60.0, 500.0);
    run.profile = static_cast<Profile>(random.below(5));
    return run;
  };
  PlannedRun reference = draw();
  reference.low = false;
  reference.torque_Nm = 50.0;
  reference.profile = Profile::kRamps;
  for (int i = 0; i < runs; ++i) {
    PlannedRun run = draw();
    if (i == 0 || i == runs / 2 || i == runs - 1) run = reference;
    if (i < 5 && i > 0) run.profile = static_cast<Profile>(i);  // each kind at least once
    plan.push_back(run);
  }
  return plan;
}

std::vector<PlannedRun> paper_plan(int runs) {
  PlannedRun run;
  run.ramp_N_s = 80.0;
  return std::vector<PlannedRun>(static_cast<std::size_t>(runs), run);
}

const std::vector<Plantable>& plantables() {
  static const std::vector<Plantable> kAll{
      {"torque_bias", "bias_Nm", 5.0, false},
      {"torque_gain", "gain", 0.05, false},
      {"inertia_torque", "inertia_kg_m2", 0.08, false},
      {"torque_delay", "delay_s", 0.05, true},
      {"torque_loss", "per_kN_Nm", 0.4, true},
      {"torque_loss", "constant_Nm", 4.0, true},
      {"torque_loss", "per_rad_s_Nm", 0.03, true},
      {"centrifugal_force", "coefficient_N_s2", 8e-3, true},
      {"pressure_offset", "offset_Pa", 4e4, false},
      {"pressure_gain", "gain", 0.04, false},
      {"spring_force", "force_N", 350.0, false},
      {"hydraulic_lag", "time_constant_s", 0.12, true},
      {"hydraulic_lag", "delay_s", 0.08, true},
      {"clamp_hysteresis", "force_N", 120.0, true},
      {"pulley_deformation", "per_kN", 6e-3, true},
      {"pulley_deformation", "per_kN2", 3e-4, true},
      {"radius_tilt", "per_Nm", 4e-5, true},
      {"end_stop_ratio", "low", 7e-3, false},
      {"end_stop_ratio", "overdrive", 7e-3, false},
      {"ratio_creep", "rate", 2e-5, true},
      {"friction_temperature", "per_K", 1.5e-3, false},
      {"friction_speed", "per_ln_speed", 0.06, false},
      {"friction_load", "exponent", 0.06, true},
      {"friction_ratio", "relative", 0.08, false},
      {"wear", "step", 0.05, true},
      {"wear", "per_experiment", 0.008, true},
      {"warm_up_drift", "per_kJ", 0.015, true},
      {"warm_up_drift", "per_start", 0.04, false},
      {"speed_scale", "primary", 8e-3, false},
      {"speed_scale", "secondary", 8e-3, false},
      {"speed_ripple", "primary", 1.2e-3, true},
      {"speed_ripple", "secondary", 1.2e-3, true},
      {"channel_skew", "delay_s", 0.03, false},
      {"secondary_loss", "constant_Nm", 4.0, true},
      {"secondary_loss", "per_rad_s_Nm", 0.03, true},
  };
  return kAll;
}

const std::vector<std::string>& outside_causes() {
  static const std::vector<std::string> kAll{"x_friction_primary_pressure", "x_friction_torque",
                                             "x_friction_speed_bump",       "x_ratio_temperature",
                                             "x_loss_temperature",          "x_friction_hidden"};
  return kAll;
}

const std::vector<std::string>& further_causes() {
  static const std::vector<std::string> kAll{
      "x_gain_temperature", "x_gain_speed",       "x_friction_dip",
      "x_friction_between", "x_force_ripple",     "x_belt_passage",
      "x_loss_force_step",  "x_ratio_force_step", "x_friction_form"};
  return kAll;
}

Planted draw_effect(Random& random, const Plantable& what, double size) {
  Planted out;
  out.effect = what.effect;
  const double sign = !what.positive && random.uniform() < 0.5 ? -1.0 : 1.0;
  out.parameters[what.parameter] = sign * size * what.typical;
  if (what.effect == "wear" && what.parameter == "step") {
    out.parameters["at"] = 2.0 + random.below(7);
  }
  if (what.effect == "channel_skew") {
    constexpr std::array<const char*, 3> kRoles{"primary_speed", "secondary_speed",
                                                "secondary_pressure"};
    out.role = kRoles[static_cast<std::size_t>(random.below(3))];
    if (out.role == "secondary_pressure") out.parameters["delay_s"] *= 3.0;
  }
  return out;
}

Planted draw_outside(Random& random, const std::string& cause, double size) {
  Planted out;
  out.effect = cause;
  const double sign = random.uniform() < 0.5 ? -1.0 : 1.0;
  double typical = 0.05;
  if (cause == "x_friction_primary_pressure") typical = 0.12;
  if (cause == "x_ratio_temperature") typical = 3e-3;
  if (cause == "x_loss_temperature") typical = 2.5;
  if (cause == "x_friction_hidden") typical = 0.03;
  if (cause == "x_friction_between") typical = 0.02;
  if (cause == "x_force_ripple") {
    typical = 0.02;
    out.parameters["hz"] = random.uniform(1.0, 4.0);
  }
  if (cause == "x_belt_passage") typical = 1e-3;
  out.parameters["size"] = sign * size * typical;
  return out;
}

}  // namespace beltgrip::blind
