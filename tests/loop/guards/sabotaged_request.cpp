// ClampRequest without its search, its limits and its stops: asks for what the sabotage says. All
// members that others call are here, so that the product's object is not linked.
#include <cmath>

#include "daemon/core/experiment/clamp_request.h"
#include "tests/loop/guards/sabotage.h"

namespace beltgrip::test {

Sabotage& sabotage() {
  static Sabotage now;
  return now;
}

}  // namespace beltgrip::test

namespace beltgrip::daemon {

ClampRequest::ClampRequest(const Config& config)
    : settings_(config.experiment),
      rate_max_N_per_s_(config.estimator.ramp_rate_max_N_per_s),
      sample_() {}

void ClampRequest::begin(const Now& now, const RequestPlan&, double,
                         const AnswerLag::Reading&) noexcept {
  standing_ = followed_ = true;
  begun_ = last_ = now.t;
  force_N_ = start_force_N_ = test::sabotage().start_share * now.clamp_force_N;
}

void ClampRequest::step(const Now& now, double) noexcept {
  const test::Sabotage& told = test::sabotage();
  const double step_s = static_cast<double>((now.t - last_).ns()) * 1e-9;
  const double since_s = static_cast<double>((now.t - begun_).ns()) * 1e-9;
  last_ = now.t;
  const bool gap = since_s > told.stands_s && since_s <= told.stands_s + told.gap_s;
  const bool again = since_s > told.stands_s + told.gap_s;
  if (gap) {
    if (force_N_ > 0.0) off_N_ = force_N_;  // what it remembers
    force_N_ = 0.0;
  } else if (again && force_N_ == 0.0) {
    force_N_ = told.remembers ? off_N_ : now.clamp_force_N;
  } else {
    force_N_ -= told.fall_N_per_s * step_s;
  }
}

void ClampRequest::follow(const Now& now, double floor_N, double) noexcept { step(now, floor_N); }

void ClampRequest::hold(MonoTime t) noexcept { last_ = t; }

void ClampRequest::end(MonoTime t) noexcept {
  standing_ = false;
  ended_ = t;
}

double ClampRequest::rate_least_N_per_s() const noexcept { return 0.0; }
double ClampRequest::follow_band_N() const noexcept { return 1e9; }
bool ClampRequest::changed_since(MonoTime) const noexcept { return false; }
bool ClampRequest::released(const Now& now) const noexcept {
  return now.t - ended_ >= kReleaseTime;
}
bool ClampRequest::stuck(const Now&) const noexcept { return false; }
void ClampRequest::follow_release(const Now& now) noexcept { last_ = now.t; }
std::optional<bool> ClampRequest::grips_again() const noexcept { return std::nullopt; }
void ClampRequest::travel(MonoTime, double) noexcept {}
bool ClampRequest::cooled() const noexcept { return true; }

}  // namespace beltgrip::daemon
