#include "daemon/core/experiment/answer_proof.h"

#include <cmath>

namespace beltgrip::daemon {

namespace {
// Of the configured answer. Derived: to 1.3 times it a car is promised as if nothing were wrong, to
// 2 times it is the one fault that keeps the limits; so a request ends where the first is shown to
// be passed, or the second is not shown not to be.
constexpr double kLateShare = 1.3;
constexpr double kCredibleShare = 2.0;
// Chosen: of the band in which a force follows, the fall before the rest where a peak may be near.
constexpr double kNearShare = 0.5;
// Chosen: of the configured answer, the least of the rest after which a force may be called late.
// So early what has just answered and what has just begun to look alike; and waiting costs nothing.
constexpr double kLateAfter = 2.0;
// Chosen: a pressure with 3 kPa of noise every 10 ms tells the lag in some 0.3 s at 600 N/s; what
// has not by then tells it by waiting hardly any more.
constexpr Duration kLongest = kSecond;
}  // namespace

void AnswerProof::begin(MonoTime t, const Setup& setup) noexcept {
  const double answer_s = setup.configured.dead_time_s + setup.configured.lag_s;
  setup_ = setup;
  const double planned_s = answer_s + AnswerLag::kTransport_s;
  late_s_ = kLateShare * planned_s;
  late_after_ = Duration::of_ns(std::llround(kLateAfter * planned_s * 1e9));
  late_ = false;
  credible_s_ = kCredibleShare * answer_s + AnswerLag::kTransport_s;
  rest_ = Rest::kComes;
  begun_ = read_at_ = t;
  in_time_ = false;
  lag_.begin(t, {.force_N = setup.force_N,
                 .configured = setup.configured,
                 .reading = setup.reading,
                 .sample = setup.sample});
}

void AnswerProof::step(const Now& now) noexcept {
  if (now.read_at > read_at_) lag_.read(now.read_at, now.read_N);
  read_at_ = now.read_at;
  in_time_ = in_time_ || lag_.most_s() < credible_s_;
  const bool long_enough = rest_ == Rest::kRests && now.t - rests_since_ >= late_after_;
  late_ = late_ || (lag_.least_s() > late_s_ && (long_enough || rest_ == Rest::kOver));
  if (rest_ == Rest::kComes) {
    // By so much that a controller follows that reckons its force otherwise than the daemon.
    const double enough_N = (now.near ? kNearShare : 1.0) * setup_.follow_band_N;
    const double fallen_N = setup_.force_N - now.asked_N;
    if (fallen_N < enough_N && !now.on_floor) return;
    rest_ = Rest::kRests;
    rests_since_ = now.t;
    lag_.measure(now.t, fallen_N, fallen_N / seconds(now.t - begun_));
  } else if (rest_ == Rest::kRests && (in_time_ || now.t - rests_since_ >= kLongest)) {
    rest_ = Rest::kOver;
    lag_.resume(now.t);
  }
}

double AnswerProof::rest_N_per_s() const noexcept {
  return setup_.reading.step_N / seconds(kLongest);
}

}  // namespace beltgrip::daemon
