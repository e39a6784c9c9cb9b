// When an experiment may begin: recognises a coast-down or a steady drive torque, names every
// precondition that does not hold, and, for control "command", finds out whether the peak of
// friction is in reach and which ramp is safe. Real-time thread; no allocation.
//
// The trigger holds while no precondition is missing. It has settled when it has held for kSettle
// without the speed ratio or the torque moving by more than kRatioDrift and kTorqueDrift; and, with
// control "command", either the way is clear and the controller's own force at rest, or patience
// has run out and waiting gains nothing: as the vehicle slows down, what was out of reach may come
// into reach.
//
// The way is planned to where the belt will cross its peak: as the vehicle slows down, the floor of
// the force, the slip speed and the energy leave room for later peaks, while the shaft can run away
// faster. A request waits while waiting gains room and the coast-down lasts long enough.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string_view>

#include "daemon/core/base/limits.h"
#include "daemon/core/base/mono_time.h"
#include "daemon/core/base/named.h"
#include "daemon/core/config/options/config.h"
#include "daemon/core/experiment/fall_shown.h"
#include "daemon/core/experiment/reachability.h"
#include "daemon/core/experiment/request_plan.h"
#include "daemon/core/experiment/slip_course.h"
#include "daemon/core/input/stop_cause.h"
#include "estimator/method/slip_curve_estimator.h"

namespace beltgrip::daemon {

// Why no experiment begins; one bit each.
enum class Inhibit : std::uint8_t {
  kInputs,      // an input, or a condition's signal, cannot be used
  kFault,       // a fault that forbids requests
  kPermission,  // experiment_permitted is 0
  kPedal,       // coast_down: the pedal is pressed
  kBrake,
  kLockup,       // open
  kRatio,        // not at an end stop
  kTorque,       // outside its window
  kSpeed,        // primary speed below its minimum
  kOil,          // too cold
  kCooldown,     // time or distance since the last request
  kUnreachable,  // the force floor lies above the peak's clamping force
  kRamp,         // no crossing whose worst-case reaction stays inside the slip limits
  kTime,         // the ramp would outlast the coast-down or the longest request
  kGrip,         // friction has fallen so far that the own force hardly holds the belt
  kForce,        // the controller's own force still rises or falls
  kQuiet,        // a speed that stood still would not show
  kWait,         // further on the crossing has more room
  kModel         // a learned term of the model file does not reach so far
};
inline constexpr std::size_t kInhibitCount = 19;
inline constexpr std::array<Named<Inhibit>, kInhibitCount> kInhibits{
    {{Inhibit::kInputs, "inputs"},
     {Inhibit::kFault, "fault"},
     {Inhibit::kPermission, "permission"},
     {Inhibit::kPedal, "pedal"},
     {Inhibit::kBrake, "brake"},
     {Inhibit::kLockup, "lock-up"},
     {Inhibit::kRatio, "ratio"},
     {Inhibit::kTorque, "torque"},
     {Inhibit::kSpeed, "speed"},
     {Inhibit::kOil, "oil"},
     {Inhibit::kCooldown, "cool-down"},
     {Inhibit::kUnreachable, "unreachable"},
     {Inhibit::kRamp, "ramp"},
     {Inhibit::kTime, "time"},
     {Inhibit::kGrip, "grip"},
     {Inhibit::kForce, "own force"},
     {Inhibit::kQuiet, "quiet"},
     {Inhibit::kWait, "wait"},
     {Inhibit::kModel, "model"}}};
static_assert(in_wire_order(kInhibits));

constexpr std::uint32_t inhibit_bit(Inhibit inhibit) {
  return std::uint32_t{1} << static_cast<unsigned>(inhibit);
}

// The signals beside the sample. Roles that the configuration leaves out count as fulfilled.
struct Conditions {
  bool fresh = true;
  bool permitted = true;
  bool lockup_closed = true;
  bool brake_pressed = false;
  double accelerator = 0.0;  // 0 to 1
  double oil_degC = 80.0;
};

// Slip of the last experiment with a value since the start of the daemon, under the controller's
// own force and at the peak; before the first value, of the first that was let go for its slip. The
// law of that force knows nothing of friction: where the belt slips more under it than it did,
// friction has fallen. A request ends in that force, which then must still hold the belt.
struct SlipShown {
  double own_percent = 0.0;
  double peak_percent = 0.0;  // 0: there was none
  FallRange fall{};           // of mu behind the peaks of all of them
};

// Why the way is not clear: what was found, and what it would have to be.
struct Obstacle {
  double figure = 0.0, limit = 0.0;
  CrossingWall wall = CrossingWall::kNone;  // of kRamp
  // What would do: the primary's speed below which the peak is in reach, rad/s; the ramp that is
  // fast enough, N/s. No number: nothing would. Of a fall: the own force, in that of the peak.
  double needed = std::numeric_limits<double>::quiet_NaN();
};

// Within which torque and speed an experiment may begin, by who lowers the force.
ExperimentSettings begins_within(const Config& config) noexcept;

class Arming {
 public:
  static constexpr Duration kSettle = 1500 * kMillisecond;
  static constexpr Duration kPatience = 8 * kSecond;  // after kSettle
  static constexpr Duration kClearancePeriod = 100 * kMillisecond;
  static constexpr double kRatioDrift = 0.01;
  static constexpr double kRatioTolerance = 0.03;  // chosen: a clamped belt slips by less
  static constexpr double kPedalReleased = 0.02;   // chosen: noise of a pedal at rest
  static constexpr double kTorqueDrift = 0.25;
  static constexpr double kTorqueDrift_Nm = 4.0;
  // Of the way from own_percent to peak_percent: on a tanh curve the own force is then at 90 % of
  // the peak, less than the friction of a cylinder and a falling engine torque may take away.
  static constexpr double kSlipShare = 0.4;
  static constexpr double kSlipLeast_percent = 0.15;  // beyond what sensors and deformation explain

  // The preconditions hold, and a request is forbidden for one of these.
  static constexpr std::uint32_t kForbids =
      inhibit_bit(Inhibit::kUnreachable) | inhibit_bit(Inhibit::kRamp) |
      inhibit_bit(Inhibit::kTime) | inhibit_bit(Inhibit::kGrip) | inhibit_bit(Inhibit::kForce) |
      inhibit_bit(Inhibit::kQuiet);

  explicit Arming(const Config& config);

  struct Now {
    MonoTime t = MonoTime::origin();
    bool usable = false;      // sample and curve
    bool beyond_box = false;  // of a learned term: why there is no curve
    bool cooled = true;
    bool faulted = false;
    double omega_p_rad_s = 0.0;
    double omega_s_rad_s = 0.0;
    double torque_Nm = 0.0;  // on the belt, signed
    double clamp_force_N = 0.0;
    double slip_percent = 0.0;          // in the direction of the torque
    double mu_max_known = 0.0;          // the last value; 0: none
    double mu_carried = 0.0;            // without a value, the last bound; 0: none
    SlipShown shown;                    // at this direction and end stop
    Duration stale = Duration::zero();  // how long the slowest input may be silent
    bool watched = true;                // a speed that stands still would show
    Conditions conditions;
  };
  // Every sample outside an experiment.
  void step(const Now& now) noexcept;
  void reset() noexcept { held_ = false; }

  double speed_min_rad_s() const noexcept { return settings_.primary_speed_min_rad_s; }
  bool triggered() const noexcept { return (inhibits_ & ~kClearance) == 0; }
  bool settled() const noexcept { return settled_; }
  bool cleared() const noexcept { return cleared_ && inhibits_ == 0; }
  std::uint32_t inhibits() const noexcept { return inhibits_; }
  // What of these ends an experiment that has begun; kNone: nothing. A little more is allowed than
  // at its start.
  Stop ended_by(const Conditions& now) const noexcept;
  const RequestPlan& plan() const noexcept { return plan_; }
  // Of the most lasting of the inhibits that forbid a request.
  const Obstacle& obstacle() const noexcept { return obstacle_; }
  // Mean since the trigger holds, of the last half second.
  double slip_percent() const noexcept { return slip_percent_; }

  // The force below which no request goes, at this secondary speed.
  double floor_N(double omega_s_rad_s) const noexcept;
  bool at_end_stop(double ratio, double force_N) const noexcept;
  // The speed ratio, as a share of an end stop's, may be that stop's under this clamping force.
  static bool rests_on_stop(double share_of_stop, double force_N) noexcept;

 private:
  static constexpr std::uint32_t kClearance = kForbids | inhibit_bit(Inhibit::kWait);
  std::uint32_t preconditions(const Now& now) const noexcept;
  void look(const Now& now) noexcept;
  void search_on(const Now& now) noexcept;
  std::uint32_t clearance(const Now& now) noexcept;
  RampPoint point_at(const Now& now, double omega_p_rad_s) const noexcept;
  Reaction reaction(const Now& now) const noexcept;
  double ramp_s(const RampPoint& point, double slip_rate_1_s, double rate_N_per_s) const noexcept;
  double rate_needed_N_per_s(const RampPoint& point, double slip_rate_1_s,
                             double left_s) const noexcept;
  double reached_below_rad_s(const RampPoint& point, double ratio) const noexcept;
  double slowing_rad_s2(const Now& now) const noexcept;
  bool steady(const Now& now) const noexcept;
  void follow_force(const Now& now) noexcept;
  double force_noise_N() const noexcept;
  bool force_at_rest() const noexcept;

  Trigger trigger_;
  Control control_;
  estimator::VariatorParameters variator_;
  estimator::RatioChoice choice_;
  ExperimentSettings settings_;
  double inertia_kg_m2_;
  double rate_max_N_per_s_;
  double cosine_;
  std::uint32_t inhibits_ = inhibit_bit(Inhibit::kInputs);
  bool held_ = false;
  bool settled_ = false;
  bool looked_ = false;   // since the trigger holds
  bool cleared_ = false;  // as found by the last look
  std::uint32_t unclear_ = 0;
  MonoTime held_since_;
  MonoTime next_look_;
  double ratio_since_ = 0.0;
  double torque_since_Nm_ = 0.0;
  double omega_p_since_rad_s_ = 0.0;
  double slip_percent_ = 0.0;
  double slip_samples_ = 0.0;
  SlipCourse slip_course_;  // for its noise
  MonoTime last_;           // sample while the trigger holds
  // Means of the own force over kForceBlock each since the trigger holds, newest at count - 1.
  static constexpr std::size_t kForceBlocks = 10;
  static constexpr Duration kForceBlock = 100 * kMillisecond;
  std::array<double, kForceBlocks> force_means_N_{};
  std::size_t force_count_ = 0;
  bool force_rests_ = false;  // as the last of them was complete
  double force_step_N_;       // least change that the pressure's signal can show
  MonoTime block_since_;
  double block_sum_N_ = 0.0, block_samples_ = 0.0;
  CrossingSearch search_;   // if the request began now
  CrossingSearch later_;    // if it began a little later
  CrossingSearch refused_;  // that found nothing, while it tells which fall is survived
  RequestPlan plan_;        // found by the last search
  Obstacle obstacle_;
};

}  // namespace beltgrip::daemon
