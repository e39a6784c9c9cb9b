// What ends a request, each alone: just inside its limit, just outside, and what it then says.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "daemon/core/experiment/clamp_request.h"

namespace beltgrip::daemon {
namespace {

using estimator::StopReason;

constexpr Duration kSample = 5 * kMillisecond;
constexpr Duration kApart = 100 * kMillisecond;  // so far apart no slip rate is known
constexpr double kFloor_N = 1500.0;
constexpr double kRatio = 2.25;

// A request that hardly falls and has room for any peak: only what a test changes is near a limit.
class Stops : public testing::Test {
 protected:
  void SetUp() override {
    config_.estimator.ramp_rate_max_N_per_s = 1.0;
    plan_.crossing.slip_rate_1_s = 0.025;
    plan_.crossing.ramp_top_N_per_s = 1.0;
    plan_.crossing.dearest = {0.0, 1e-6, 0.0};
    plan_.point.mu_expected = 0.11;
    plan_.point.mu_least = 0.085;
    plan_.point.primary_radius_m = 0.05;
    plan_.point.wedge_cosine = 0.01;  // any force holds the belt
    plan_.point.inertia_kg_m2 = 0.18;
    plan_.point.fall = 0.8;
    plan_.point.fall_at_fault = 0.4;
    plan_.point.peak_slip_share = 0.02;
    plan_.reaction = {.detection_s = 0.03, .stale_s = 0.05, .dead_time_s = 0.06, .lag_s = 0.15};
    now_ = {MonoTime{kSecond}, 100.0, 100.0 * kRatio, -50.0, 4000.0, 0.05};
    floor_N_ = kFloor_N;
  }
  void begin() {
    start_rad_s_ = now_.omega_p_rad_s;
    request_ = ClampRequest(config_);
    request_.begin(now_, plan_, floor_N_, {});
  }
  // The force can go no lower: the belt is as near its peak as it comes.
  void begin_on_floor() {
    now_.clamp_force_N = floor_N_;
    begin();
    step(kApart);
    ASSERT_EQ(stop().reason, StopReason::kNone);
  }
  // The controller follows.
  StopReason step(Duration after) {
    now_.t += after;
    now_.clamp_force_N = request_.force_N();
    request_.step(now_, floor_N_);
    return request_.backup_stop();
  }
  // Overrun makes the secondary fast, drive slow.
  void slip_share(double share) {
    now_.omega_s_rad_s = start_rad_s_ * kRatio * (1.0 + (now_.torque_Nm < 0.0 ? share : -share));
  }
  StopReason step_with(double share, Duration after = kApart) {
    slip_share(share);
    return step(after);
  }
  // Slip that grows evenly, and friction with it up to level_from, until something ends it.
  StopReason grow(double rate_1_s, double level_from, double until = 0.1, double wave = 0.0) {
    double share = 0.0;
    for (int i = 1; share < until && request_.backup_stop() == StopReason::kNone; ++i) {
      const double at_s = 5e-3 * i;
      share = rate_1_s * at_s;
      now_.mu_star = 0.05 + std::min(share, level_from);
      slip_share(share + wave * std::sin(std::numbers::pi * at_s / 0.065));
      step(kSample);
    }
    return request_.backup_stop();
  }
  // On the floor at 65 Nm and 0.7 % of slip for 0.4 s and then some.
  StopReason rest_on_floor(double mu_star, int last_ms) {
    SetUp();
    now_.torque_Nm = -65.0;
    now_.mu_star = mu_star;
    begin_on_floor();
    EXPECT_EQ(step_with(0.007, 2 * kApart), StopReason::kNone);
    EXPECT_EQ(step_with(0.007, 2 * kApart), StopReason::kNone);
    return step_with(0.007, last_ms * kMillisecond);
  }
  // Of that torque, with slip that does not grow.
  double to_come_J(double mu, double slip_share, double beyond_share, double told_s) const {
    RampPoint point = plan_.point;
    point.torque_Nm = 65.0;
    point.omega_p_rad_s = 100.0;
    point.own_force_N = kFloor_N;
    point.mu_least = mu;
    return energy_to_come_J(point, plan_.reaction, {slip_share, beyond_share, 0.0}, told_s);
  }
  Stop stop() const { return {request_.backup_stop(), request_.cause()}; }
  void expect(StopReason reason, const char* what, double figure, double limit, const char* unit,
              std::optional<Role> role = std::nullopt) const {
    EXPECT_EQ(request_.backup_stop(), reason);
    const StopCause& cause = request_.cause();
    EXPECT_STREQ(cause.what, what);
    EXPECT_NEAR(cause.figure, figure, 1e-6);
    EXPECT_NEAR(cause.limit, limit, 1e-6);
    EXPECT_STREQ(cause.unit, unit);
    EXPECT_EQ(cause.role, role);
  }

  Config config_;
  RequestPlan plan_;
  ClampRequest::Now now_;
  double floor_N_ = kFloor_N;
  double start_rad_s_ = 0.0;
  ClampRequest request_{Config{}};
};

TEST_F(Stops, SevenPercentOfSlip) {
  for (const double torque_Nm : {-50.0, 50.0}) {
    SetUp();
    now_.torque_Nm = torque_Nm;
    begin();
    EXPECT_EQ(step_with(0.0699), StopReason::kNone);
    step_with(0.0701);
    expect(StopReason::kSlip, "slip since the start", 7.01, 7.0, "%");
  }
}

TEST_F(Stops, TwoPointsMoreThanWhereFrictionWasLargest) {
  now_.torque_Nm = -3.0;
  begin_on_floor();
  now_.mu_star = 0.06;  // rises until 1 % of slip
  EXPECT_EQ(step_with(0.01), StopReason::kNone);
  EXPECT_EQ(step_with(0.0299), StopReason::kNone);
  step_with(0.0301);
  expect(StopReason::kSlip, "slip since friction rose last", 2.01, 2.0, "%");
}

// Slower than 0.6 % a second a belt creeps; faster, with level friction, it slips.
TEST_F(Stops, CreepIsNoSlipBeyondAPeak) {
  now_.torque_Nm = -3.0;
  begin();
  EXPECT_EQ(grow(0.0055, 0.0, 0.03), StopReason::kNone);
  SetUp();
  now_.torque_Nm = -3.0;
  begin();
  EXPECT_EQ(grow(0.0065, 0.0, 0.03), StopReason::kSlip);
}

TEST_F(Stops, TwelvePercentOfSlipASecondWhateverFrictionDoes) {
  now_.torque_Nm = -3.0;
  begin();
  EXPECT_EQ(grow(0.1195, 1.0), StopReason::kSlip);
  SetUp();
  now_.torque_Nm = -3.0;
  begin();
  grow(0.1205, 1.0);
  expect(StopReason::kSlipRate, "slip grows by", 12.05, 12.0, "%/s");
  // At the first of the samples every 0.06 % that is beyond 0.75 %: before, noise has such rates.
  EXPECT_GT(request_.slip_max_share(), 0.0075);
  EXPECT_LT(request_.slip_max_share(), 0.0082);
}

// Before the noise of the rate is known, the same holds with level friction.
TEST_F(Stops, TwelvePercentASecondWhileTheNoiseIsNotKnown) {
  now_.torque_Nm = -3.0;
  begin();
  EXPECT_EQ(grow(0.11, 0.0), StopReason::kSlip);
  SetUp();
  now_.torque_Nm = -3.0;
  begin();
  grow(0.125, 0.0);
  expect(StopReason::kSlipRate, "slip grows by", 12.5, 12.0, "%/s");
}

// The ramp holds 2.5 % a second. 3 more are allowed where there is no noise.
TEST_F(Stops, AHeldRateAndALittleMoreOnceFrictionIsLevel) {
  now_.torque_Nm = -3.0;
  begin();
  EXPECT_EQ(grow(0.0545, 0.015), StopReason::kSlip);
  SetUp();
  now_.torque_Nm = -3.0;
  begin();
  grow(0.0555, 0.015);
  expect(StopReason::kSlipRate, "slip grows by", 5.55, 5.5, "%/s");
}

// A wave of slip whose half period is one window and one sample: the rate then changes by twice its
// amplitude R from a window to the next, in the root mean square by root 2 times R; of one rate
// that is R. With R = 1 % a second the limit is 2.5 + 4.5 * 1 = 7.
TEST_F(Stops, AHeldRateAndFourAndAHalfDeviationsOfItsNoise) {
  double slope = 0.0, squares = 0.0;  // of a wave of height 1 over 60 ms, as least squares have it
  for (int i = -6; i <= 6; ++i) {
    const double at_s = 5e-3 * i;
    slope += at_s * std::sin(std::numbers::pi * at_s / 0.065);
    squares += at_s * at_s;
  }
  const double wave = 0.01 * squares / slope;
  now_.torque_Nm = -3.0;
  begin();
  EXPECT_EQ(grow(0.055, 0.02, 0.1, wave), StopReason::kSlip);  // 6.5 at the most
  SetUp();
  now_.torque_Nm = -3.0;
  begin();
  EXPECT_EQ(grow(0.065, 0.02, 0.1, wave), StopReason::kSlipRate);  // 7.5
  EXPECT_NEAR(request_.cause().limit, 7.0, 0.2);
}

// 1.7 % of slip, the start's 1 among them, 65 Nm and 100 rad/s are 110.5 W. Still to come are 0.02
// s to decide, 0.06 s of a silence, 0.06 s of dead time, and what it takes to come back.
TEST_F(Stops, SeventyJouleBeyondThePeakWithWhatIsToCome) {
  const double comes_J = to_come_J(0.08, 0.017, 0.007, 0.08);
  EXPECT_NEAR(comes_J, 110.5 * 0.14, 4.0);
  const auto last_ms = static_cast<int>((70.0 - comes_J) / 110.5 * 1e3) - 400;
  EXPECT_EQ(rest_on_floor(0.08, last_ms - 2), StopReason::kNone);
  EXPECT_EQ(rest_on_floor(0.08, last_ms + 2), StopReason::kSlipEnergy);
  expect(StopReason::kSlipEnergy, "slip energy beyond the peak, with what is to come",
         110.5 * 1e-3 * (402.0 + last_ms) + comes_J, 70.0, "J");
}

// The same where no belt has its peak yet: the power over the actuator's 0.21 s and 0.02 s to
// decide.
TEST_F(Stops, SeventyJouleBelowAllPeaksByThePowerAlone) {
  EXPECT_EQ(rest_on_floor(0.05, 2), StopReason::kNone);
  EXPECT_EQ(rest_on_floor(0.05, 5), StopReason::kSlipEnergy);
  expect(StopReason::kSlipEnergy, "slip energy beyond the peak, with what is to come",
         110.5 * (0.405 + 0.23), 70.0, "J");
}

// Friction was largest at 1 % of slip: what lies beyond counts from there. An input may be silent
// for longer than the receiver's time-out.
TEST_F(Stops, WhatIsToComeBeginsWhereFrictionWasLargest) {
  plan_.point.wedge_cosine = 0.05;
  plan_.reaction.stale_s = 0.07;
  now_.torque_Nm = -65.0;
  now_.mu_star = 0.08;
  begin_on_floor();
  now_.mu_star = 0.09;
  EXPECT_EQ(step_with(0.010), StopReason::kNone);
  EXPECT_EQ(step_with(0.016), StopReason::kNone);
  EXPECT_EQ(step_with(0.016), StopReason::kNone);
  step_with(0.016);
  expect(StopReason::kSlipEnergy, "slip energy beyond the peak, with what is to come",
         65.0 * 100.0 * 0.026 * 0.3 + to_come_J(0.09, 0.026, 0.006, 0.10), 70.0, "J");
}

// However little was used: it slips where the force of before the request holds it no more. Below
// 0.8 of the least that a belt may have it is not at its peak, whatever noise says.
TEST_F(Stops, ABeltThatTheOwnForceDoesNotCatch) {
  for (const double mu : {0.067, 0.070}) {
    SetUp();
    plan_.point.wedge_cosine = 1.0;  // 49 Nm at 0.05 m and 0.07: 7 kN hold it
    now_.torque_Nm = -49.0;
    now_.mu_star = mu;
    floor_N_ = 6900.0;
    begin_on_floor();
    EXPECT_EQ(step_with(0.001), StopReason::kNone);
    const StopReason reason = step_with(0.015);
    EXPECT_EQ(reason, mu < 0.068 ? StopReason::kNone : StopReason::kSlipEnergy);
  }
  expect(StopReason::kSlipEnergy, "the force before the request would not catch the belt", 6900.0,
         7000.0, "N");
}

// A quick actuator has less to come: the power itself comes first.
TEST_F(Stops, FourHundredWattBeyondThePeak) {
  for (const double torque_Nm : {-210.0, -211.0}) {  // 1.9 % and 100 rad/s
    SetUp();
    config_.experiment.actuator_dead_time_s = 0.01;
    config_.experiment.actuator_lag_s = 0.02;
    now_.torque_Nm = torque_Nm;
    begin_on_floor();
    const StopReason reason = step_with(0.009, 20 * kMillisecond);
    if (torque_Nm == -210.0) {
      EXPECT_EQ(reason, StopReason::kNone);
    }
  }
  expect(StopReason::kSlipEnergy, "slip power beyond the peak", 400.9, 400.0, "W");
}

TEST_F(Stops, PowerOnTheWayToThePeakIsNone) {
  now_.torque_Nm = -150.0;  // 600 W
  begin();
  for (int i = 0; i < 20; ++i) EXPECT_EQ(step_with(0.03), StopReason::kNone);
}

// Faster than 0.4 m/s for longer than 0.6 s: 300 rad/s and 0.1 m.
TEST_F(Stops, FastSlipBeyondThePeak) {
  struct Case {
    double slip_share;
    Duration every;
    StopReason reason;
  };
  for (const Case& c : {Case{0.0130, 101 * kMillisecond, StopReason::kNone},
                        Case{0.0135, 99 * kMillisecond, StopReason::kNone},
                        Case{0.0135, 101 * kMillisecond, StopReason::kSlipEnergy}}) {
    SetUp();
    plan_.point.primary_radius_m = 0.1;
    now_.omega_p_rad_s = 300.0;
    now_.omega_s_rad_s = 300.0 * kRatio;
    now_.torque_Nm = -3.0;
    begin_on_floor();
    for (int i = 0; i < 6; ++i) step_with(c.slip_share, c.every);
    EXPECT_EQ(request_.backup_stop(), c.reason) << c.slip_share;
  }
  expect(StopReason::kSlipEnergy, "fast slip beyond the peak, for", 0.606, 0.6, "s");
}

// A peak here or a little later: 1 % further, or 30 % of the slip where that is more.
TEST_F(Stops, NoRoomForAPeak) {
  struct Case {
    double room, inside, outside, told_percent;
  };
  for (const Case& c : {Case{0.03, 0.0195, 0.0205, 3.05}, Case{0.065, 0.0495, 0.0505, 6.565}}) {
    SetUp();
    plan_.crossing.dearest.slip_share = 0.10 - c.room;
    begin();
    EXPECT_EQ(step_with(c.inside), StopReason::kNone);
    step_with(c.outside);
    expect(StopReason::kRoom, "a peak could no longer be crossed, slip", c.told_percent,
           100.0 * c.room, "%");
  }
}

// 1.3 times 0.21 s of the actuator and 0.03 s of the bus; and 2 times 0.21 s and 0.03 s, where the
// peak is near and readings leave it open. Before they have been asked, nothing is said.
TEST_F(Stops, AForceThatAnswersLate) {
  config_.estimator.ramp_rate_max_N_per_s = 600.0;
  plan_.crossing.ramp_top_N_per_s = 200.0;
  for (const bool noisy : {false, true}) {
    now_ = {MonoTime{kSecond}, 100.0, 100.0 * kRatio, -50.0, 4000.0, 0.05};
    now_.mu_star = 0.0936;  // near the peak
    begin();
    double given_N = 4000.0;
    for (int i = 0; i < 700 && request_.backup_stop() == StopReason::kNone; ++i) {
      now_.t += kSample;
      given_N += 5e-3 / (noisy ? 0.21 : 0.60) * (request_.force_N() - given_N);
      now_.clamp_force_N = given_N;
      now_.read_N = given_N + (noisy ? (i / 2 % 2 == 0 ? 400.0 : -400.0) : 0.0);
      now_.read_at = now_.t;
      request_.step(now_, kFloor_N);
    }
    if (!noisy) {
      expect(StopReason::kLag, "clamping force answers after", request_.cause().figure, 0.312, "s");
      EXPECT_LT(request_.cause().figure, 0.61);
    } else {
      EXPECT_EQ(request_.backup_stop(), StopReason::kLag);
      EXPECT_STREQ(request_.cause().what, "clamping force is not shown to answer before");
      EXPECT_GT(request_.cause().figure, 0.45);
      EXPECT_NEAR(request_.cause().limit, 0.45, 1e-9);
    }
    EXPECT_EQ(request_.cause().further_figure, 0.21);
  }
}

TEST_F(Stops, AFloorAboveTheForce) {
  now_.clamp_force_N = kFloor_N;
  begin();
  EXPECT_EQ(step(kSample), StopReason::kNone);  // on it is not below
  floor_N_ = 1500.1;
  step(kSample);
  expect(StopReason::kForceFloor, "request at its floor", 1500.0, 1500.1, "N");
}

// A floor that stands for more than a second brings nothing into reach.
TEST_F(Stops, AFloorThatStands) {
  now_.torque_Nm = -3.0;
  begin_on_floor();
  for (int i = 0; i < 10; ++i) EXPECT_EQ(step(kApart), StopReason::kNone) << i;
  step(kSample);
  expect(StopReason::kForceFloor, "request at its floor", request_.force_N(), 1500.0, "N");
}

// Or one that has fallen by less than 10 N for each second that the force has been on it.
TEST_F(Stops, AFloorThatHardlyFalls) {
  struct Case {
    double first_N_per_s, later_N_per_s;
    int ends_after;  // samples; 0: in 3 s not
  };
  for (const Case& c : {Case{9.9, 9.9, 201}, Case{10.1, 10.1, 0}, Case{19.99, 0.0, 400}}) {
    SetUp();
    now_.torque_Nm = -3.0;
    now_.clamp_force_N = floor_N_ + 5.0;
    begin();
    int ended = 0;
    for (int i = 0; i <= 600 && ended == 0; ++i) {
      now_.t += kSample;
      if (i > 0) floor_N_ -= 5e-3 * (i <= 200 ? c.first_N_per_s : c.later_N_per_s);
      request_.follow(now_, floor_N_, floor_N_ + 5.0);
      if (request_.backup_stop() != StopReason::kNone) ended = i;
    }
    EXPECT_EQ(ended, c.ends_after) << c.first_N_per_s;
    EXPECT_EQ(request_.backup_stop(), ended > 0 ? StopReason::kForceFloor : StopReason::kNone);
  }
}

// A belt of more friction than was expected may still come to its peak as the floor falls: for as
// long as it has slipped by 0.6 %/s over the last second.
TEST_F(Stops, ABeltThatHoldsOnTheFloor) {
  struct Case {
    double mu_star, slip_1_s, later_1_s;  // from 1.5 s on
    Duration sample;
    int ends_after_ms;  // 0: in 3 s not
  };
  for (const Case& c :
       {Case{-0.1101, 0.0055, 0.0055, kSample, 1000}, Case{-0.1101, 0.0065, 0.0065, kSample, 0},
        Case{-0.11, 0.0, 0.0, kSample, 0}, Case{-0.1101, 0.012, 0.0, kSample, 2020},
        Case{-0.1101, 0.0058, 0.0058, 7 * kMillisecond, 1050}}) {
    SetUp();
    now_.torque_Nm = -3.0;
    now_.mu_star = c.mu_star;
    now_.clamp_force_N = floor_N_ + 5.0;
    begin();
    const double sample_s = seconds(c.sample);
    int ended_ms = 0;
    double slip = 0.0;
    for (double t = 0.0; t <= 3.0 && ended_ms == 0; t += sample_s) {
      now_.t += c.sample;
      if (t > 0.0) {
        floor_N_ -= 50.0 * sample_s;
        slip += (t <= 1.5 ? c.slip_1_s : c.later_1_s) * sample_s;
      }
      slip_share(slip);
      request_.follow(now_, floor_N_, floor_N_ + 5.0);
      if (request_.backup_stop() != StopReason::kNone) {
        ended_ms = static_cast<int>(std::lround(1e3 * t));
      }
    }
    EXPECT_EQ(ended_ms, c.ends_after_ms) << c.mu_star << " " << c.slip_1_s;
    EXPECT_EQ(request_.backup_stop(),
              c.ends_after_ms > 0 ? StopReason::kForceFloor : StopReason::kNone);
  }
}

// On the floor the car no longer coasts.
TEST_F(Stops, NothingMoreToComeOnTheFloor) {
  begin_on_floor();
  now_.omega_p_rad_s = 0.93 * 105.0;
  now_.omega_s_rad_s = now_.omega_p_rad_s * kRatio;
  EXPECT_EQ(step(kSample), StopReason::kNone);
  now_.omega_p_rad_s = 97.64;
  now_.omega_s_rad_s = 97.64 * kRatio;
  EXPECT_EQ(step(kSample), StopReason::kForceFloor);
}

TEST_F(Stops, FifteenSeconds) {
  begin();
  for (int i = 1; i < 150; ++i) ASSERT_EQ(step(kApart), StopReason::kNone) << i;
  step(kApart);
  expect(StopReason::kTime, "request stood for", 15.0, 15.0, "s");
}

// 8 % off what the secondary gives it, before the mean of 15 ms shows slip.
TEST_F(Stops, APrimaryThatIsDraggedDownOrFlaresUp) {
  struct Case {
    double torque_Nm, inside, outside;
  };
  for (const Case& c : {Case{-50.0, 0.0865, 0.0875}, Case{50.0, 0.0735, 0.0745}}) {
    for (const double share : {c.inside, c.outside}) {
      SetUp();
      now_.torque_Nm = c.torque_Nm;
      begin();
      step(kSample);
      step(kSample);
      const StopReason reason = step_with(share, kSample);
      if (share == c.inside) {
        EXPECT_EQ(reason, StopReason::kNone) << c.torque_Nm;
      }
    }
    const double given = 1.0 - std::copysign(c.outside, c.torque_Nm);
    expect(StopReason::kEngineSpeed, "off the speed that the secondary gives it by",
           100.0 * std::abs(1.0 / given - 1.0), 8.0, "%", Role::kPrimarySpeed);
  }
}

TEST_F(Stops, APrimaryThatIsTooSlowForTheEngine) {
  begin();
  now_.omega_p_rad_s = 0.93 * 105.0;
  now_.omega_s_rad_s = kRatio * now_.omega_p_rad_s;
  EXPECT_EQ(step(kSample), StopReason::kNone);
  now_.omega_p_rad_s = 97.6;
  now_.omega_s_rad_s = kRatio * 97.6;
  step(kSample);
  expect(StopReason::kEngineSpeed, "falls to", 97.6, 97.65, "rad/s", Role::kPrimarySpeed);
}

TEST_F(Stops, ATorqueThatHasChangedByAThirdAndFiveNewtonMetres) {
  now_.torque_Nm = -30.0;
  begin();
  now_.torque_Nm = -45.5;
  EXPECT_EQ(step(kSample), StopReason::kNone);
  now_.torque_Nm = -45.51;
  step(kSample);
  expect(StopReason::kTorque, "torque on the belt has changed by", 15.51, 15.5, "Nm");
}

// While the force falls, a ratio that moves against the torque.
TEST_F(Stops, ARatioThatMovesAgainstTheTorque) {
  begin();
  EXPECT_EQ(step_with(-0.0149), StopReason::kNone);
  step_with(-0.0160);
  expect(StopReason::kRatio, "speed ratio has moved against the torque by", 1.6, 1.5, "%");
}

// Is it one shaft alone? Its speed has then left the engine's, or the wheels', by more than half of
// what the ratio has moved. 0 where such a speed is not known.
TEST_F(Stops, TheShaftThatMovesAloneIsNamed) {
  constexpr auto kPrimary = Role::kPrimarySpeed, kSecondary = Role::kSecondarySpeed;
  struct Case {
    double engine_start, engine, wheels_start, wheels;
    std::optional<Role> role;
  };
  // In overrun the ratio falls by 2 %: the primary seems fast or the secondary slow.
  const Case cases[] = {
      {0.9, 0.9 * 1.009, 0.0, 0.0, kPrimary},  // left by 1.1 %
      {0.9, 0.9 * 1.011, 0.0, 0.0, std::nullopt}, {0.0, 0.9, 0.0, 0.0, std::nullopt},
      {0.9, 0.0, 0.0, 0.0, std::nullopt},         {0.0, 0.0, 0.2, 0.2 * 0.991, kSecondary},
      {0.0, 0.0, 0.2, 0.2 * 0.989, std::nullopt}, {0.0, 0.0, 0.0, 0.2, std::nullopt},
      {0.0, 0.0, 0.2, 0.0, std::nullopt},         {0.9, 0.9 * 1.02, 0.2, 0.2, kSecondary},
  };
  for (const double torque_Nm : {-50.0, 50.0}) {
    for (const Case& c : cases) {
      SetUp();
      now_.torque_Nm = torque_Nm;
      now_.omega_e_rad_s = 100.0 * c.engine_start;
      now_.speed_m_s = 100.0 * c.wheels_start;
      begin();
      // In drive it rises, and all else moves the other way as well.
      const double way = torque_Nm < 0.0 ? 1.0 : -1.0;
      const auto moved = [way](double start, double now) {
        return start > 0.0 && now > 0.0 ? start * (1.0 + way * (now / start - 1.0)) : now;
      };
      now_.omega_e_rad_s = 100.0 * moved(c.engine_start, c.engine);
      now_.speed_m_s = 100.0 * moved(c.wheels_start, c.wheels);
      if (c.role == kSecondary || c.wheels_start > 0.0) {
        now_.omega_s_rad_s *= 1.0 - 0.02 * way;
      } else {
        now_.omega_p_rad_s *= 1.0 + 0.02 * way;
      }
      step(kApart);
      EXPECT_EQ(request_.backup_stop(), c.role ? StopReason::kInputFrozen : StopReason::kRatio);
      EXPECT_EQ(request_.cause().role, c.role)
          << torque_Nm << " " << c.engine << " " << c.wheels << " " << c.wheels_start;
    }
  }
  SetUp();
  now_.omega_e_rad_s = 90.0;
  begin();
  now_.omega_p_rad_s *= 1.02;
  step(kApart);
  expect(StopReason::kInputFrozen, "alone moves the speed ratio against the torque, by",
         100.0 * (1.0 - 1.0 / 1.02), 1.5, "%", kPrimary);
}

// A vehicle speed in steps of 0.05 m/s: at 10 m/s one step, 0.5 %, tells nothing.
TEST_F(Stops, ACoarseVehicleSpeedIsBelievedBeyondItsStep) {
  const auto bound = [](Role role, double scale, double offset, double factor) {
    can::SignalDef definition;
    definition.length = 8;
    definition.scale = scale;
    definition.offset = offset;
    RoleBinding binding;
    binding.role = role;
    binding.codec = can::SignalCodec(definition);
    binding.factor = factor;
    return binding;
  };
  const RoleBinding speed = bound(Role::kVehicleSpeed, 0.18, 7.0, -1.0 / 3.6);  // km/h, backwards
  const RoleBinding other = bound(Role::kPrimarySpeed, 100.0, 0.0, 1.0);  // its step counts nothing
  struct Case {
    double left;  // by the secondary from the wheels; half of the ratio's 2 %, and the step
    std::optional<Role> role;
  };
  for (const Case& c : {Case{0.0145, std::nullopt}, Case{0.0155, Role::kSecondarySpeed}}) {
    SetUp();
    config_.roles = {other, speed, other};
    now_.speed_m_s = 10.0;
    begin();
    now_.omega_s_rad_s *= 0.98;
    now_.speed_m_s = 10.0 * 0.98 / (1.0 - c.left);
    step(kApart);
    EXPECT_EQ(request_.cause().role, c.role) << c.left;
  }
}

}  // namespace
}  // namespace beltgrip::daemon
