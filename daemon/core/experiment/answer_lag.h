// How late the clamping force answers, measured within a request: the course of the force asked
// for is laid beside the readings, once for each lag that it may have (the actuator's own answer as
// configured, later by some more), and the lags whose course lies no further from the readings than
// noise explains are credible. A sensor that reads too much, and a controller that reckons its
// force otherwise, only move the whole course: what tells lags apart is that the rate of the fall
// changes. A plain ramp tells nothing. They do not move it by as much as it has fallen: a
// force that stays where it was has not answered yet, though it rests as one that has. SI.
// Real-time thread.
#pragma once

#include <array>
#include <cstddef>
#include <limits>

#include "daemon/core/base/mono_time.h"

namespace beltgrip::daemon {

class AnswerLag {
 public:
  struct Actuator {
    double dead_time_s = 0.0;
    double lag_s = 0.0;
  };
  // One reading of the force: a standard deviation, and the steps in which it is told.
  struct Reading {
    double noise_N = 0.0;
    double step_N = 0.0;
  };
  // What passes beside the actuator, from a request to its reading. Chosen: a frame, the
  // controller's cycle and a frame back, of 10 ms each.
  static constexpr double kTransport_s = 0.03;

  struct Setup {
    double force_N = 0.0;  // asked for so far
    Actuator configured;
    Reading reading;
    Duration sample = kNanosecond;  // between two calls of ask()
  };
  void begin(MonoTime t, const Setup& setup) noexcept;
  // Every sample.
  void ask(MonoTime t, double force_N) noexcept;
  // From now on readings count: the force has fallen by so much, at this rate, and rests or creeps.
  void measure(MonoTime t, double fallen_N, double rate_N_per_s) noexcept;
  // It falls on.
  void resume(MonoTime t) noexcept {
    rests_ = false;
    resumed_ = t;
  }
  // Every reading, with its own stamp.
  void read(MonoTime t, double force_N) noexcept;

  // The least and the most of the credible lags; while nothing is known: 0, and no end.
  double least_s() const noexcept { return least_s_; }
  double most_s() const noexcept { return most_s_; }

 private:
  // Of an actuator that answers at once but for dead time, what is quicker than configured; and of
  // one that answers as configured, later. The longest is some four times what is configured: what
  // is later still does not follow at all.
  static constexpr std::size_t kQuick = 4, kLate = 20;
  static constexpr std::size_t kKept = 32;  // kLate + 3 at the least
  struct Course {
    double now_N = 0.0;
    std::array<double, kKept> kept_N{};  // every period_
  };
  std::size_t lags() const noexcept { return quick_ + kLate; }
  double lag_s(std::size_t i) const noexcept {
    return i < quick_ ? static_cast<double>(i + 1) * seconds(period_)
                      : own_s_ + static_cast<double>(i - quick_ + 1) * seconds(period_);
  }
  void compare(const Course& course, std::size_t from, std::size_t count, double share,
               std::size_t newest, double force_N) noexcept;
  void bound() noexcept;

  double own_s_ = 0.0;                          // of the answer, what is no dead time
  double answered_ = 0.0;                       // share of it within a sample
  double noise_N_ = 0.0;                        // of one reading, with its rounding
  double rounding_N_ = 0.0, rounding_s_ = 0.0;  // that no mean over readings at rest takes away
  double step_N_ = 0.0, rests_from_N_ = 0.0;
  double crept_ = 0.0;  // through so much of a step, at rest
  bool rests_ = false;
  Duration enough_;  // how long readings are taken before they tell
  Duration period_ = kNanosecond;
  std::size_t quick_ = 0;  // of kQuick, those below the first of the others
  double offset_most_N_ = 0.0;
  Course asked_, answered_to_;        // what is asked for; and as answered without dead time
  std::size_t newest_at_ = 0;         // where the newest is that is kept,
  MonoTime newest_;                   // and its instant
  unsigned skipped_ = 0, taken_ = 0;  // readings
  MonoTime resumed_;
  bool measures_ = false;
  MonoTime measures_since_;
  double n_ = 0.0;
  std::array<double, kQuick + kLate> sums_N_{},
      squares_N2_{};  // of how far readings lie off each course
  double least_s_ = 0.0;
  double most_s_ = std::numeric_limits<double>::infinity();
};

}  // namespace beltgrip::daemon
