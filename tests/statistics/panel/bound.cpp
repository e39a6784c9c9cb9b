#include "bound.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <vector>

#include "estimator/statistics/square.h"

namespace beltgrip::panel {
namespace {

using estimator::square;

constexpr double kOneSided99 = 2.326;
constexpr double kStep_percent = 0.02;

// Variance of the mean over one second.
double density(const ChannelNoise& noise) {
  return (noise.white * noise.white + noise.quantum * noise.quantum / 12.0) / noise.frame_rate_hz;
}

// What an efficient fit knows, that is told the family of the curve: parameters of the curve, the
// deformation, the force's line (two) and the force on which the ramp ended.
class Knowledge {
 public:
  Knowledge(const Scenario& s, const Trace& trace, double stop_s)
      : s_(s),
        trace_(trace),
        base_(parameters(s.curve)),
        curve_(parameter_count(s.curve.family())) {
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
    steps_.resize(static_cast<std::size_t>(curve_));
    for (std::size_t p = 0; p < steps_.size(); ++p) {
      auto up = base_, down = base_;
      steps_[p].size = 1e-4 * std::max(1e-3, std::abs(base_[p]));
      up[p] += steps_[p].size;
      down[p] -= steps_[p].size;
      steps_[p].up = with_parameters(s.curve, up);
      steps_[p].down = with_parameters(s.curve, down);
    }
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
      const Eigen::VectorXd g =
          force / c * of_friction(i) + s.curve.value(trace.slip_percent[i]) / c * f;
      const double variance =
          (torque_density + std::pow(force / c * slope, 2) * slip_density) / sample_s;
      information_ += g * g.transpose() / variance;
      if (t > t0) information_ += f * f.transpose() * (sample_s / force_density);
    }
  }
  // Gradient of mu at this sample, by the parameters.
  Eigen::VectorXd of_friction(std::size_t i) const {
    Eigen::VectorXd g = Eigen::VectorXd::Zero(curve_ + 4);
    const double slip_percent = trace_.slip_percent[i];
    for (int p = 0; p < curve_; ++p) {
      const Step& step = steps_[static_cast<std::size_t>(p)];
      g(p) = (step.up.value(slip_percent) - step.down.value(slip_percent)) / (2.0 * step.size);
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
    return (s_.curve.value(trace_.slip_percent[i] + 1e-3) -
            s_.curve.value(trace_.slip_percent[i] - 1e-3)) /
           2e-3;
  }
  const Scenario& s_;
  const Trace& trace_;
  std::array<double, kCurveParameters> base_;
  int curve_;
  struct Step {  // the curve with one parameter a little up and down
    double size = 0.0;
    FrictionCurve up, down;
  };
  std::vector<Step> steps_;
  Eigen::MatrixXd information_;
};

}  // namespace

double mu_max_bound(const Scenario& s, const Trace& trace, double stop_s) {
  if (!trace.peak_reached) return 0.0;
  const Knowledge known(s, trace, stop_s);
  return known.deviation(known.of_mu_max()) / s.curve.mu_max();
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

namespace {

// The form of a curve by slip over that of its peak.
class Stretched {
 public:
  explicit Stretched(const FrictionCurve& curve) : slip_peak_percent_(curve.slip_peak_percent()) {
    for (int i = 0; i <= kSize; ++i)
      table_[i] = curve.value(slip_peak_percent_ * kLast * i / kSize);
    reached_ = curve.slip_reached_percent(kNearTop) / slip_peak_percent_;
  }
  double reached() const { return reached_; }  // in slips of the peak
  double value(double slips) const {
    const double place = std::clamp(slips / kLast, 0.0, 1.0 - 1e-9) * kSize;
    const int i = static_cast<int>(place);
    return table_[i] + (place - i) * (table_[i + 1] - table_[i]);
  }
  static constexpr double kNearTop = 0.005;

 private:
  static constexpr int kSize = 1024;
  static constexpr double kLast = 1.6;  // no slip so far lies beyond
  double table_[kSize + 1];
  double slip_peak_percent_, reached_;
};

struct Evidence {  // means over a few samples
  double slip_percent, mu, force;
  double weight;  // of mu, by the noise of torque and slip
};

}  // namespace

DetectionBound detection_bound(const Scenario& s, const Trace& trace) {
  DetectionBound out;
  if (!trace.peak_reached) return out;
  const double radius =
      s.low ? s.variator.primary_radius_low_m : s.variator.primary_radius_overdrive_m;
  const double c = std::cos(s.variator.half_wedge_angle_rad) / (2.0 * radius);
  const bool engine = s.plant == PlantKind::kCarEngine;
  constexpr std::size_t kSamples = 4;
  const double cell_s = kSamples / s.sample_rate_hz;
  const double omega_s =
      s.omega_p_rad_s * (s.low ? s.variator.ratio_low : s.variator.ratio_overdrive);
  const double slip_density =
      1e4 * (density(s.omega_p) / square(s.omega_p_rad_s) + density(s.omega_s) / square(omega_s));
  std::vector<Stretched> forms;
  const bool has_shape = parameter_count(s.curve.family()) == kCurveParameters;
  for (const double factor : {0.8, 0.9, 1.0, 1.1, 1.25}) {
    if (factor != 1.0 && !has_shape) continue;
    auto changed = parameters(s.curve);
    changed.back() *= factor;
    const FrictionCurve form = with_parameters(s.curve, changed);
    if (form.possible()) forms.emplace_back(form);
  }
  const double top_slip_percent = s.curve.slip_reached_percent(Stretched::kNearTop);
  std::vector<Evidence> seen;
  double furthest = top_slip_percent, power = 0.0;
  out.delay_s = trace.t_reached_s - trace.t_peak_s;
  out.stopped.fill(1.0);
  std::size_t filled = 0;
  for (std::size_t i = 0; i + kSamples <= trace.slip_percent.size(); i += kSamples) {
    const double slip_percent = trace.slip_percent[i + kSamples / 2];
    const double force = trace.clamp_N[i + kSamples / 2];
    const double slope =
        (s.curve.value(slip_percent + 1e-3) - s.curve.value(slip_percent - 1e-3)) / 2e-3;
    const double noise = (engine ? 0.0 : density(s.torque) * square(c / force)) +
                         square(slope) * slip_density + 1e-14;
    seen.push_back({slip_percent, s.curve.value(slip_percent), force, cell_s / noise});
    if (slip_percent <= top_slip_percent) continue;
    // The least of what tells the curve from those of its family whose top lies further on.
    if (slip_percent > furthest + kStep_percent) {
      furthest = slip_percent;
      double least = 1e300;
      for (const Stretched& form : forms) {
        const double per_slip = form.reached() / slip_percent;
        double ff = 0.0, fg = 0.0;
        for (const Evidence& e : seen) {
          const double g = form.value(e.slip_percent * per_slip);
          ff += e.weight * g * g;
          fg += e.weight * g * e.mu;
        }
        const double height = fg / ff;
        double odds = 0.0, omega = 0.0, sum = 0.0, squares = 0.0;
        for (const Evidence& e : seen) {
          const double rest = e.mu - height * form.value(e.slip_percent * per_slip);
          odds += e.weight * rest * rest;
          omega += e.force / c * rest * cell_s / s.variator.primary_inertia_kg_m2;
          sum += omega;
          squares += omega * omega;
        }
        const auto n = static_cast<double>(seen.size());
        if (engine) odds = (squares - sum * sum / n) * cell_s / density(s.omega_p);
        least = std::min(least, odds);
      }
      power = 0.5 * std::erfc(-(std::sqrt(least) - kOneSided99) / std::sqrt(2.0));
    }
    const double past = trace.slip_star_percent[i + kSamples / 2] -
                        (s.curve.family() == Family::kPlateau ? trace.slip_star_leave_percent
                                                              : trace.slip_star_peak_percent);
    while (filled < kPastSteps && past > kPastStep_percent * static_cast<double>(filled)) {
      out.stopped[filled++] = power;
    }
    if (power < 0.5) out.delay_s = static_cast<double>(i) / s.sample_rate_hz - trace.t_peak_s;
    if (power > 0.9999 || filled == kPastSteps) break;
  }
  return out;
}

}  // namespace beltgrip::panel
