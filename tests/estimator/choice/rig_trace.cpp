#include "tests/estimator/choice/rig_trace.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

namespace beltgrip::test {
namespace {

constexpr double kPlant_hz = 1000.0;

class Noise {
 public:
  explicit Noise(std::uint64_t seed) : engine_(seed) {}
  double operator()() {  // unit deviation; the same with every standard library
    double sum = 0.0;
    for (int i = 0; i < 12; ++i) sum += static_cast<double>(engine_() >> 11) * 0x1p-53;
    return sum - 6.0;
  }

 private:
  std::mt19937_64 engine_;
};

double rounded(double value, double quantum) {
  return quantum > 0.0 ? quantum * std::round(value / quantum) : value;
}

}  // namespace

FrictionLaw tent(double mu_max, double peak_percent, double fall_per_percent) {
  return [=](double slip_percent) {
    return slip_percent < peak_percent
               ? mu_max * slip_percent / peak_percent
               : std::max(0.5 * mu_max, mu_max - fall_per_percent * (slip_percent - peak_percent));
  };
}

FrictionLaw round_peak(double mu_max, double peak_percent) {
  return [=](double slip_percent) {
    const double x = slip_percent / peak_percent;
    return mu_max * 2.0 * x / (1.0 + x * x);
  };
}

FrictionLaw saturating(double limit, double half_percent) {
  return [=](double slip_percent) { return limit * slip_percent / (slip_percent + half_percent); };
}

std::vector<TracePoint> rig_trace(const Rig& rig) {
  const bool overdrive = rig.end_stop == estimator::EndStop::kOverdrive;
  const double ratio = overdrive ? 2.25 : 0.405;
  const double radius_m = overdrive ? 0.0784 : 0.0324;
  const double lever_m = 2.0 * radius_m / std::cos(11.0 * std::numbers::pi / 180.0);
  const double sign = rig.torque_Nm < 0.0 ? -1.0 : 1.0;
  const double load_Nm = std::abs(rig.torque_Nm);
  const double begin_N = load_Nm / (lever_m * rig.mu_begin);
  Noise noise(rig.seed);

  // The slip that carries the load at the begin.
  double slip_percent = 0.0;
  while (rig.friction(slip_percent) < rig.mu_begin) slip_percent += 1e-4;

  const int substeps = std::max(1, static_cast<int>(std::lround(kPlant_hz / rig.sample_rate_hz)));
  std::vector<TracePoint> out;
  for (int i = 0; i < static_cast<int>(rig.end_s * rig.sample_rate_hz); ++i) {
    const double t_s = i / rig.sample_rate_hz;
    const double omega_p_rad_s = rig.omega_p_rad_s - rig.slowing_rad_s2 * t_s;
    const double lowered_N =
        rig.ramp_N_per_s * std::max(0.0, std::min(t_s, rig.restore_s) - rig.rest_s);
    const double restored_N = rig.restore_N_per_s * std::max(0.0, t_s - rig.restore_s);
    const double force_N = std::min(begin_N, std::max(200.0, begin_N - lowered_N + restored_N));
    // Secondary: the belt's torque against the load; slip is what its speed lacks, in both
    // directions.
    for (int j = 0; j < substeps; ++j) {
      const double belt_Nm = lever_m * force_N * rig.friction(slip_percent);
      slip_percent += 100.0 * (load_Nm - belt_Nm) / (ratio * rig.secondary_inertia_kg_m2) /
                      (omega_p_rad_s * ratio) / (rig.sample_rate_hz * substeps);
      slip_percent = std::max(0.0, slip_percent);
    }
    const double mu = rig.friction(slip_percent);
    const double measured_ratio = ratio * (1.0 - rig.deformation_percent_per_kN * 1e-5 * force_N) *
                                  (1.0 - sign * slip_percent / 100.0);
    const double direction = t_s < rig.reversal_s ? sign : -sign;
    const double omega_p = omega_p_rad_s + 0.03 * rig.noise * noise();
    const double omega_s = omega_p_rad_s * measured_ratio + 0.05 * rig.noise * noise();
    out.push_back(
        {.sample = {.t_ns = std::llround(i * 1e9 / rig.sample_rate_hz),
                    .omega_p_rad_s = rounded(omega_p, rig.speed_quantum_rad_s),
                    .omega_s_rad_s = rounded(omega_s, rig.speed_quantum_rad_s),
                    .secondary_pressure_Pa =
                        (force_N - 500.0) / 0.0113 + 1000.0 * rig.noise * noise(),
                    .torque_Nm = direction * lever_m * force_N * mu + 0.2 * rig.noise * noise(),
                    .usable = true},
         .slip_percent = slip_percent,
         .mu = mu,
         .clamp_force_N = force_N});
    if (slip_percent > rig.end_slip_percent) break;
  }
  return out;
}

estimator::EstimatorSettings rig_settings(const Rig& rig) {
  estimator::EstimatorSettings settings;
  settings.ratio = rig.end_stop == estimator::EndStop::kOverdrive
                       ? estimator::RatioChoice::kOverdrive
                       : estimator::RatioChoice::kLow;
  settings.torque_is_engine = false;
  settings.sample_rate_hz = rig.sample_rate_hz;
  settings.ramp_rate_max_N_per_s = std::max(1.0, rig.ramp_N_per_s);
  return settings;
}

}  // namespace beltgrip::test
