// The independent guard of clamp requests: judges each sample from signals alone and withdraws the
// permission to ask. Shares no state and no code with the experiment or the estimator: slip here is
// the drift of the speed ratio since the request began, so that neither the calibration of the end
// stops nor the filters matter. SI; slip as a fraction. Real-time thread.
//
// A request may stand while all of this holds (strict: the limit itself is still allowed):
//   every input is there and fresh; both shafts turn, the primary at least at speed_min
//   |drift of the speed ratio| <= slip_max_share at every sample, <= slip_debounced_share but for
//     less than 10 ms
//   while the force asked for is above force_near_share of the first: |mean drift| of 40 ms, from
//   the
//     mean of the first 80 ms, <= slip_near_share, and less the nearer. A belt that slips there
//     has less friction than was measured last, and the controller's own force, to which it
//     returns, could not catch it beyond the peak
//   slip speed <= slip_speed_max
//   engine speed over primary speed within engine_drift of what it was, but for less than 25 ms:
//   macro slip shows in both, speeds of the pulleys that are old or wrong do not
//   |drift| grows no faster than slip_rate_max, smoothed over 40 ms, beyond slip_rate_from_share
//   power, |T| omega_p |drift|, <= power_max but for less than power_for: it cannot know where the
//     peak of friction lies, and so not what slip beyond it costs
//   the force asked for is >= floor, never rises, and falls no faster than rate_max
//   it begins at start_share of the force that acts, or above; smoothed over 100 ms
//   it has stood no longer than duration_max, and begins no sooner than pause_min after the last
// The first violation withdraws the permission until the request has ended; the pause then begins.
#pragma once

#include <cstdint>
#include <limits>

#include "daemon/core/base/limits.h"
#include "daemon/core/base/mono_time.h"

namespace beltgrip::daemon {

struct SafetyLimits {
  double slip_max_share = limits::kMonitorSlip_share;
  double slip_debounced_share = limits::kMonitorSlipDebounced_share;
  double slip_near_share = 0.0048;
  double slip_nearest_share = 0.0015;  // at the first force; in between along a line
  double force_near_share = 0.84;
  double slip_speed_max_m_s = limits::kMonitorSlipSpeed_m_s;
  double slip_rate_max_1_s = limits::kMonitorSlipRate_1_s;
  double slip_rate_from_share = 0.02;
  double power_max_W = limits::kMonitorPower_W;
  Duration power_for = limits::kMonitorPowerFor;
  double engine_drift = 0.025;
  double speed_min_rad_s = 85.0;
  double rate_max_N_per_s = 300.0;
  double spring_force_N = 0.0;  // floor = spring + centrifugal * omega_s^2 + floor_force
  double centrifugal_N_s2 = 0.0;
  double floor_force_N = 0.0;
  double start_share = limits::kMonitorStartShare;
  Duration duration_max = limits::kMonitorLongest;
  Duration pause_min = 10 * kSecond;
};

struct SafetySignals {
  bool fresh = false;  // every input of this sample, and those the request depends on
  double omega_p_rad_s = 0.0;
  double omega_s_rad_s = 0.0;
  double torque_Nm = 0.0;
  double primary_radius_m = 0.0;
  double omega_e_rad_s = 0.0;  // engine, from another node; 0: not known
  double clamp_force_N = 0.0;  // that acts, from the pressure of this sample
};

enum class SafetyVerdict : std::uint8_t {
  kAllowed,
  kInputs,
  kSpeed,
  kSecondary,
  kSlip,
  kSlipSpeed,
  kSlipRate,
  kPower,
  kEngine,
  kFloor,
  kStart,
  kRise,
  kRate,
  kDuration,
  kPause
};

class SafetyMonitor {
 public:
  explicit SafetyMonitor(const SafetyLimits& limits) noexcept : limits_(limits) {}

  // One sample: the force that would be asked for (0: none). Anything but kAllowed: it must not be.
  SafetyVerdict check(MonoTime t, const SafetySignals& signals, double request_N) noexcept;
  // Of the last verdict with a limit (kSlip to kEngine, kFloor, kStart): what was found, and the
  // limit.
  double figure() const noexcept { return figure_; }
  double limit() const noexcept { return limit_; }

 private:
  SafetyVerdict beyond(SafetyVerdict verdict, double figure, double limit) noexcept {
    figure_ = figure;
    limit_ = limit;
    return verdict;
  }
  SafetyVerdict judge(MonoTime t, const SafetySignals& signals, double request_N) noexcept;
  SafetyVerdict judge_motion(MonoTime t, const SafetySignals& signals, double request_N) noexcept;
  bool slips_away(MonoTime t, double drift) noexcept;
  bool slips_near_own_force(MonoTime t, double ratio, double request_N) noexcept;
  SafetyVerdict judge_request(MonoTime t, double request_N, double floor_N) noexcept;
  void see_acting_force(MonoTime t, const SafetySignals& signals) noexcept;
  void end(MonoTime t) noexcept;

  SafetyLimits limits_;
  SafetyVerdict withdrawn_ = SafetyVerdict::kAllowed;
  bool standing_ = false;
  bool asked_before_ = false;
  MonoTime begun_;
  MonoTime ended_;
  MonoTime last_;
  double reference_ratio_ = 0.0;
  double first_request_N_ = 0.0;
  double last_request_N_ = 0.0;
  static constexpr MonoTime kNever = MonoTime::max();
  MonoTime beyond_since_ = kNever;  // slip_debounced_share
  MonoTime power_since_ = kNever;
  double slip_mean_share_ = 0.0, slip_rate_1_s_ = 0.0;
  double acting_N_ = 0.0;  // smoothed; 0: not known
  MonoTime acting_seen_;
  double near_count_ = 0.0;
  double near_sum_ = 0.0;          // of the first speed ratios
  double near_mean_ = 0.0;         // drift from their mean
  double reference_engine_ = 0.0;  // omega_e / omega_p at the start; 0: not known
  MonoTime engine_beyond_since_ = kNever;
  double figure_ = 0.0, limit_ = 0.0;
};

}  // namespace beltgrip::daemon
