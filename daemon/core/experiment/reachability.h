// Before an experiment: can the peak of friction be reached at all, and is there a ramp whose
// worst-case reaction stays inside the slip limits? Pure functions of plain values, SI, slip as a
// fraction. No clock, no allocation; bounded work.
//
// Beyond the peak (slip sigma_pk, clamp force F_pk) the belt torque falls short of the shaft's by
// the share y of missing force and by the fall of friction; the shaft with inertia J takes it up:
//   x = sigma - sigma_pk,  dx/dt = a x + w y,   w = T (1 + sigma_max)^2 / (J omega),
//                                               a = w fall / mu
//   while the force falls at r:  y = r t / F_pk      ->  x in closed form, from dx/dt(0) = v0
//   after dead time, with lag tau towards the controller's own force:
//                                y = y1 - g (1 - exp(-t / tau)),  g = (F_own - F_1) / F_pk
// v0 = mu r / (F_pk k0): quasi-static, with k0 the slope of the curve just before its peak. The
// constants are the worst that is plausible: a fall of 4e-3 and a slope of 5e-3 per percent. Slip
// energy counts from the peak on: below it, slip is what every such belt does all day.
#pragma once

namespace beltgrip::daemon {

// What an experiment may do at most (promise G1).
struct SlipLimits {
  double slip_nominal = 0.05;  // at the stop
  double slip_max = 0.10;      // ever
  double slip_speed_max_m_s = 0.8;
  double energy_nominal_J = 50.0;  // dissipated beyond the peak
  double energy_max_J = 100.0;
};

// How long it takes from a fault, or the stop decision, to force.
struct Reaction {
  double detection_s = 0.0;  // from slip to the estimator's decision
  double stale_s = 0.0;      // a silent input counts as lost: the request is ended
  double timeout_s = 0.05;   // silence of ours: the receiver returns to its own force
  double cycle_s = 0.01;     // the receiver's own cycle
  double dead_time_s = 0.0;
  double lag_s = 0.0;
};

// The operating point before the ramp. Magnitudes.
struct RampPoint {
  double torque_Nm = 0.0;  // on the belt
  double omega_p_rad_s = 0.0;
  double primary_radius_m = 0.0;
  double wedge_cosine = 1.0;
  double inertia_kg_m2 = 0.0;  // of the side that can run away
  double own_force_N = 0.0;    // before the request
  double floor_N = 0.0;        // the clamp goes no lower
  double mu_expected = 0.0;    // of the peak
  double peak_slip = 0.0;      // where it is expected at the latest
};

// mu* at the force floor: the largest that can be reached.
double reachable_mu(const RampPoint& point) noexcept;
// Clamp force at which a belt with that friction just carries the torque.
double peak_force_N(const RampPoint& point, double mu) noexcept;

struct Excursion {
  double slip_at_stop = 0.0;  // when the estimator decides
  double slip_max = 0.0;
  double slip_speed_max_m_s = 0.0;
  double energy_J = 0.0;
};
// What becomes of the slip when the force falls at this rate beyond the peak, the estimator needs
// detection_s after kSlipToSee beyond the peak, and reaction_s passes before the actuator is told.
Excursion excursion(const RampPoint& point, const Reaction& reaction, double rate_N_per_s,
                    double reaction_s) noexcept;

inline constexpr double kSlipToSee = 0.010;  // beyond the peak, before the slope is certain

struct Ramp {
  double rate_N_per_s = 0.0;  // 0: none is safe
  double duration_s = 0.0;    // down to the peak of a belt of mu_expected
};
// The fastest rate up to rate_max_N_per_s that keeps the limits, both with a nominal stop and with
// the worst single fault, while the force goes on falling: an input that falls silent until it
// counts as lost, or our own silence until the receiver's time-out.
class RampSearch {
 public:
  RampSearch() noexcept = default;  // done, nothing found
  RampSearch(const RampPoint& point, const Reaction& reaction, const SlipLimits& limits,
             double rate_max_N_per_s) noexcept;
  // One excursion, about 8,000 instructions; true when the ramp stands.
  bool step() noexcept;
  bool done() const noexcept { return done_; }
  const Ramp& ramp() const noexcept { return ramp_; }

 private:
  void next_rate() noexcept;

  RampPoint point_;
  Reaction reaction_;
  SlipLimits limits_;
  double rate_N_per_s_ = 0.0;
  int tried_ = 0;
  bool nominal_holds_ = false;  // with the present rate
  bool done_ = true;
  Ramp ramp_;
};

}  // namespace beltgrip::daemon
