#include "daemon/core/experiment/reachability.h"

#include <algorithm>
#include <cmath>

namespace beltgrip::daemon {

namespace {

constexpr double kFall = 0.4;         // of mu beyond the peak, per unit of slip
constexpr double kSlopeBefore = 0.5;  // of mu just before the peak, per unit of slip
constexpr int kRates = 16;            // tried, each kRateStep slower than the one before
constexpr double kRateStep = 0.82;
constexpr int kBisections = 16;
constexpr int kIntegration = 20;  // points of the energy's integral in each phase

// Growth of slip beyond the peak while the force falls.
struct Growth {
  double a = 0.0;   // 1/s
  double b = 0.0;   // 1/s^2: w r / F
  double v0 = 0.0;  // 1/s

  double slip(double t) const noexcept {
    const double e = std::expm1(a * t);
    return b / (a * a) * (e - a * t) + v0 / a * e;
  }
  double area(double t) const noexcept {  // integral of slip
    const double e = std::expm1(a * t);
    return b / (a * a) * ((e - a * t) / a - 0.5 * a * t * t) + v0 / a * (e / a - t);
  }
};

// And after the actuator has been told.
struct Recovery {
  double a = 0.0, w = 0.0;
  double x1 = 0.0, y1 = 0.0, g = 0.0, lag_s = 0.0;

  double shortfall(double t) const noexcept { return y1 + g * std::expm1(-t / lag_s); }
  double slip(double t) const noexcept {
    const double rate = a + 1.0 / lag_s;
    return std::exp(a * t) *
           (x1 - w * (y1 - g) * std::expm1(-a * t) / a - w * g * std::expm1(-rate * t) / rate);
  }
  double slope(double t) const noexcept { return a * slip(t) + w * shortfall(t); }
};

// The last t in [low, high] at which the falling function f is still positive.
template <typename Function>
double last_positive(Function f, double low, double high) noexcept {
  for (int i = 0; i < kBisections; ++i) {
    const double middle = 0.5 * (low + high);
    (f(middle) > 0.0 ? low : high) = middle;
  }
  return high;
}

}  // namespace

double peak_force_N(const RampPoint& point, double mu) noexcept {
  return point.torque_Nm * point.wedge_cosine / (2.0 * point.primary_radius_m * mu);
}

double reachable_mu(const RampPoint& point) noexcept {
  return point.torque_Nm * point.wedge_cosine / (2.0 * point.primary_radius_m * point.floor_N);
}

Excursion excursion(const RampPoint& point, const Reaction& reaction, double rate_N_per_s,
                    double reaction_s) noexcept {
  const double force_N = peak_force_N(point, point.mu_expected);
  const double w = point.torque_Nm * 1.21 / (point.inertia_kg_m2 * point.omega_p_rad_s);
  Growth growth;
  growth.a = w * kFall / point.mu_expected;
  growth.b = w * rate_N_per_s / force_N;
  growth.v0 = point.mu_expected * rate_N_per_s / (force_N * kSlopeBefore);

  double far_s = 0.01;
  while (growth.slip(far_s) < kSlipToSee) far_s *= 2.0;
  const double seen_s =
      last_positive([&](double t) { return kSlipToSee - growth.slip(t); }, 0.0, far_s);
  const double stop_s = seen_s + reaction.detection_s;
  const double told_s = stop_s + reaction_s + reaction.dead_time_s;

  Excursion out;
  out.slip_at_stop = point.peak_slip + growth.slip(stop_s);
  Recovery recovery;
  recovery.a = growth.a;
  recovery.w = w;
  recovery.lag_s = std::max(reaction.lag_s, 1e-3);
  recovery.x1 = growth.slip(told_s);
  recovery.y1 = rate_N_per_s * told_s / force_N;
  recovery.g = std::max(0.0, point.own_force_N / force_N - (1.0 - recovery.y1));
  double energy = point.peak_slip * told_s + growth.area(told_s);
  // Where the own force does not catch the belt any more, slip grows without bound.
  const double horizon_s = 8.0 * recovery.lag_s + 1.0;
  if (recovery.slope(horizon_s) > 0.0) {
    out.slip_max = out.slip_speed_max_m_s = out.energy_J = 1e9;
    return out;
  }
  const double top_s = last_positive([&](double t) { return recovery.slope(t); }, 0.0, horizon_s);
  const double highest = std::max(recovery.x1, recovery.slip(top_s));
  // Back below the peak's slip.
  const double end_s = last_positive([&](double t) { return recovery.slip(t); }, top_s, horizon_s);
  for (int i = 0; i < kIntegration; ++i) {
    const double t = end_s * (i + 0.5) / kIntegration;
    energy += end_s / kIntegration * (point.peak_slip + std::max(0.0, recovery.slip(t)));
  }
  out.slip_max = point.peak_slip + highest;
  out.slip_speed_max_m_s = out.slip_max * point.omega_p_rad_s * point.primary_radius_m;
  out.energy_J = energy * point.torque_Nm * point.omega_p_rad_s;
  return out;
}

RampSearch::RampSearch(const RampPoint& point, const Reaction& reaction, const SlipLimits& limits,
                       double rate_max_N_per_s) noexcept
    : point_(point),
      reaction_(reaction),
      limits_(limits),
      rate_N_per_s_(rate_max_N_per_s),
      done_(false) {}

bool RampSearch::step() noexcept {
  if (done_) return true;
  if (!nominal_holds_) {
    const Excursion nominal = excursion(point_, reaction_, rate_N_per_s_, reaction_.cycle_s);
    nominal_holds_ = nominal.slip_at_stop <= limits_.slip_nominal &&
                     nominal.slip_max <= limits_.slip_max &&
                     nominal.energy_J <= limits_.energy_nominal_J;
    if (!nominal_holds_) next_rate();
    return done_;
  }
  const double worst_s = std::max(reaction_.stale_s, reaction_.timeout_s) + reaction_.cycle_s;
  const Excursion worst = excursion(point_, reaction_, rate_N_per_s_, worst_s);
  const bool holds = worst.slip_max <= limits_.slip_max &&
                     worst.slip_speed_max_m_s <= limits_.slip_speed_max_m_s &&
                     worst.energy_J <= limits_.energy_max_J;
  if (!holds) {
    next_rate();
    return done_;
  }
  const double fall_N =
      std::max(0.0, point_.own_force_N - peak_force_N(point_, point_.mu_expected));
  ramp_ = {rate_N_per_s_, fall_N / rate_N_per_s_};
  return done_ = true;
}

void RampSearch::next_rate() noexcept {
  nominal_holds_ = false;
  rate_N_per_s_ *= kRateStep;
  done_ = ++tried_ == kRates;
}

}  // namespace beltgrip::daemon
