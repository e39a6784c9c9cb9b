#include "daemon/core/experiment/reachability.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace beltgrip::daemon {

namespace {

// Tried: below the least the energy of a slow crossing grows and its ramp outlasts the coast-down,
// above the largest the slip on its way. Measured, with kCrossingSlipBeyond_share
// 0.025 (campaign --seeds 3000 --from 920001 --nothing-wrong): a value from 123 of 192 peaks in
// reach; with 3 %/s beside them from 109, and one break of G1. With 1.5 %/s beside them 79, 80, 45
// of the first 98 below instead of 81, 83, 45, and two of the five drives below slip.
constexpr std::array kSlipRates_1_s{0.025, 0.02};
// A steep fall is seen early, a flat top late.
constexpr double kSlipDetectableSteep_share = 0.003;
constexpr double kSlipDetectableFlat_share = 0.008;
// Measured, together with limits::kCrossingSlipBeyond_share: how far behind the peak a steep fall
// is seen at the latest, of the noise of the slip rate. In harsh noise 184 requests were ended 0.7
// / 1.1 / 2.0 points (median, 90, 99 %) behind the peak of belts that fall by 4e-3 to 8e-3 per
// percent (campaign from 1300001). A fifth less and more of each: values of 188 peaks in reach in
// lab / production / harsh noise (--seeds 1500 --from 990001 and 1400001 --nothing-wrong; of the
// second nothing was chosen), and how many of the five drives with nothing wrong slip that ever did
// (952096, 952287, 1311979, 1312543, 1318431):
//   kSlipDetectable_s  0.35   0.28   0.42   0.35   0.35   0.25
//   slip beyond        0.025  0.025  0.025  0.020  0.030  0.018, and the ride ends at the floor
//   lab                157    157    157    152    159    142
//   production         165    165    157    151    164    143
//   harsh              87     109    67     70     93     101
//   slip               0      2      0      0      2      0
constexpr double kSlipDetectable_s = 0.35;
constexpr double kFlatFall = 0.05;  // of mu per unit of slip
constexpr double kSlipSpan = 1.05;  // 1 + sigma, of the slip beyond the peak
// So that nothing is divided by zero, far below what is measured: a millisecond, a hundredth of a
// point, a tenth of a point a second. A third less or half as much again changes no test of
// tests/mutate.
constexpr double kLeastLag_s = 1e-3, kLeastBeyond_share = 1e-4, kLeastRate_1_s = 1e-3;
constexpr std::size_t kCorners = 4;
constexpr int kHalvings = 6;  // chosen: the fall that is survived, to 2 % of what must be
constexpr int kBisections = 16;

// After the actuator has been told. With E = exp(a t) - 1 and L = exp(-t / lag) - 1
//   x = x1 + c E - d L
// Each stands once, for E may be infinite; and few of them, for they are what a search costs.
class Recovery {
 public:
  Recovery(double a, double w, double x1, double y1, double g, double lag_s) noexcept
      : a_(a), w_(w), x1_(x1), y1_(y1), g_(g), lag_s_(lag_s) {
    d_ = w * g / (a + 1.0 / lag_s);
    c_ = x1 + w * (y1 - g) / a + d_;
  }
  double slip_share(double t) const noexcept {
    return x1_ + c_ * std::expm1(a_ * t) - d_ * std::expm1(-t / lag_s_);
  }
  double slope(double t) const noexcept {
    const double answered = std::expm1(-t / lag_s_);
    const double slip_share = x1_ + c_ * std::expm1(a_ * t) - d_ * answered;
    return a_ * slip_share + w_ * (y1_ + g_ * answered);
  }
  // The integral of the slip up to t.
  double area_s(double t) const noexcept {
    return x1_ * t + c_ * (std::expm1(a_ * t) / a_ - t) +
           d_ * (lag_s_ * std::expm1(-t / lag_s_) + t);
  }

 private:
  double a_, w_, x1_, y1_, g_, lag_s_;
  double c_ = 0.0, d_ = 0.0;
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

Excursion larger(const Excursion& a, const Excursion& b) noexcept {
  return {std::max(a.slip_share, b.slip_share), std::max(a.time_s, b.time_s),
          std::max(a.area_s, b.area_s)};
}

double runaway_1_s(const RampPoint& point) noexcept {
  return point.torque_Nm * kSlipSpan / (point.inertia_kg_m2 * point.omega_p_rad_s);
}

// From the actuator's answer on, x1 beyond the peak with the share y1 of force missing.
Excursion caught(const RampPoint& point, double a, double x1, double y1, double lag_s) noexcept {
  const double force_N = peak_force_N(point, point.mu_least);
  const double g = std::max(0.0, point.own_force_N / force_N - 1.0 + y1);
  const Recovery recovery(a, runaway_1_s(point), x1, y1, g, lag_s);
  // Where the own force does not catch the belt any more, slip grows without bound.
  const double horizon_s = 8.0 * lag_s + 1.0;
  if (recovery.slope(horizon_s) > 0.0) return {kNotCaught, kNotCaught, kNotCaught};
  const double top_s = last_positive([&](double t) { return recovery.slope(t); }, 0.0, horizon_s);
  // Back below the peak's slip.
  const double end_s =
      last_positive([&](double t) { return recovery.slip_share(t); }, top_s, horizon_s);
  return {std::max(x1, recovery.slip_share(top_s)), end_s, recovery.area_s(end_s)};
}

}  // namespace

double peak_force_N(const RampPoint& point, double mu) noexcept {
  return point.torque_Nm * point.wedge_cosine / (2.0 * point.primary_radius_m * mu);
}

double reachable_mu(const RampPoint& point) noexcept {
  return point.torque_Nm * point.wedge_cosine / (2.0 * point.primary_radius_m * point.floor_N);
}

double ramp_at_the_top_N_per_s(const RampPoint& point, double answer_s,
                               double slip_rate_1_s) noexcept {
  return slip_rate_1_s * peak_force_N(point, point.mu_expected) / (runaway_1_s(point) * answer_s);
}

Excursion excursion(const RampPoint& point, const Reaction& reaction, double slip_rate_1_s,
                    double fall, double slip_detectable_share, double reaction_s) noexcept {
  const double w = runaway_1_s(point);
  const double a = w * fall / point.mu_least;
  const double lag_s = std::max(reaction.lag_s, kLeastLag_s);
  const double y1 = slip_rate_1_s / w;
  const double seen_s = std::log1p(a * slip_detectable_share / slip_rate_1_s) / a;
  const double told_s = seen_s + reaction.detection_s + reaction_s + reaction.dead_time_s;
  const double x1 = slip_rate_1_s / a * std::expm1(a * told_s);
  const Excursion back = caught(point, a, x1, y1, lag_s);
  return {back.slip_share, told_s + back.time_s, (x1 - slip_rate_1_s * told_s) / a + back.area_s};
}

double energy_to_come_J(const RampPoint& point, const Reaction& reaction, const Beyond& now,
                        double told_s) noexcept {
  const double w = runaway_1_s(point);
  const double x0 = std::max(now.beyond_share, kLeastBeyond_share);
  const double rate_1_s = std::max(now.slip_rate_1_s, kLeastRate_1_s);
  const double a = std::min(w * point.fall / point.mu_least, rate_1_s / x0);
  const double y1 = rate_1_s / w - a * x0 / w;
  const double answered_s = told_s + reaction.dead_time_s;
  // From x0 on it grows by that rate, e-fold every 1 / a.
  const double grown_share = rate_1_s / a * std::expm1(a * answered_s);
  const Excursion back =
      caught(point, a, x0 + grown_share, y1, std::max(reaction.lag_s, kLeastLag_s));
  const double beyond_s = x0 * answered_s + (grown_share - rate_1_s * answered_s) / a + back.area_s;
  if (back.time_s >= kNotCaught) return kNotCaught;
  return point.torque_Nm * point.omega_p_rad_s *
         ((now.slip_share - now.beyond_share) * (answered_s + back.time_s) + beyond_s);
}

double peak_slip_max_share(const Crossing& crossing, const SlipLimits& limits, double torque_Nm,
                           double omega_p_rad_s, double primary_radius_m) noexcept {
  const double slip_share = std::min(
      limits.slip_max_share, limits.slip_speed_max_m_s / (omega_p_rad_s * primary_radius_m));
  const double turn_W = std::max(1.0, torque_Nm * omega_p_rad_s);  // of a whole turn of slip
  const Excursion& cost = crossing.dearest;
  const double by_fall = (limits.energy_max_J / turn_W - cost.area_s) / cost.time_s;
  return std::min(slip_share - cost.slip_share, by_fall);
}

CrossingSearch::CrossingSearch(const RampPoint& point, const Reaction& reaction,
                               const SlipLimits& limits) noexcept
    : point_(point),
      reaction_(reaction),
      limits_(limits),
      to_try_(kCorners * kSlipRates_1_s.size()),
      done_(false) {}

CrossingSearch::CrossingSearch(const RampPoint& point, const Reaction& reaction,
                               const SlipLimits& limits, double slip_rate_1_s) noexcept
    : CrossingSearch(point, reaction, limits) {
  const auto* const rate = std::find(kSlipRates_1_s.begin(), kSlipRates_1_s.end(), slip_rate_1_s);
  if (rate == kSlipRates_1_s.end()) return;
  tried_ = kCorners * static_cast<std::size_t>(rate - kSlipRates_1_s.begin());
  to_try_ = tried_ + kCorners;
}

Excursion CrossingSearch::excursion_at(double slip_rate_1_s, Corner corner,
                                       double fall_share) const noexcept {
  const double silence_s = corner.fault ? std::max(reaction_.stale_s, reaction_.timeout_s) : 0.0;
  const double steepest = corner.fault ? point_.fall_at_fault : point_.fall;
  const double to_see_steep =
      std::max(kSlipDetectableSteep_share, kSlipDetectable_s * point_.slip_rate_noise_1_s);
  return excursion(
      point_, reaction_, slip_rate_1_s, corner.steep ? fall_share * steepest : kFlatFall,
      corner.steep ? to_see_steep : kSlipDetectableFlat_share, silence_s + reaction_.cycle_s);
}

bool CrossingSearch::step() noexcept {
  if (done_) return true;
  try_corner();
  done_ = tried_ == to_try_;
  if (done_ && crossing_.slip_rate_1_s <= 0.0) deny();
  return done_;
}

bool CrossingSearch::fall_known() const noexcept {
  return denied_.wall != CrossingWall::kFall || halvings_ == kHalvings;
}

// Steep and flat, nominal and worst, one rate after the other.
void CrossingSearch::try_corner() noexcept {
  const double rate_1_s = kSlipRates_1_s[tried_ / kCorners];
  const std::size_t at = tried_++ % kCorners;
  const Corner corner{.steep = at % 2 == 0, .fault = at >= 2};
  const Excursion all = excursion_at(rate_1_s, corner, 1.0);
  const Excursion cost = corner.steep ? all : Excursion{all.slip_share, 0.0, 0.0};
  if (at == 0) {
    tries_ = {};
    flat_ = {};
  }
  tries_.dearest = larger(tries_.dearest, cost);
  if (!corner.steep) flat_ = larger(flat_, all);
  if (at + 1 < kCorners) return;
  tries_.slip_rate_1_s = rate_1_s;
  tries_.peak_slip_max_share = peak_slip_max_share(tries_, limits_, point_.torque_Nm,
                                                   point_.omega_p_rad_s, point_.primary_radius_m);
  tries_.ramp_top_N_per_s =
      ramp_at_the_top_N_per_s(point_, reaction_.dead_time_s + reaction_.lag_s, rate_1_s);
  const double turn_W = std::max(1.0, point_.torque_Nm * point_.omega_p_rad_s);
  tries_.peak_slip_detectable_share = std::min(
      tries_.peak_slip_max_share, (limits_.energy_stop_J / turn_W - flat_.area_s) / flat_.time_s);
  if (tries_.dearest.slip_share < limits::kCrossingSlipBeyond_share &&
      tries_.peak_slip_max_share > point_.peak_slip_share &&
      tries_.peak_slip_detectable_share > crossing_.peak_slip_detectable_share) {
    crossing_ = tries_;
  }
}

// By the last rate, the slowest: it runs on least.
void CrossingSearch::deny() noexcept {
  const Excursion& cost = tries_.dearest;
  if (cost.slip_share >= limits::kCrossingSlipBeyond_share) {
    denied_ = {CrossingWall::kFall, 0.0, point_.fall};
    return;
  }
  const double slip_most_share =
      std::min(limits_.slip_max_share,
               limits_.slip_speed_max_m_s / (point_.omega_p_rad_s * point_.primary_radius_m));
  if (slip_most_share - cost.slip_share <= point_.peak_slip_share) {
    denied_ = {CrossingWall::kSlip, slip_most_share - cost.slip_share, point_.peak_slip_share};
    return;
  }
  const double turn_W = point_.torque_Nm * point_.omega_p_rad_s;
  denied_ = {CrossingWall::kEnergy, (point_.peak_slip_share * cost.time_s + cost.area_s) * turn_W,
             limits_.energy_max_J};
}

// Is half of the way between survived and lost survived, first with nothing wrong?
void CrossingSearch::step_fall() noexcept {
  if (fall_known()) return;
  const double share = 0.5 * (survived_ + lost_);
  const Excursion all = excursion_at(kSlipRates_1_s.back(), {.fault = fault_next_}, share);
  const bool survives = all.slip_share < limits::kCrossingSlipBeyond_share;
  if (survives && !fault_next_) {
    fault_next_ = true;
    return;
  }
  (survives ? survived_ : lost_) = share;
  denied_.figure = survived_ * point_.fall;
  fault_next_ = false;
  ++halvings_;
}

}  // namespace beltgrip::daemon
