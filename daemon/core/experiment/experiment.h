// States and results of an experiment. The state machine decides when an experiment begins, stops,
// is evaluated and is over; nothing else does. Pure, no clock, no allocation. Real-time thread.
//
//   state       guard, first that holds                next        action
//   Inhibited   faulted                                Fault       -
//   Idle        not inputs_usable or not bus_up        Inhibited   -
//   Settling    not triggered                          Idle        -
//               not settled                            Settling    -
//               cleared                                Ramping     start
//               otherwise                              Evaluating  refuse
//   Ramping     not bus_up                             Releasing   abort (Bus)
//               inputs_lost                            Releasing   abort (lost_reason)
//               withdrawn                              Releasing   abort (withdrawn_reason)
//               stop_decided                           Evaluating  stop
//               not triggered                          Evaluating  end
//   Evaluating  concluded                              Releasing   publish
//   Releasing   stuck                                  Fault       over
//               not released                           Releasing   -
//               not cooled                             Cooldown    over
//               otherwise                              Inhibited   over
//   Cooldown    faulted                                Fault       -
//               cooled                                 Inhibited   -
//   Fault       faulted                                Fault       -
//               not cooled                             Cooldown    -
//               otherwise                              Inhibited   -
//
// A request for clamping force stands in Ramping alone; every other state lets go. Forbidden pairs,
// which the table leaves unreachable: Ramping after anything but Inhibited, Idle, Settling and
// itself; Evaluating or Releasing to Ramping; Cooldown and Fault to Idle, Settling or Ramping.
// Where the clamping force did not come back, or the transmit gate refused a frame, the fault stays
// until a restart, and so does the state.
//
// How the guards are meant, by trigger and control:
//   triggered   "signal", "always": the trigger asks for an experiment, or for it to go on.
//               "coast_down", "steady": every precondition holds at this sample; in an experiment
//               that is observed, driver, permission and primary speed let it go on.
//   settled     "signal", "always": at once. Else: triggered has held for the settling time.
//   cleared     "observe": always. "command": the peak is reachable and a safe ramp was found.
//   released    "observe": not triggered; with "coast_down" and "steady" also the torque turned
//               round, or the force back that was lowered. "command": the clamping force is back.
//   cooled      "observe": at once. "command": time and distance have passed since the last
//   request. withdrawn, stuck, faulted: "command" alone.
// From the start to "over" one experiment runs; a stop or abort raises MacroSlipStop, which stays
// up until "over". With trigger "always", triggered never falls: one experiment a run.
#pragma once

#include <cstdint>
#include <limits>

#include "daemon/core/base/mono_time.h"
#include "daemon/core/estimate/beyond_box.h"
#include "daemon/core/input/stop_cause.h"
#include "estimator/method/slip_curve_estimator.h"

namespace beltgrip::daemon {

enum class State : std::uint8_t {  // wire values
  kInhibited,
  kIdle,
  kSettling,
  kRamping,
  kReleasing,
  kEvaluating,
  kCooldown,
  kFault
};
inline constexpr std::size_t kStateCount = 8;
enum class Outcome : std::uint8_t { kNone, kCompleted, kInconclusive, kAborted };  // wire values

struct ExperimentResult {
  MonoTime start = MonoTime::origin();  // first sample
  MonoTime end = MonoTime::origin();    // stop decision, or the last sample
  bool stopped = false;                 // a stop decision came (end is its instant)
  Outcome outcome = Outcome::kNone;
  estimator::StopReason stop_reason = estimator::StopReason::kNone;
  StopCause cause;  // beside it
  estimator::PeakEstimate peak;
  bool slipped = false;             // with less friction than was known, and gave no value
  BeyondBox beyond;                 // of a learned term, how many of its samples and how far
  double sigma_stop_percent = 0.0;  // magnitude
  std::int64_t samples = 0;         // from start to stop
  estimator::Direction direction = estimator::Direction::kDrive;
  estimator::EndStop end_stop = estimator::EndStop::kOverdrive;
  // Where it was at its end.
  double omega_p_rad_s = 0.0;
  double omega_s_rad_s = 0.0;
  double torque_Nm = 0.0;  // on the belt, signed
  double clamp_force_N = 0.0;
  // Of mu_max: the part by constant errors of the sensors and by assumed constants.
  double sensor_std = 0.0;
  double oil_degC = std::numeric_limits<double>::quiet_NaN();  // no number: not known
};

struct Guards {
  bool inputs_usable = false;  // every input can be used at this sample
  bool inputs_lost = false;    // an input is gone for longer than it may be, or stands still
  bool bus_up = false;
  bool triggered = false;
  bool stop_decided = false;  // by the estimator or a backup stop
  bool concluded = false;     // the evaluation is done
  bool settled = false;
  bool cleared = false;
  bool withdrawn = false;  // the request must end: driver, permission, safety monitor
  bool released = false;
  bool stuck = false;  // the clamping force does not come back
  bool cooled = false;
  bool faulted = false;  // a fault that forbids requests
  estimator::StopReason withdrawn_reason = estimator::StopReason::kNone;
  estimator::StopReason lost_reason = estimator::StopReason::kInputs;
};

enum class Action : std::uint8_t { kNone, kStart, kRefuse, kStop, kEnd, kAbort, kPublish, kOver };

struct Transition {
  State next = State::kInhibited;
  Action action = Action::kNone;
  estimator::StopReason abort_reason = estimator::StopReason::kNone;  // with kAbort
};

Transition next_state(State state, const Guards& guards) noexcept;

}  // namespace beltgrip::daemon
