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

// What an efficient fit knows, that is told the family of the curve: parameters of the curve, the
// deformation, the force's line (two) and the force on which the ramp ended.
class Knowledge {
 public:
  Knowledge(const Scenario& s, const Trace& trace, double stop_s)
      : s_(s), trace_(trace), base_(parameters(s.curve)), curve_(parameter_count(s.curve.family)) {
    const int size = curve_ + 4;
    const double radius =
        s.low ? s.variator.primary_radius_low_m : s.variator.primary_radius_overdrive_m;
    const double c = std::cos(s.variator.half_wedge_angle_rad) / (2.0 * radius);
    const double area = s.variator.secondary_piston_area_m2;
    const double ratio = s.low ? s.variator.ratio_low : s.variator.ratio_overdrive;
    const double sample_s = 1.0 / s.sample_rate_hz;
    const auto end =
        std::min(trace.samples.size(), static_cast<std::size_t>(stop_s / sample_s) + 1);
    const double torque_density = density(s.torque);
    const double omega_s = s.omega_p_rad_s * ratio;
    const double slip_density = 1e4 * (density(s.omega_p) / (s.omega_p_rad_s * s.omega_p_rad_s) +
                                       density(s.omega_s) / (omega_s * omega_s));
    const double force_density = density(s.pressure) * area * area;
    const double t0 = s.hold_s + 3.0 * s.hydraulic_lag_s;  // the force's line begins here
    const double last_N = trace.clamp_N[end - 1];
    const auto second = static_cast<std::size_t>(s.sample_rate_hz);
    const auto near_last = [&](std::size_t i) {
      return std::abs(trace.clamp_N[i] / last_N - 1.0) < kStandsStill;
    };
    const bool floor = end > second && near_last(end - second);
    information_ = Eigen::MatrixXd::Zero(size, size);
    for (std::size_t i = 0; i < end; ++i) {
      const double t = static_cast<double>(i) * sample_s;
      const double force = trace.clamp_N[i];
      const double slope = slope_at(i);
      Eigen::VectorXd f = Eigen::VectorXd::Zero(size);
      if (floor && near_last(i)) {
        f(curve_ + 3) = 1.0;
      } else {
        f(curve_ + 1) = 1.0;
        f(curve_ + 2) = t - t0;
      }
      const Eigen::VectorXd g = force / c * of_friction(i) + s.curve.value(trace.slip[i]) / c * f;
      const double variance =
          (torque_density + std::pow(force / c * slope, 2) * slip_density) / sample_s;
      information_ += g * g.transpose() / variance;
      if (t > t0) information_ += f * f.transpose() * (sample_s / force_density);
    }
  }
  // Gradient of mu at this sample, by the parameters.
  Eigen::VectorXd of_friction(std::size_t i) const {
    Eigen::VectorXd g = Eigen::VectorXd::Zero(curve_ + 4);
    const double slip = trace_.slip[i];
    for (int p = 0; p < curve_; ++p) {
      const auto at = static_cast<std::size_t>(p);
      auto up = base_, down = base_;
      const double step = 1e-4 * std::max(1e-3, std::abs(base_[at]));
      up[at] += step;
      down[at] -= step;
      g(p) = (with_parameters(s_.curve, up).value(slip) -
              with_parameters(s_.curve, down).value(slip)) /
             (2.0 * step);
    }
    g(curve_) = -slope_at(i) * trace_.clamp_N[i] / 1e4;
    return g;
  }
  Eigen::VectorXd of_mu_max() const { return Eigen::VectorXd::Unit(curve_ + 4, 0); }
  // Standard deviation of what has this gradient.
  double deviation(const Eigen::VectorXd& gradient) const {
    // Scaled for the inverse.
    const Eigen::VectorXd scale = information_.diagonal().cwiseSqrt().cwiseMax(1e-30);
    Eigen::MatrixXd scaled =
        scale.cwiseInverse().asDiagonal() * information_ * scale.cwiseInverse().asDiagonal();
    scaled.diagonal().array() += 1e-12;
    const Eigen::VectorXd wanted = gradient.cwiseQuotient(scale);
    return std::sqrt(wanted.dot(scaled.ldlt().solve(wanted)));
  }

 private:
  static constexpr double kStandsStill = 1e-3;  // of the force, in a second
  double slope_at(std::size_t i) const {
    return (s_.curve.value(trace_.slip[i] + 1e-3) - s_.curve.value(trace_.slip[i] - 1e-3)) / 2e-3;
  }
  const Scenario& s_;
  const Trace& trace_;
  std::array<double, kCurveParameters> base_;
  int curve_;
  Eigen::MatrixXd information_;
};

}  // namespace

double mu_max_bound(const Scenario& s, const Trace& trace, double stop_s) {
  if (!trace.peak_reached) return 0.0;
  const Knowledge known(s, trace, stop_s);
  return known.deviation(known.of_mu_max()) / s.curve.mu_max;
}

double reached_bound(const Scenario& s, const Trace& trace, double stop_s) {
  const Knowledge known(s, trace, stop_s);
  const auto end =
      std::min(trace.mu.size(), static_cast<std::size_t>(stop_s * s.sample_rate_hz) + 1);
  const auto top =
      std::max_element(trace.mu.begin(), trace.mu.begin() + static_cast<std::ptrdiff_t>(end));
  return known.deviation(known.of_friction(static_cast<std::size_t>(top - trace.mu.begin()))) /
         *top;
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
