#include "daemon/core/experiment/answer_lag.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace beltgrip::daemon {

namespace {
// Chosen: between two lags, of the configured answer. At 600 N/s that are 18 N of a shipped
// actuator's, less than one reading's noise.
constexpr double kPeriodShare = 1.0 / 6.0;
// Chosen: noise explains a lag outside once in 370 looks, and the looks of one request are few
// independent ones.
constexpr double kDeviations = 3.0;
// Chosen: of readings, as many as the noise known from before counts for.
constexpr double kKnown = 8.0;
// Chosen: of the configured answer, how long readings are taken before they tell anything: with 1.0
// one late answer of 24 that a coarse pressure told was let pass (tests/daemon/core/loop,
// other_controller_test).
constexpr double kEnough = 1.5;
// Chosen: of the fall, by how much readings may lie off their course. Beyond it they may not have
// begun to fall; below, controller and daemon may reckon the force differently.
constexpr double kOffsetShare = 0.7;
// Derived: a line has two unknowns here, offset and lag.
constexpr double kUnknowns = 2.0;
// Chosen: so long after the rest each reading is taken, which tells a slow answer from a late one,
// and then one of so many: what they tell has been told.
constexpr Duration kRare = kSecond;
constexpr unsigned kTakenRarely = 16;
constexpr double kFar_N2 = 1e30;  // of a course that is not possible
}  // namespace

void AnswerLag::begin(MonoTime t, const Setup& setup) noexcept {
  *this = {};
  own_s_ = setup.configured.lag_s;
  answered_ = own_s_ > 0.0 ? -std::expm1(-seconds(setup.sample) / own_s_) : 1.0;
  const double planned_s = setup.configured.dead_time_s + setup.configured.lag_s + kTransport_s;
  enough_ = Duration::of_ns(std::llround(kEnough * planned_s * 1e9));
  period_ =
      setup.sample * std::max(1LL, std::llround(kPeriodShare * planned_s / seconds(setup.sample)));
  quick_ = std::min(kQuick, static_cast<std::size_t>(own_s_ / seconds(period_)));
  const Reading& reading = setup.reading;
  step_N_ = reading.step_N;
  noise_N_ = std::hypot(reading.noise_N, reading.step_N / std::sqrt(12.0));
  // The mean of readings at rest stays off by what rounding makes of it, unless noise carries them
  // over the steps: the first term of the series of a rounded value's mean.
  constexpr double kPi = std::numbers::pi;
  const double carries = reading.step_N > 0.0 ? kPi * reading.noise_N / reading.step_N : 0.0;
  rounding_N_ = reading.step_N / (kPi * std::numbers::sqrt2) * std::exp(-2.0 * carries * carries);
  newest_ = t;
  for (Course* each : {&asked_, &answered_to_}) {
    each->now_N = setup.force_N;
    each->kept_N.fill(setup.force_N);
  }
}

void AnswerLag::ask(MonoTime t, double force_N) noexcept {
  asked_.now_N = force_N;
  answered_to_.now_N += answered_ * (force_N - answered_to_.now_N);
  if (t - newest_ < period_) return;
  newest_ = t;
  newest_at_ = (newest_at_ + 1) % kKept;
  for (Course* each : {&asked_, &answered_to_}) each->kept_N[newest_at_] = each->now_N;
}

void AnswerLag::measure(MonoTime t, double fallen_N, double rate_N_per_s) noexcept {
  offset_most_N_ = kOffsetShare * fallen_N - kDeviations * rounding_N_;
  rests_from_N_ = asked_.now_N;
  measures_ = rests_ = true;
  measures_since_ = t;
  rounding_s_ = rate_N_per_s > 0.0 ? rounding_N_ / rate_N_per_s : 0.0;
}

void AnswerLag::read(MonoTime t, double force_N) noexcept {
  if (!measures_) return;
  if (!rests_ && t - resumed_ > kRare && ++skipped_ % kTakenRarely != 0) return;
  const double periods = fraction(t - newest_, period_);
  const double whole = std::floor(periods), share = periods - whole;
  if (whole > 0.0 || whole < -2.0) return;  // its courses are not kept
  const std::size_t newest = newest_at_ + kKept - static_cast<std::size_t>(-whole);
  compare(asked_, 0, quick_, share, newest, force_N);
  compare(answered_to_, quick_, kLate, share, newest, force_N);
  n_ += 1.0;
  // Before, noise alone looks like an answer that has come. And every second reading is enough.
  if (t - measures_since_ >= enough_ && ++taken_ % 2 == 0) bound();
}

// With the courses of so many lags, of a dead time of one period and more.
void AnswerLag::compare(const Course& course, std::size_t from, std::size_t count, double share,
                        std::size_t newest, double force_N) noexcept {
  double newer_N = course.kept_N[newest % kKept];
  for (std::size_t i = 0; i < count; ++i) {
    const double older_N = course.kept_N[(newest - i - 1) % kKept];
    const double off_N = force_N - older_N - share * (newer_N - older_N);
    sums_N_[from + i] += off_N;
    squares_N2_[from + i] += off_N * off_N;
    newer_N = older_N;
  }
}

// The courses that lie no further off than the nearest and noise, by offsets that are possible.
void AnswerLag::bound() noexcept {
  least_s_ = 0.0;
  most_s_ = std::numeric_limits<double>::infinity();
  std::array<double, kQuick + kLate> distances_N2{};
  std::array<double, kQuick + kLate> offsets_N{};
  const double each = 1.0 / n_;
  double nearest_N2 = kFar_N2;
  for (std::size_t i = 0; i < lags(); ++i) {
    offsets_N[i] = each * sums_N_[i];
    distances_N2[i] = squares_N2_[i] - sums_N_[i] * offsets_N[i];
    nearest_N2 = std::min(nearest_N2, distances_N2[i]);
  }
  const double variance_N2 =
      (nearest_N2 + kKnown * noise_N_ * noise_N_) / (n_ - kUnknowns + kKnown);
  const double offset_most_N = offset_most_N_ + kDeviations * std::sqrt(each * variance_N2);
  nearest_N2 = kFar_N2;
  for (std::size_t i = 0; i < lags(); ++i) {
    if (std::abs(offsets_N[i]) > offset_most_N) distances_N2[i] = kFar_N2;
    nearest_N2 = std::min(nearest_N2, distances_N2[i]);
  }
  const double credible_N2 = nearest_N2 + kDeviations * kDeviations * variance_N2;
  const auto between_s = [&](std::size_t inside, std::size_t outside) {
    const double share =
        (credible_N2 - distances_N2[inside]) / (distances_N2[outside] - distances_N2[inside]);
    return lag_s(inside) + share * (lag_s(outside) - lag_s(inside));
  };
  std::size_t least = 0;
  std::size_t most = lags() - 1;
  while (distances_N2[least] > credible_N2) ++least;
  while (distances_N2[most] > credible_N2) --most;
  // A force that creeps through a whole step is rounded up and down alike.
  if (rests_ && step_N_ > 0.0) crept_ = std::min(1.0, (rests_from_N_ - asked_.now_N) / step_N_);
  const double round_s = kDeviations * rounding_s_ * (1.0 - crept_);
  if (least > 0) least_s_ = std::max(0.0, between_s(least, least - 1) - round_s);
  if (most < lags() - 1) most_s_ = between_s(most, most + 1) + round_s;
}

}  // namespace beltgrip::daemon
