// How late the clamping force answers, measured within a request: while it falls at a rate r the
// reading is behind the request by r times the lag, and by the sensor's offset. The step from a
// fast ramp to a slow one tells the two apart; a plain ramp does not. SI. Real-time thread.
#pragma once

#include "daemon/core/base/mono_time.h"

namespace beltgrip::daemon {

class AnswerLag {
 public:
  void begin(MonoTime t, double configured_s) noexcept;
  // The request's rate of fall, and how far the reading lies above it.
  void step(MonoTime t, double rate_N_per_s, double behind_N) noexcept;
  // At least that; 0: nothing is known yet. While the answer to a step of the rate is under way it
  // may be more than the truth, for the rate is put late by a lag alone: of the configured actuator
  // up to 1.25 times where a third of its answer is dead time, 1.5 times where all of it is.
  double least_s() const noexcept;

 private:
  double configured_s_ = 0.0;
  MonoTime begun_ = 0, last_ = 0;
  double rate_N_per_s_ = 0.0;  // as the reading shows it, later by about the lag
  double n_ = 0.0, rate_mean_ = 0.0, behind_mean_ = 0.0;
  double rate_square_ = 0.0, behind_square_ = 0.0, product_ = 0.0;  // about the means, sums
};

}  // namespace beltgrip::daemon
