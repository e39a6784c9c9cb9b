#include "bound.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>

namespace beltgrip::panel {
namespace {

// Variance of the mean over one second.
double density(const ChannelNoise& noise) {
  return (noise.white * noise.white + noise.quantum * noise.quantum / 12.0) / noise.frame_rate_hz;
}

}  // namespace

double mu_max_bound(const Scenario& s, const Trace& trace, double stop_s) {
  if (!trace.peak_reached) return 0.0;
  const double radius =
      s.low ? s.variator.primary_radius_low_m : s.variator.primary_radius_overdrive_m;
  const double c = std::cos(s.variator.half_wedge_angle_rad) / (2.0 * radius);
  const double area = s.variator.secondary_piston_area_m2;
  const double ratio = s.low ? s.variator.ratio_low : s.variator.ratio_overdrive;
  const double sample_s = 1.0 / s.sample_rate_hz;
  const auto end = std::min(trace.samples.size(), static_cast<std::size_t>(stop_s / sample_s) + 1);
  const int curve = parameter_count(s.curve.family);
  const int size = curve + 3;
  const double torque_density = density(s.torque);
  const double omega_s = s.omega_p_rad_s * ratio;
  const double slip_density = 1e4 * (density(s.omega_p) / (s.omega_p_rad_s * s.omega_p_rad_s) +
                                     density(s.omega_s) / (omega_s * omega_s));
  const double force_density = density(s.pressure) * area * area;
  const auto base = parameters(s.curve);
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(size, size);
  const double t0 = s.hold_s + 3.0 * s.hydraulic_lag_s;  // the force's line begins here
  for (std::size_t i = 0; i < end; ++i) {
    const double t = static_cast<double>(i) * sample_s;
    const double slip = trace.slip[i];
    const double force = trace.clamp_N[i];
    const double slope = (s.curve.value(slip + 1e-3) - s.curve.value(slip - 1e-3)) / 2e-3;
    Eigen::VectorXd g(size);
    for (int p = 0; p < curve; ++p) {
      auto up = base, down = base;
      const double step = 1e-4 * std::max(1e-3, std::abs(base[static_cast<std::size_t>(p)]));
      up[static_cast<std::size_t>(p)] += step;
      down[static_cast<std::size_t>(p)] -= step;
      g(p) =
          force / c *
          (with_parameters(s.curve, up).value(slip) - with_parameters(s.curve, down).value(slip)) /
          (2.0 * step);
    }
    g(curve) = -force / c * slope * force / 1e4;
    const double mu = s.curve.value(slip);
    g(curve + 1) = mu / c;
    g(curve + 2) = mu / c * (t - t0);
    const double variance =
        (torque_density + std::pow(force / c * slope, 2) * slip_density) / sample_s;
    information += g * g.transpose() / variance;
    if (t > t0) {
      Eigen::VectorXd f = Eigen::VectorXd::Zero(size);
      f(curve + 1) = 1.0;
      f(curve + 2) = t - t0;
      information += f * f.transpose() * (sample_s / force_density);
    }
  }
  // Scaled for the inverse.
  const Eigen::VectorXd scale = information.diagonal().cwiseSqrt().cwiseMax(1e-30);
  Eigen::MatrixXd scaled =
      scale.cwiseInverse().asDiagonal() * information * scale.cwiseInverse().asDiagonal();
  scaled.diagonal().array() += 1e-12;
  const Eigen::VectorXd unit = Eigen::VectorXd::Unit(size, 0) / scale(0);
  return std::sqrt(unit.dot(scaled.ldlt().solve(unit))) / s.curve.mu_max;
}

DetectionBound detection_bound(const Scenario& s, const Trace& trace) {
  DetectionBound out;
  if (!trace.peak_reached) return out;
  const double radius =
      s.low ? s.variator.primary_radius_low_m : s.variator.primary_radius_overdrive_m;
  const double c = std::cos(s.variator.half_wedge_angle_rad) / (2.0 * radius);
  const double sample_s = 1.0 / s.sample_rate_hz;
  const double reached = s.curve.slip_reached(0.005);
  const double slope = 0.005 * s.curve.mu_max / std::max(0.05, s.curve.slip_peak - reached);
  double odds = 0.0;
  const double variance = density(s.torque) / sample_s;
  for (std::size_t i = static_cast<std::size_t>(trace.t_peak_s / sample_s); i < trace.slip.size();
       ++i) {
    const double rest = s.curve.value(trace.slip[i]) -
                        (s.curve.mu_max + slope * (trace.slip[i] - s.curve.slip_peak));
    odds += std::pow(trace.clamp_N[i] / c * rest, 2) / (2.0 * variance);
    out.delay_s = static_cast<double>(i) * sample_s - trace.t_peak_s;
    out.slip_past_percent = trace.slip_star[i] - trace.slip_star_peak;
    if (odds > std::log(100.0)) break;
  }
  return out;
}

}  // namespace beltgrip::panel
