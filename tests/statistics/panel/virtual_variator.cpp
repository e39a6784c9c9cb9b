#include "virtual_variator.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "random.h"

namespace beltgrip::panel {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;
constexpr double kStep_s = 1e-3;
constexpr double kLeftTop = 2e-3;

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
  double value(double slip_percent) const {
    const double place = std::min(std::abs(slip_percent) / kSpacing, kSize - 1.0);
    const auto index = static_cast<std::size_t>(place);
    const double part = place - static_cast<double>(index);
    const double mu = values_[index] + part * (values_[index + 1] - values_[index]);
    return slip_percent < 0.0 ? -mu : mu;
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

}  // namespace

Trace simulate(const Scenario& s) {
  Random r(s.seed ^ 0x3C3C3C3C3CULL);
  const Point p = point_of(s);
  const FrictionCurve& curve = s.curve;
  const CurveTable table(curve);
  const bool peaked = curve.has_peak();
  const bool car = is_car(s.plant);
  const double primary_inertia = s.plant == PlantKind::kCarEngine
                                     ? s.variator.primary_inertia_kg_m2
                                     : 0.18;  // car with a torque sensor behind the engine
  const double force_by_mu = s.torque_Nm * p.cosine / (2.0 * p.radius);
  const double force_start = force_by_mu / s.mu_start;
  const double force_floor =
      std::max({force_by_mu / s.mu_floor, 0.1 * force_start, s.variator.secondary_spring_force_N});
  const double slip_reached_percent = curve.slip_reached_percent(0.005);

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
  double belt_Nm = 0.0;     // signed, at the primary
  double reading_Nm = 0.0;  // of the torque, late
  Trace out;
  double previous[4] = {omega_p, omega_s, 0.0, 0.0};
  std::vector<double> t_grid;
  const double sample_s = 1.0 / s.sample_rate_hz;
  double next_sample_s = 0.0;
  double end_s = 1e9;
  double slip_percent = 0.0;
  double loss_at_top_Nm = 0.0, force_at_top_N = 0.0;
  double disturbed_s = 1e9;  // since then
  double friction = 1.0;
  for (std::int64_t k = 0; k < 400000; ++k) {
    const double t = static_cast<double>(k) * kStep_s;
    const double take_up = s.take_up_s > 0.0 ? std::min(1.0, 0.05 + t / s.take_up_s) : 1.0;
    const double variation = 1.0 + s.load_variation * (std::sin(kTurn * t / period_a + phase_a) +
                                                       std::sin(kTurn * t / period_b + phase_b));
    const double torque = p.sign * s.torque_Nm * take_up * variation;
    // The loss at the primary opposes the turning: the shaft carries more than the belt in drive.
    const double loss_Nm = s.primary_loss_share * s.torque_Nm * omega_p / s.omega_p_rad_s;
    const double load_Nm = torque * (1.0 + p.sign * s.secondary_loss_share);
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
      slip_percent = p.sign * 100.0 * (1.0 - ws / (ratio * wp));
      return p.sign * 2.0 * friction * table.value(slip_percent) * force * p.radius / p.cosine;
    };
    if (car) {
      omega_p = solve(omega_p, [&](double trial) {
        return trial - omega_p -
               kStep_s / primary_inertia * (torque - loss_Nm - belt(trial, omega_s));
      });
      belt_Nm = belt(omega_p, omega_s);
      const double road_Nm =
          (0.97 + p.sign * s.secondary_loss_share) * s.torque_Nm * p.sign / p.ratio;
      omega_s += kStep_s / s.secondary_inertia * (belt_Nm / p.ratio - road_Nm) -
                 kStep_s * (s.overrun ? 0.5 : 0.0);
    } else {
      omega_s = solve(omega_s, [&](double trial) {
        return trial - omega_s -
               kStep_s / s.secondary_inertia * (belt(omega_p, trial) - load_Nm) / p.ratio;
      });
      belt_Nm = belt(omega_p, omega_s);
    }
    const double centrifugal = s.variator.secondary_centrifugal_N_s2 * omega_s * omega_s;
    const double pressure = (force - s.variator.secondary_spring_force_N - centrifugal) /
                            s.variator.secondary_piston_area_m2;
    const double shaft_Nm = s.plant == PlantKind::kCarEngine ? torque : belt_Nm + loss_Nm;
    reading_Nm = k == 0 || s.torque_lag_s <= 0.0
                     ? shaft_Nm
                     : reading_Nm + (shaft_Nm - reading_Nm) * kStep_s / s.torque_lag_s;
    const double read_Nm =
        reading_Nm * (1.0 + (s.disturbance == Disturbance::kTorque ? disturbed : 0.0));
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

    const double mu = friction * table.value(slip_percent);
    const double slip_star_percent = p.sign * 100.0 * (1.0 - omega_s / omega_p / p.ratio);
    const double mu_star = std::abs(belt_Nm + loss_Nm) * p.cosine / (2.0 * p.radius * force);
    if (peaked && out.t_reached_s > 1e8 && slip_percent >= slip_reached_percent)
      out.t_reached_s = t;
    if (peaked && !out.peak_reached && slip_percent >= curve.slip_peak_percent()) {
      out.peak_reached = true;
      out.t_peak_s = t;
      loss_at_top_Nm = loss_Nm;
      force_at_top_N = force;
      out.slip_star_peak_percent = slip_star_percent;
    }
    if (disturbed_s > 1e8 && mu >= s.disturbed_from * curve.mu_max()) disturbed_s = t;
    if (peaked && slip_percent >= slip_reached_percent && mu >= (1.0 - kLeftTop) * curve.mu_max()) {
      out.slip_star_leave_percent = std::max(out.slip_star_leave_percent, slip_star_percent);
    }
    if (t + 1e-9 >= next_sample_s) {
      t_grid.push_back(t);
      out.slip_star_percent.push_back(slip_star_percent);
      out.slip_percent.push_back(slip_percent);
      out.mu.push_back(mu_star);
      out.clamp_N.push_back(force);
      out.torque_belt_Nm.push_back(belt_Nm);
      next_sample_s += sample_s;
    }
    if (!out.peak_reached) {
      loss_at_top_Nm = loss_Nm;
      force_at_top_N = force;
    }
    // The trace goes on to 30 % of slip; or five seconds on the floor, thirty beyond the peak.
    const bool on_floor = command <= force_floor && t > s.hold_s;
    if (end_s > 1e8 && on_floor) end_s = t + 5.0;
    if (end_s < 1e8 && out.peak_reached) end_s = std::max(end_s, out.t_peak_s + 30.0);
    if (slip_percent > 30.0 || t > end_s) break;
    if (car && (omega_p < 20.0 || omega_s < 5.0)) break;
  }
  out.mu_max = friction * curve.mu_max() +
               p.sign * loss_at_top_Nm * p.cosine / (2.0 * p.radius * force_at_top_N);
  if (!out.peak_reached) out.slip_star_peak_percent = out.slip_star_percent.back();
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

}  // namespace beltgrip::panel
