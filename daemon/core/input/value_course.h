// Has a signal that is still received come to stand still? Judged from its own values: its
// resolution, its noise, how it moved until then, and how far it should have moved by what else is
// known. Real-time thread; no allocation.
//
// A run is a stretch of equal values. A live signal makes one of n values
//   - of noise sigma and resolution q, while its mean moves by m across the middle of a step, with
//     a probability of at most the product of the chances of each value to stay within the step:
//     at kNever it is none. White noise alone counts, by which successive changes turn back:
//     sigma^2 = - mean(d_k d_k+1) - q^2/12, d less their drift where there is inertia. A step
//     makes that smaller, never larger;
//   - while it moves by 3 q + 5 times its scatter, noise or not: never.
// How far it would have moved is told by its own slope until then where it has inertia, or by the
// caller, who knows the rest. What is known of a signal is known from the values before the run.
#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include "daemon/core/base/mono_time.h"

namespace beltgrip::daemon {

class ValueCourse {
 public:
  ValueCourse() = default;
  // step: the smallest by which the value can change. The signal may come in coarser ones.
  // has_inertia: it goes on as it did, and does not stop from one value to the next.
  explicit ValueCourse(double step, bool has_inertia = false)
      : step_(step), has_inertia_(has_inertia) {}
  void reset() noexcept;
  // Every value as received; stamps increase.
  void add(MonoTime t, double value) noexcept;

  // Has it stood for long enough to be judged at all? The rest is work for those that have.
  bool rests() const noexcept;
  // Would a live signal have moved since its last change, if the rest says that it should have by
  // `moved` (magnitude; 0: nothing is known), and, if it has inertia, if its slope goes_on?
  bool stands_still(double moved, bool goes_on) const noexcept;
  // After how long it would say so of a value that came every `period` and stood still from now on;
  // nothing: it might never.
  std::optional<Duration> shown_after(Duration period) const noexcept;
  MonoTime since() const noexcept { return since_; }
  Duration stood_for() const noexcept { return newest_ - since_; }
  double value() const noexcept { return value_; }
  double noise() const noexcept;       // one standard deviation
  double resolution() const noexcept;  // of the steps it has been seen to make

 private:
  struct Point {
    MonoTime t = MonoTime::origin();
    double value = 0.0;
  };
  static constexpr std::size_t kPoints = 32;
  static constexpr long kNarrow = 100;  // values without a change by more than one step
  const Point& point(std::size_t age) const noexcept {
    return points_[(count_ + kPoints - 1 - age) % kPoints];
  }
  void close_run(MonoTime t, double value) noexcept;
  double slope_per_s() const noexcept;
  Duration usual_hold() const noexcept;
  double evidence(double moved, double sigma) const noexcept;
  double moving(double sigma) const noexcept;
  double noise_most(double sigma) const noexcept;

  double step_ = 0.0;
  bool has_inertia_ = false;
  std::array<Point, kPoints> points_{};  // where runs began
  std::size_t count_ = 0;
  MonoTime since_, newest_;
  double value_ = 0.0;
  double change_ = 0.0;        // with which the run began
  long run_ = 0;               // values equal to the first of the run, beside it
  long since_wide_ = kNarrow;  // values since a change by more than one step
  double resolution_ = 0.0;    // 0: not known
  double turns_ = 0.0;         // mean of - d_k d_k+1
  double drift_ = 0.0;         // mean of the last d_k; 0 without inertia
  double scatter_ = 0.0;       // mean of |d_k - drift|
  double known_ = 0.0;         // values that it rests on
  MonoTime span_;              // begin of the present span of kSpan
  Duration longest_;           // run in it,
  Duration longest_before_;    // and in the one before
};

}  // namespace beltgrip::daemon
