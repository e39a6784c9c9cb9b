// Everything one sample decided: for log, trace, recorder and tests. Put together last, from what
// the stages say; no stage knows it, and nothing that decides reads it.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>

#include "daemon/core/base/faults.h"
#include "daemon/core/experiment/experiment.h"
#include "estimator/method/slip_curve_estimator.h"

namespace beltgrip::daemon {

struct SampleReport {
  MonoTime t = MonoTime::origin();
  State state = State::kInhibited;
  bool in_experiment = false;
  bool macro_slip_stop = false;
  estimator::StopReason stop_reason = estimator::StopReason::kNone;  // while macro_slip_stop
  StopCause stop_cause;                                              // beside it
  estimator::VariatorSample sample;
  estimator::CurveEstimate curve;
  bool new_result = false;               // an experiment has come to its outcome with this sample
  ExperimentResult result;               // the last one; outcome kNone before the first
  std::uint32_t faults = 0;              // fault_bit()s of faults.h
  std::uint32_t foreign_identifier = 0;  // the last one that a foreign sender used
  std::optional<Role> frozen;  // with fault InputFrozen: which input it is, where that is known
  std::uint32_t inhibits = 0;  // inhibit_bit()s of arming.h, triggers "coast_down" and "steady"
  // Every input is as it should be, and the lock-up closed, as far as a role says.
  bool torque_is_the_belts = false;
  double oil_degC = std::numeric_limits<double>::quiet_NaN();  // no number: not known
  // Of the most lasting of the inhibits that forbid a request: its figure and limit.
  StopCause obstacle;
  BeyondBox beyond;              // with this sample: why there is no curve
  double request_force_N = 0.0;  // as asked for with this sample; 0: no request stands
  double ramp_N_per_s = 0.0;     // of the request that stands
};

}  // namespace beltgrip::daemon
