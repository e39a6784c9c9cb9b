#include "daemon/core/input/signal_history.h"

#include <algorithm>
#include <array>

namespace beltgrip::daemon {

namespace {
// How far ahead a line may be followed, in units of the time that its values span: the whole reach
// from two regular values on. Values that came in one burst after a pause span next to nothing;
// further ahead their noise would be taken for a steep slope.
constexpr double kAheadMaximum = 2.0;
}  // namespace

void SignalHistory::add(MonoTime t, double value) noexcept {
  if (size_ != 0 && t <= newest()) {
    points_[newest_].value = value;
    return;
  }
  newest_ = (newest_ + 1) % kCapacity;
  points_[newest_] = {t, value};
  size_ = std::min(size_ + 1, kCapacity);
}

bool SignalHistory::value_at(MonoTime t, Duration reach, double& value) const noexcept {
  if (size_ == 0) return false;
  const Point& last = at(0);
  if (t < last.t) {
    for (std::size_t age = 1; age < size_; ++age) {
      const Point& before = at(age);
      if (before.t > t) continue;
      const Point& after = at(age - 1);
      const double share = fraction(t - before.t, after.t - before.t);
      value = before.value + share * (after.value - before.value);
      return true;
    }
    return false;
  }
  if (t == last.t) {
    value = last.value;
    return true;
  }
  const std::size_t count = std::min(size_, kLine);
  if (count < 2) return false;
  const Duration span = last.t - at(count - 1).t;
  // Stamps relative to the newest, in units of the time they span.
  double mean_x = 0.0;
  std::array<double, kLine> stamps;
  for (std::size_t age = 0; age < count; ++age) {
    stamps[age] = fraction(at(age).t - last.t, span);
    mean_x += stamps[age];
  }
  mean_x /= static_cast<double>(count);
  double xx = 0.0, xy = 0.0;
  for (std::size_t age = 0; age < count; ++age) {
    const double x = stamps[age] - mean_x;
    xx += x * x;
    xy += x * (at(age).value - last.value);  // any constant: the x add up to nothing
  }
  const double ahead = fraction(std::min(t - last.t, reach), span);
  value = last.value + xy / xx * std::min(ahead, kAheadMaximum);
  return true;
}

}  // namespace beltgrip::daemon
