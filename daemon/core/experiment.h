// States and results of an experiment. The state machine decides when an experiment begins, stops,
// is evaluated and is over; nothing else does. Pure, no clock, no allocation. Real-time thread.
//
// Observed experiments (control "observe"; what a request needs comes with control "command"):
//
//   state       guard, first that holds                next        action
//   Inhibited   inputs_usable, bus_up, triggered       Ramping     start
//               inputs_usable, bus_up                  Idle        -
//   Idle        not inputs_usable or not bus_up        Inhibited   -
//               triggered                              Ramping     start
//   Ramping     not bus_up                             Releasing   abort (Bus)
//               inputs_lost                            Releasing   abort (Inputs)
//               stop_decided                           Evaluating  stop
//               not triggered                          Evaluating  end
//   Evaluating  concluded                              Releasing   publish
//   Releasing   not triggered                          Inhibited   over
//   others      (not entered in observe)               Inhibited   -
//
// From the start to "over" one experiment runs; a stop or abort raises MacroSlipStop, which stays
// up until "over". With trigger "always", triggered never falls: one experiment a run.
#pragma once

#include <cstdint>

#include "daemon/core/mono_time.h"
#include "estimator/slip_curve_estimator.h"

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
  MonoTime start = 0;    // first sample
  MonoTime end = 0;      // stop decision, or the last sample
  bool stopped = false;  // a stop decision came (end is its instant)
  Outcome outcome = Outcome::kNone;
  estimator::StopReason stop_reason = estimator::StopReason::kNone;
  estimator::PeakEstimate peak;
  double sigma_stop_percent = 0.0;  // magnitude
  std::int64_t samples = 0;         // from start to stop
  estimator::Direction direction = estimator::Direction::kDrive;
  estimator::EndStop end_stop = estimator::EndStop::kOverdrive;
};

struct Guards {
  bool inputs_usable = false;  // every input can be used at this sample
  bool inputs_lost = false;    // an input is gone for longer than it may be
  bool bus_up = false;
  bool triggered = false;     // the trigger asks for an experiment, or for it to go on
  bool stop_decided = false;  // the estimator says stop
  bool concluded = false;     // the evaluation is done
};

enum class Action : std::uint8_t { kNone, kStart, kStop, kEnd, kAbort, kPublish, kOver };

struct Transition {
  State next = State::kInhibited;
  Action action = Action::kNone;
  estimator::StopReason abort_reason = estimator::StopReason::kNone;  // with kAbort
};

Transition next_state(State state, const Guards& guards) noexcept;

}  // namespace beltgrip::daemon
