// The reading of one channel, and one verdict on whether it is to be trusted: its glitches are left
// out, a step to another level is kept with its time, and a standstill is seen.
// Real-time thread.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "estimator/physics/units.h"
#include "estimator/reading/frozen_reading.h"
#include "estimator/reading/glitch_gate.h"

namespace beltgrip::estimator {

class ChannelReading {
 public:
  // may_rest: what is computed, not measured, may stand still.
  explicit ChannelReading(double sample_rate_hz, bool may_rest = false)
      : course_(sample_rate_hz),
        gate_(sample_rate_hz),
        may_rest_(may_rest),
        sample_rate_hz_(sample_rate_hz) {}
  void reset() noexcept {
    course_.reset();
    gate_.reset();
    stepped_s_ = kNever_s;
  }

  // One sample: the value without its glitches (glitch_gate.h).
  double without_glitch(double value, double share, double least) noexcept {
    return gate_.step(value, share, least);
  }
  bool jumped() const noexcept { return gate_.jumped(); }  // with the last sample
  // One sample, as it was read.
  void follow(double value) noexcept { course_.step(value); }
  // It has gone to another level, and nothing else says so; the first time counts.
  void take_step(double t_s) noexcept { stepped_s_ = std::min(stepped_s_, t_s); }

  ReadingVerdict verdict() const noexcept {
    if (!may_rest_ && course_.frozen()) return ReadingVerdict::kFrozen;
    if (!may_rest_ && course_.never_moved()) return ReadingVerdict::kNeverMoved;
    return has_stepped() ? ReadingVerdict::kStepped : ReadingVerdict::kValid;
  }
  // begin_ns: where the time of steps counts from; now_s: on it.
  ReadingStatus status(std::int64_t begin_ns, double now_s) const noexcept {
    ReadingStatus out = gate_.status();
    out.verdict = verdict();
    out.value = course_.value();
    const double stood_s = static_cast<double>(course_.still_samples()) / sample_rate_hz_;
    const double since_s = out.verdict == ReadingVerdict::kFrozen    ? now_s - stood_s
                           : out.verdict == ReadingVerdict::kStepped ? stepped_s_
                                                                     : 0.0;
    out.since_ns = begin_ns + std::llround(since_s / kNanosecond_s);
    return out;
  }
  // A channel that stands still may have stepped before.
  bool has_stepped() const noexcept { return stepped_s_ < kNever_s; }
  double stepped_s() const noexcept { return stepped_s_; }  // infinite: never
  bool moves() const noexcept { return course_.moves(); }

 private:
  static constexpr double kNever_s = std::numeric_limits<double>::infinity();

  FrozenReading course_;
  GlitchGate gate_;
  bool may_rest_;
  double sample_rate_hz_;
  double stepped_s_ = kNever_s;
};

}  // namespace beltgrip::estimator
