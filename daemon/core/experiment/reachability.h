// Before an experiment: can the peak of friction be reached at all, and is there a slip rate at
// which the belt can cross it and be caught again inside the slip limits? Pure functions of plain
// values, SI, slip as a fraction. No clock, no allocation; bounded work.
//
// Beyond the peak (slip sigma_pk, clamp force F_pk) the belt torque falls short of the shaft's by
// the share y of missing force and by the fall of friction; the shaft with inertia J takes it up:
//   x = sigma - sigma_pk,  dx/dt = a x + w y,   w = T (1 + sigma_max)^2 / (J omega),
//                                               a = w fall / mu
//   at the top dx/dt = v, the slip rate that the ramp holds: y = v / w, which is the force that is
//   still on its way; it stays, for above v the ramp holds   ->  x in closed form
//   after dead time, with lag tau towards the controller's own force:
//                                y = y1 - g (1 - exp(-t / tau)),  g = F_own / F_pk - 1 + y1
// Friction may fall as steeply as the point says, and is then seen early; or hardly at all, and is
// seen late: a crossing has to hold for both. Slip energy counts from the peak on: below it, slip
// is what every such belt does all day. On a flat top the request ends itself for that energy,
// what is still to come counted (slip_damage, energy_to_come_J), so that it needs no room
// beforehand.
#pragma once

#include <cstddef>
#include <cstdint>

#include "daemon/core/base/limits.h"

namespace beltgrip::daemon {

// What an experiment may do at most (promise G1).
struct SlipLimits {
  double slip_max_share = 0.10;  // ever
  double slip_speed_max_m_s = 0.8;
  double energy_max_J = 90.0;  // dissipated beyond the peak; 100 less what a model may be off
  double energy_stop_J = limits::kRequestEnergy_J;  // of a flat top, there the request ends itself
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

// The operating point at which the belt is to cross its peak. Magnitudes.
struct RampPoint {
  double torque_Nm = 0.0;  // on the belt
  double omega_p_rad_s = 0.0;
  double primary_radius_m = 0.0;
  double wedge_cosine = 1.0;
  double inertia_kg_m2 = 0.0;    // of the side that can run away
  double own_force_N = 0.0;      // before the request
  double floor_N = 0.0;          // the clamp goes no lower
  double mu_expected = 0.0;      // of the peak, at the most
  double mu_least = 0.0;         // of the peak, at the least: the own force then holds it least
  double peak_slip_share = 0.0;  // where it is expected at the latest
  // Of mu beyond the peak, at the steepest, per unit of slip: where nothing goes wrong, and with
  // the worst single fault beside it.
  double fall = 0.0;
  double fall_at_fault = 0.0;
  double slip_rate_noise_1_s = 0.0;  // one standard deviation, as a slip course reads it
};

// mu* at the force floor: the largest that can be reached.
double reachable_mu(const RampPoint& point) noexcept;
// Clamp force at which a belt with that friction just carries the torque.
double peak_force_N(const RampPoint& point, double mu) noexcept;
// The fastest ramp whose force on its way, at the top, makes slip grow by no more than that.
double ramp_at_the_top_N_per_s(const RampPoint& point, double answer_s,
                               double slip_rate_1_s) noexcept;

struct Excursion {
  double slip_share = 0.0;  // the largest beyond the peak
  double time_s = 0.0;      // spent beyond the peak
  double area_s = 0.0;      // integral of the slip beyond the peak over that time
};
inline constexpr double kNotCaught = 1e9;  // no figure but a mark: beyond every limit
// What becomes of the slip when the belt passes its peak at this slip rate, friction falls by
// `fall` behind it, the estimator needs detection_s after slip_detectable_share beyond the peak,
// and reaction_s passes before the actuator is told. Not caught: all kNotCaught.
Excursion excursion(const RampPoint& point, const Reaction& reaction, double slip_rate_1_s,
                    double fall, double slip_detectable_share, double reaction_s) noexcept;

// A belt beyond its peak. Slip in all and beyond the peak, and the rate at which it grows.
struct Beyond {
  double slip_share = 0.0;
  double beyond_share = 0.0;
  double slip_rate_1_s = 0.0;
};
// Slip energy, J, from now until the belt is back below its peak, where the actuator is told
// told_s from now and mu_least is what it has now. Friction may fall as steeply as the point says,
// but not by more than slip grows for it. kNotCaught or more where it is not caught.
double energy_to_come_J(const RampPoint& point, const Reaction& reaction, const Beyond& now,
                        double told_s) noexcept;

// How the belt is to be brought over its peak.
struct Crossing {
  double slip_rate_1_s = 0.0;     // 0: none is safe
  double ramp_top_N_per_s = 0.0;  // near the peak
  // What it costs at most, beyond a peak of any slip: slip of all, time and area of a steep fall. A
  // point in time has room for a crossing while slip + this slip and (slip * this time + this area)
  // T omega are inside the limits.
  Excursion dearest;
  double peak_slip_max_share = 0.0;  // the latest peak with room, at its point
  // And the latest whose flat top can be told before the request ends itself for its energy.
  double peak_slip_detectable_share = 0.0;
};
// The latest peak that this crossing has room for, where the shaft has this speed.
double peak_slip_max_share(const Crossing& crossing, const SlipLimits& limits, double torque_Nm,
                           double omega_p_rad_s, double primary_radius_m) noexcept;

// What stands in the way of every crossing; the figure and what it would have to be.
enum class CrossingWall : std::uint8_t {
  kNone,
  kFall,    // of friction behind the peak, per unit of slip: survived, and to be survived
  kSlip,    // of the latest peak with room, and of the latest to be expected
  kEnergy,  // J, of a crossing at that peak, and at the most
};
struct CrossingDenied {
  CrossingWall wall = CrossingWall::kNone;
  double figure = 0.0, limit = 0.0;
};

// The slip rate that tells the latest peak, with room both with a nominal stop and with the worst
// single fault: an input that falls silent until it counts as lost, or our own silence until the
// receiver's time-out.
class CrossingSearch {
 public:
  CrossingSearch() noexcept = default;  // done, nothing found
  CrossingSearch(const RampPoint& point, const Reaction& reaction,
                 const SlipLimits& limits) noexcept;
  // Of this slip rate alone, one of those that are tried.
  CrossingSearch(const RampPoint& point, const Reaction& reaction, const SlipLimits& limits,
                 double slip_rate_1_s) noexcept;
  // One excursion, about 5,000 instructions; true when the crossing stands.
  bool step() noexcept;
  bool done() const noexcept { return done_; }
  const RampPoint& point() const noexcept { return point_; }
  const Crossing& crossing() const noexcept { return crossing_; }
  // Once done: what stands in the way. The fall that is survived is known once fall_known(), by as
  // many calls of step_fall(), of one excursion each.
  const CrossingDenied& denied() const noexcept { return denied_; }
  bool fall_known() const noexcept;
  void step_fall() noexcept;

 private:
  // Of what a crossing has to hold for.
  struct Corner {
    bool steep = true;  // else a flat top
    bool fault = false;
  };
  Excursion excursion_at(double slip_rate_1_s, Corner corner, double fall_share) const noexcept;
  void try_corner() noexcept;
  void deny() noexcept;

  RampPoint point_;
  Reaction reaction_;
  SlipLimits limits_;
  std::size_t tried_ = 0, to_try_ = 0;
  bool done_ = true;
  Excursion flat_;  // of the rate that is tried
  Crossing tries_, crossing_;
  CrossingDenied denied_;
  // Shares of the falls that must be survived: one that is, one that is not.
  double survived_ = 0.0, lost_ = 1.0;
  int halvings_ = 0;
  bool fault_next_ = false;  // of this halving, nothing wrong is survived
};

}  // namespace beltgrip::daemon
