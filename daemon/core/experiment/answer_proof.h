// Whether the clamping force answers in time, told before the belt's peak comes near: early in its
// fall a request rests, until the readings have shown it. There nothing is lost by waiting: however
// late a controller obeys, it does not go below what was asked. What is not shown counts as late.
// SI. Real-time thread.
#pragma once

#include <cstdint>

#include "daemon/core/base/mono_time.h"
#include "daemon/core/experiment/answer_lag.h"

namespace beltgrip::daemon {

class AnswerProof {
 public:
  struct Setup {
    double force_N = 0.0;        // that is asked for first
    double follow_band_N = 0.0;  // by which a force that follows may be off it
    AnswerLag::Actuator configured;
    AnswerLag::Reading reading;
    Duration sample = Duration::zero();
  };
  struct Now {
    MonoTime t = MonoTime::origin();
    double asked_N = 0.0;
    MonoTime read_at = MonoTime::origin();  // the newest reading of the force,
    double read_N = 0.0;                    // and when it came
    bool near = false;                      // friction is what a peak may be expected at
    bool on_floor = false;
  };
  void begin(MonoTime t, const Setup& setup) noexcept;
  // Every sample, before it is asked for more.
  void step(const Now& now) noexcept;
  void ask(MonoTime t, double force_N) noexcept { lag_.ask(t, force_N); }

  bool falls() const noexcept { return rest_ == Rest::kComes; }  // towards the rest
  bool rests() const noexcept { return rest_ == Rest::kRests; }
  // By which the force creeps while it rests: through one step of its reading, for at rest in it no
  // number of readings tells where.
  double rest_N_per_s() const noexcept;
  // It answers later than a crossing is planned for.
  bool late() const noexcept { return late_; }
  // The rest is over, and did not show that it answers in time.
  bool unshown() const noexcept { return rest_ == Rest::kOver && !in_time_; }
  // At the least and at the most; and the bounds for them.
  double least_s() const noexcept { return lag_.least_s(); }
  double most_s() const noexcept { return lag_.most_s(); }
  double late_s() const noexcept { return late_s_; }
  double credible_s() const noexcept { return credible_s_; }

 private:
  enum class Rest : std::uint8_t { kComes, kRests, kOver };

  AnswerLag lag_;
  Setup setup_;
  double late_s_ = 0.0, credible_s_ = 0.0;
  Rest rest_ = Rest::kComes;
  MonoTime begun_, rests_since_, read_at_;
  Duration late_after_;
  bool in_time_ = false, late_ = false;  // shown, once for all
};

}  // namespace beltgrip::daemon
