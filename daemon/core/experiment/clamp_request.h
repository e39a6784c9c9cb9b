// The request for clamping force, from the first newton less to the force being back: the falling
// ramp, the backup stops that the estimator does not know of, whether the controller follows, and
// the cool-down. SI. Real-time thread; no allocation.
//
// Stops while a request stands (strict):
//   Slip         since the start more than kRequestSlip_share, or kRequestSlipBeyond_share more
//                than where friction was largest
//   SlipRate     it grows faster than the ramp holds it, beyond its noise, while friction does not
//                rise; or faster than kRequestSlipRate_1_s
//   SlipEnergy   beyond the peak, as slip_damage has it: energy with what is still to come, power,
//                or time at high slip speed
//   Room         a peak that came now could not be crossed inside the promised limits any more, as
//                planned or, near the end of the room, by what the belt has carried
//   Lag          the force answers later than the crossing was planned for, or did not show in the
//                rest of its fall that it does not
//   ForceFloor   the request is at its floor, which no longer falls with the speed, or has risen;
//                or the coast-down is over; or a belt of more friction than was expected holds
//                there
//   Time         the request has stood for kRequestLongest
//   EngineSpeed  the primary has left the band around the speed that the secondary gives it at the
//                start's ratio, or has fallen below its least speed: macro slip pulls the engine
//                down in overrun, lets it flare up in drive
//   Torque       the torque has left the band around that of the start
//   InputFrozen  the speed ratio has moved against the direction in which the torque slips the belt
//                (slip falls while the force does), and one shaft alone says so: its speed has left
//                that of the engine or of the wheels as well, and is not true
//   Ratio        the same, and no shaft alone: the transmission shifts
#pragma once

#include <array>
#include <optional>

#include "daemon/core/base/limits.h"
#include "daemon/core/base/mono_time.h"
#include "daemon/core/config/options/config.h"
#include "daemon/core/experiment/answer_proof.h"
#include "daemon/core/experiment/ramp_rate.h"
#include "daemon/core/experiment/reachability.h"
#include "daemon/core/experiment/request_plan.h"
#include "daemon/core/experiment/slip_course.h"
#include "daemon/core/experiment/slip_damage.h"
#include "daemon/core/input/stop_cause.h"
#include "estimator/method/slip_curve_estimator.h"

namespace beltgrip::daemon {

class ClampRequest {
 public:
  static constexpr double kSpeedBand = 0.08;   // share of the speed: more than slip may take
  static constexpr double kTorqueBand = 0.35;  // share of the torque
  static constexpr double kTorqueBand_Nm = 5.0;
  static constexpr double kRatioBand = 0.015;  // share of the ratio, the wrong way
  static constexpr double kFollowBand = 0.05;  // share of the force
  static constexpr double kFollowBand_N = 80.0;
  static constexpr Duration kFollowTime = 100 * kMillisecond;
  static constexpr Duration kReleaseTime = 1500 * kMillisecond;  // then the force must be back
  static constexpr double kRestored = 0.85;                      // of the force before the request

  explicit ClampRequest(const Config& config);

  struct Now {
    MonoTime t = MonoTime::origin();
    double omega_p_rad_s = 0.0;
    double omega_s_rad_s = 0.0;
    double torque_Nm = 0.0;  // on the belt, signed
    double clamp_force_N = 0.0;
    double mu_star = 0.0;
    double omega_e_rad_s = 0.0;  // engine, lock-up closed; 0: not known
    double speed_m_s = 0.0;      // of the vehicle; 0: not known
    // The force as the pressure's newest value has it, and when that came.
    MonoTime read_at = MonoTime::origin();
    double read_N = 0.0;
  };
  void begin(const Now& now, const RequestPlan& plan, double floor_N,
             const AnswerLag::Reading& reading) noexcept;
  // Every sample while it stands and the inputs are usable.
  void step(const Now& now, double floor_N) noexcept;
  // Instead, where another has asked: its force.
  void follow(const Now& now, double floor_N, double force_N) noexcept;
  // And while they are not: the force stays.
  void hold(MonoTime t) noexcept;
  // Also without a request: the cool-down begins.
  void end(MonoTime t) noexcept;

  bool standing() const noexcept { return standing_; }
  double force_N() const noexcept { return standing_ ? force_N_ : 0.0; }
  double rate_N_per_s() const noexcept { return rate_N_per_s_; }
  // The slowest of the last kRecent.
  double rate_least_N_per_s() const noexcept;
  estimator::StopReason backup_stop() const noexcept { return stop_.reason; }
  const StopCause& cause() const noexcept { return stop_.cause; }
  // False: the clamping force has been off the request for kFollowTime.
  bool followed() const noexcept { return followed_; }
  double off_N() const noexcept { return off_N_; }  // at the last sample
  double follow_band_N() const noexcept;
  // The force asked for has changed since then by as much as counts as not followed.
  bool changed_since(MonoTime t) const noexcept;
  // The largest slip since the start, of the request that stands or was the last.
  double slip_max_share() const noexcept { return slip_.slip_max_share(); }

  // After the end.
  bool released(const Now& now) const noexcept;
  bool stuck(const Now& now) const noexcept;
  void follow_release(const Now& now) noexcept;  // every sample
  MonoTime ended() const noexcept { return ended_; }
  // From the speeds alone: has the slip of the request gone back? Nothing: it was too small to say.
  std::optional<bool> grips_again() const noexcept;

  // Time and distance since the last request, or since the start of the daemon.
  void travel(MonoTime t, double speed_m_s) noexcept;
  bool cooled() const noexcept;

 private:
  Stop judge(const Now& now, double floor_N) const noexcept;
  Stop judge_slip(const Now& now) const noexcept;
  Stop judge_damage(const Now& now) const noexcept;
  Stop judge_room() const noexcept;
  Stop judge_lag() const noexcept;
  bool belt_holds() const noexcept;
  Stop judge_floor(const Now& now, double floor_N) const noexcept;
  Stop judge_course(const Now& now) const noexcept;
  std::optional<Role> untrue_speed(const Now& now, double drift) const noexcept;
  void follow_belt(const Now& now) noexcept;
  double wanted_rate_N_per_s(double mu_star) const noexcept;
  double lowered_N(const Now& now, double floor_N) noexcept;
  void look_back() noexcept;
  void go_to(const Now& now, double floor_N, double force_N) noexcept;
  double answer_s() const noexcept {
    return settings_.actuator_dead_time_s + settings_.actuator_lag_s;
  }
  double power_W(const Now& now) const noexcept;
  RampPoint point_now(const Now& now, double mu) const noexcept;
  double slip_in_all_share() const noexcept;  // of the belt, from no slip on
  double room_share(const Now& now) const noexcept;
  double told_s() const noexcept;  // from a decision to the actuator
  double energy_to_come_J(const Now& now) const noexcept;
  void reckon_anew(const Now& now) noexcept;

  ExperimentSettings settings_;
  bool standing_ = false;
  bool followed_ = true;
  bool travelled_ = false;
  Stop stop_;
  MonoTime begun_;
  MonoTime ended_;
  MonoTime last_;
  MonoTime off_since_;
  MonoTime last_travel_;
  double rest_s_ = 0.0;
  double rest_m_ = 0.0;
  double force_N_ = 0.0;
  double off_N_ = 0.0;
  double rate_max_N_per_s_;
  double rate_N_per_s_ = 0.0;  // of the last sample
  double start_force_N_ = 0.0;
  double start_torque_Nm_ = 0.0;
  double start_ratio_ = 0.0;
  double start_engine_ = 0.0;  // omega_e / omega_p; 0: not known
  double start_wheels_ = 0.0;  // speed / omega_s; 0: not known
  double speed_step_m_s_ = 0.0;

  RequestPlan plan_;
  CrossingSearch anew_;
  double room_share_ = 0.0;  // of slip in all, for a peak that comes now
  RampLaw law_;
  bool far_ = true;     // the peak, still
  bool rides_ = false;  // on its floor, since then
  MonoTime rides_since_;
  double floor_first_N_ = 0.0;
  SlipCourse slip_;
  SlipDamage damage_;
  AnswerProof proof_;
  Duration sample_;  // between two
  // The force asked for, every kCoursePeriod; newest at count - 1.
  struct Asked {
    MonoTime t = MonoTime::origin();
    double force_N = 0.0;
    double rate_N_per_s = 0.0;  // of its fall since the one before
    double slip_share = 0.0;    // since the start
  };
  static constexpr std::size_t kAsked = 64;
  static constexpr Duration kCoursePeriod = 20 * kMillisecond;
  static constexpr Duration kRecent = 300 * kMillisecond;
  const Asked& asked(std::size_t age) const noexcept {
    return asked_[(asked_count_ - 1 - age) % kAsked];
  }
  std::array<Asked, kAsked> asked_{};
  std::size_t asked_count_ = 0;
  double recent_least_N_per_s_ = 0.0;
  MonoTime recent_until_;
  double slip_after_share_ = 0.0;  // mean of the last kSlipAfter
};

}  // namespace beltgrip::daemon
