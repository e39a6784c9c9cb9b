#include "tools/diagnose/infer/forward.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace beltgrip::diagnose {
namespace {

using Eigen::ArrayXd;

constexpr int kStepsPerSample = 5;
constexpr int kPasses = 8;
constexpr double kPassesAgree = 1e-9;   // of speed and capacity, between two passes
constexpr double kBelowCapacity = 0.9;  // torque: begins only where the belt is at rest
constexpr double kBelowPeak = 0.6;      // measured slip over slip at the peak, likewise
constexpr double kInertiaMin = 0.01;    // kg m^2: no shaft has less

// What drives the free shaft at one instant.
struct Drive {
  double capacity_Nm = 0.0;
  double ratio = 1.0;
  double synchronous_rad_s = 0.0;  // speed of the free shaft without slip
  double torque_Nm = 0.0;          // at the free shaft, from outside
};

Drive between(const Drive& a, const Drive& b, double share) {
  return {std::lerp(a.capacity_Nm, b.capacity_Nm, share), std::lerp(a.ratio, b.ratio, share),
          std::lerp(a.synchronous_rad_s, b.synchronous_rad_s, share),
          std::lerp(a.torque_Nm, b.torque_Nm, share)};
}

// The free shaft: the secondary on a rig, the primary in a vehicle. Its state is the slip: that
// changes slowly while the belt grips, whatever the speeds do.
struct Shaft {
  const CurveShape& curve;
  double peak_slip_share = 0.02;
  double inertia_kg_m2 = 1.0;
  bool secondary = true;

  double speed(double slip_share, const Drive& by) const {
    return secondary ? by.synchronous_rad_s * (1.0 - slip_share)
                     : by.synchronous_rad_s / (1.0 - slip_share);
  }
  double belt_torque(double slip_share, const Drive& by) const {
    return by.capacity_Nm * curve.evaluate(slip_share / peak_slip_share).value;
  }
  struct Rate {
    double value = 0.0;  // d(slip)/dt
    double slope = 0.0;  // its change with the slip
  };
  // acceleration: of the synchronous speed.
  Rate rate(double slip_share, const Drive& by, double acceleration_rad_s2) const {
    const CurveShape::Point point = curve.evaluate(slip_share / peak_slip_share);
    const double torque_Nm = by.capacity_Nm * point.value;
    const double per_slip_Nm = by.capacity_Nm * point.slope / peak_slip_share;
    const double grip = 1.0 - slip_share;
    const double lead = acceleration_rad_s2 / by.synchronous_rad_s;
    const double mass = inertia_kg_m2 * by.synchronous_rad_s;
    if (secondary) {
      return {grip * lead - (torque_Nm / by.ratio + by.torque_Nm) / mass,
              -lead - per_slip_Nm / by.ratio / mass};
    }
    const double net_Nm = by.torque_Nm - torque_Nm;
    return {grip * grip * net_Nm / mass - grip * lead,
            -grip * (grip * per_slip_Nm + 2.0 * net_Nm) / mass + lead};
  }
};

// One step, linearly implicit of order two, that damps whatever is faster than the step (Rosenbrock
// method ROS2, gamma = 1 - 1/sqrt(2)): friction below the peak pulls at up to some 1000/s.
double step(const Shaft& shaft, double slip_share, const Drive& begin, const Drive& end,
            double h_s) {
  static const double kGamma = 1.0 - std::sqrt(0.5);
  const double acceleration_rad_s2 = (end.synchronous_rad_s - begin.synchronous_rad_s) / h_s;
  const Shaft::Rate here = shaft.rate(slip_share, begin, acceleration_rad_s2);
  const double drift =
      kGamma * (shaft.rate(slip_share, end, acceleration_rad_s2).value - here.value);
  const double scale = 1.0 / (1.0 - kGamma * h_s * here.slope);
  const double k1 = scale * (here.value + drift);
  const double there = shaft.rate(slip_share + h_s * k1, end, acceleration_rad_s2).value;
  const double k2 = scale * (there - 2.0 * k1 - drift);
  return slip_share + h_s * (1.5 * k1 + 0.5 * k2);
}

// Slip below the peak at which the belt carries this torque.
double slip_share_at_rest(const Shaft& shaft, double torque_Nm, double capacity_Nm) {
  double low = -1.0, high = 1.0;
  for (int i = 0; i < 50; ++i) {
    const double middle = 0.5 * (low + high);
    (capacity_Nm * shaft.curve.evaluate(middle).value < torque_Nm ? low : high) = middle;
  }
  return 0.5 * (low + high) * shaft.peak_slip_share;
}

struct Pass {
  ArrayXd speed, belt_torque;
  std::vector<bool> grips;
};

// Measured slip below the peak, share of it.
ArrayXd grip_of(const ExperimentData& data, const Quantities& q) {
  ArrayXd out = ArrayXd::Constant(data.size(), 2.0);
  for (int k = 0; k < data.size(); ++k) {
    if (!data.valid[static_cast<std::size_t>(k)]) continue;
    const auto stop = static_cast<std::size_t>(data.stop[static_cast<std::size_t>(k)]);
    out[k] = std::abs(q.slip_share[k]) / std::exp(q.ln_peak_slip[stop]);
  }
  return out;
}

// With everything that the free shaft does not decide taken from q.
Pass integrate(const ExperimentData& data, const Quantities& q, const ArrayXd& measured_grip,
               const std::array<CurveShape, kStops>& curve, double inertia_kg_m2,
               double configured_inertia_kg_m2, double secondary_torque_gain) {
  const int n = data.size();
  const bool secondary = !data.torque_is_engine;
  Pass out{ArrayXd::Zero(n), ArrayXd::Zero(n), std::vector<bool>(data.valid.size(), false)};
  // Acceleration of the free shaft while the belt grips, from the other one.
  const auto following = [&](int k) {
    return secondary ? data.omega_p.slope[k] * q.ratio[k] : data.omega_s.slope[k] / q.ratio[k];
  };
  const auto drive = [&](int k) {
    Drive by{q.capacity[k], q.ratio[k],
             secondary ? q.omega_p[k] * q.ratio[k] : q.omega_s[k] / q.ratio[k], 0.0};
    if (!secondary) {
      by.torque_Nm = q.belt_torque[k] + configured_inertia_kg_m2 * data.omega_p.slope[k];
    } else if (data.torque_s.present) {
      by.torque_Nm =
          -data.torque_s.value[k] / (1.0 + secondary_torque_gain) - q.secondary_loss_Nm[k];
    } else {
      by.torque_Nm = inertia_kg_m2 * following(k) - q.belt_torque[k] / q.ratio[k];
    }
    return by;
  };
  bool gripping = false;
  double slip_share = 0.0;
  Drive before;
  for (int k = 0; k < n; ++k) {
    const auto i = static_cast<std::size_t>(k);
    if (!data.valid[i] || !(measured_grip[k] < 1.0)) {
      gripping = false;
      continue;
    }
    const auto stop = static_cast<std::size_t>(data.stop[i]);
    const Shaft shaft{curve[stop], std::exp(q.ln_peak_slip[stop]), inertia_kg_m2, secondary};
    const Drive now = drive(k);
    if (gripping) {
      for (int s = 0; s < kStepsPerSample; ++s) {
        constexpr double kShare = 1.0 / kStepsPerSample;
        slip_share = step(shaft, slip_share, between(before, now, s * kShare),
                          between(before, now, (s + 1) * kShare), kShare * data.dt_s);
      }
      gripping = std::abs(slip_share) < shaft.peak_slip_share;
    } else {
      const double carried_Nm = secondary
                                    ? now.ratio * (inertia_kg_m2 * following(k) - now.torque_Nm)
                                    : now.torque_Nm - inertia_kg_m2 * following(k);
      gripping =
          std::abs(carried_Nm) < kBelowCapacity * now.capacity_Nm && measured_grip[k] < kBelowPeak;
      if (gripping) slip_share = slip_share_at_rest(shaft, carried_Nm, now.capacity_Nm);
    }
    before = now;
    if (!gripping) continue;
    out.grips[i] = true;
    out.speed[k] = shaft.speed(slip_share, now);
    out.belt_torque[k] = shaft.belt_torque(slip_share, now);
  }
  return out;
}

ArrayXd configured_slip_share(const ExperimentData& data,
                              const estimator::VariatorParameters& variator) {
  ArrayXd out(data.size());
  for (int k = 0; k < data.size(); ++k) {
    const bool low = data.stop[static_cast<std::size_t>(k)] == kLowStop;
    const double ratio = low ? variator.ratio_low : variator.ratio_overdrive;
    out[k] = 1.0 - data.omega_s.value[k] / (data.omega_p.value[k] * ratio);
  }
  return out;
}

}  // namespace

Forward run_forward(const Campaign& campaign, int run, const ModelState& state) {
  const ExperimentData& data = campaign.runs[static_cast<std::size_t>(run)];
  Forward out;
  out.grips.assign(data.valid.size(), false);
  if (data.valid_count == 0) return out;
  const bool secondary = !data.torque_is_engine;
  const bool torque_follows = secondary && data.torque_s.present;  // else it drives
  const double inertia_kg_m2 =
      std::max(kInertiaMin, secondary ? state.nuisance[kSecondaryInertia_kgm2]
                                      : campaign.variator.primary_inertia_kg_m2);
  // What the free shaft decides stands in the model's equations too (slip energy, torque that
  // tilts), and sensors with a scale or a delay stand between it and its reading: passes over the
  // whole experiment until readings, equations and integral agree.
  ExperimentData simulated = data;
  GridSignal& speed = secondary ? simulated.omega_s : simulated.omega_p;
  const GridSignal& measured_speed = secondary ? data.omega_s : data.omega_p;
  ArrayXd measured_grip;
  Pass last;
  for (int pass = 0; pass < kPasses; ++pass) {
    const Quantities q = quantities(campaign, simulated, run, state);
    if (pass == 0) measured_grip = grip_of(data, q);
    last = integrate(simulated, q, measured_grip, shapes(state.nuisance, q), inertia_kg_m2,
                     campaign.variator.primary_inertia_kg_m2, state.nuisance[kSecondaryTorqueGain]);
    const ArrayXd& modelled = secondary ? q.omega_s : q.omega_p;
    double change = last.grips == out.grips ? 0.0 : 1.0;
    for (int k = 0; k < data.size(); ++k) {
      if (!last.grips[static_cast<std::size_t>(k)]) {
        speed.value[k] = measured_speed.value[k];
        simulated.torque.value[k] = data.torque.value[k];
        continue;
      }
      const double by = last.speed[k] - modelled[k];
      change = std::max(change, std::abs(by / last.speed[k]));
      speed.value[k] += by;
      if (!torque_follows) continue;
      const double by_Nm = last.belt_torque[k] - q.belt_torque[k];
      change = std::max(change, std::abs(by_Nm / q.capacity[k]));
      simulated.torque.value[k] += by_Nm;
    }
    out.grips = last.grips;
    if (change < kPassesAgree) break;
    add_slow(speed, data.dt_s);
    if (torque_follows) add_slow(simulated.torque, data.dt_s);
  }
  const auto add = [&](std::string_view name, const ArrayXd& measured, ArrayXd values) {
    for (int k = 0; k < data.size(); ++k) {
      if (!out.grips[static_cast<std::size_t>(k)]) {
        values[k] = std::numeric_limits<double>::quiet_NaN();
      }
    }
    out.signals.push_back({name, measured, std::move(values)});
  };
  add(secondary ? "secondary_speed" : "primary_speed", measured_speed.value, speed.value);
  add("slip", configured_slip_share(data, campaign.variator),
      configured_slip_share(simulated, campaign.variator));
  if (torque_follows) {
    add("primary_torque", data.torque.value, simulated.torque.value);
  } else if (!secondary && data.torque_s.present) {
    const Quantities q = quantities(campaign, simulated, run, state);
    add("secondary_torque", data.torque_s.value,
        (1.0 + state.nuisance[kSecondaryTorqueGain]) *
            (last.belt_torque /
                 (q.ratio * (1.0 + state.nuisance[kDeformationLost] * q.deformation)) -
             state.nuisance[kSecondaryInertia_kgm2] * data.omega_s.slow_slope -
             q.secondary_loss_Nm));
  }
  return out;
}

}  // namespace beltgrip::diagnose
