// The forces that a request has asked for, whether the controller follows them, and what is known
// of the belt and the force after its end.
#include <gtest/gtest.h>

#include <cmath>

#include "daemon/core/experiment/clamp_request.h"

namespace beltgrip::daemon {
namespace {

using estimator::StopReason;

constexpr Duration kSample = 5 * kMillisecond;
constexpr double kFloor_N = 500.0;

RequestPlan plan() {
  RequestPlan p;
  p.crossing.slip_rate_1_s = 0.025;
  p.crossing.ramp_top_N_per_s = 200.0;
  p.crossing.dearest = {0.0, 1e-6, 0.0};
  p.point.mu_expected = 0.11;
  p.point.mu_least = 0.085;
  p.point.primary_radius_m = 0.05;
  return p;
}

// A request of another's forces, which the controller follows.
class Followed : public testing::Test {
 protected:
  void SetUp() override { begin(4000.0); }
  void begin(double force_N) {
    now_ = {MonoTime{kSecond}, 140.0, 315.0, -30.0, force_N, 0.05};
    told_N_ = force_N;
    request_ = ClampRequest(Config{});
    request_.begin(now_, plan(), kFloor_N, {});
  }
  void sample(double off_N = 0.0) {
    now_.clamp_force_N = told_N_ + off_N;
    request_.follow(now_, kFloor_N, told_N_);
  }
  void fall(Duration duration, double rate_N_per_s) {
    for (const MonoTime end = now_.t + duration; now_.t < end;) {
      now_.t += kSample;
      told_N_ -= 5e-3 * rate_N_per_s;
      sample();
    }
  }

  ClampRequest::Now now_;
  double told_N_ = 0.0;
  ClampRequest request_{Config{}};
};

TEST_F(Followed, AsksForWhatIsTold) {
  EXPECT_EQ(request_.rate_N_per_s(), 600.0);  // the fastest, before the first sample
  EXPECT_EQ(request_.rate_least_N_per_s(), 600.0);
  fall(100 * kMillisecond, 250.0);
  EXPECT_NEAR(request_.force_N(), 3975.0, 1e-9);
  EXPECT_NEAR(request_.rate_N_per_s(), 250.0, 1e-6);
  sample();  // at the same time
  EXPECT_EQ(request_.rate_N_per_s(), 0.0);
  EXPECT_NEAR(request_.force_N(), 3975.0, 1e-9);
}

TEST_F(Followed, AndIsJudgedAsAnOwnRamp) {
  now_.t += 100 * kMillisecond;
  now_.omega_s_rad_s = 315.0 * 1.0701;
  sample();
  EXPECT_EQ(request_.backup_stop(), StopReason::kSlip);
  now_.t += 100 * kMillisecond;
  now_.omega_s_rad_s = 315.0;
  now_.torque_Nm = -100.0;
  sample();
  EXPECT_EQ(request_.backup_stop(), StopReason::kSlip);  // the first stop stays
}

// 5 % of the force, 80 N, and what it fell within the actuator's 0.21 s: from its course over
// 0.28 s, or all that it fell where it stands for less.
TEST_F(Followed, TheBandAroundTheForce) {
  EXPECT_NEAR(request_.follow_band_N(), 200.0 + 80.0, 1e-9);
  fall(100 * kMillisecond, 600.0);
  EXPECT_NEAR(request_.follow_band_N(), 197.0 + 80.0 + 60.0, 1e-6);
  fall(900 * kMillisecond, 600.0);
  EXPECT_NEAR(request_.follow_band_N(), 170.0 + 80.0 + 126.0, 1e-6);
  fall(200 * kMillisecond, 100.0);
  EXPECT_NEAR(request_.follow_band_N(), 169.0 + 80.0 + 0.75 * (20.0 + 48.0), 1e-6);
}

TEST_F(Followed, OffItForATenthOfASecondIsNotFollowed) {
  for (const double sign : {1.0, -1.0}) {
    for (const double off_N : {375.9, 376.1}) {
      begin(4000.0);
      fall(kSecond, 600.0);
      ASSERT_TRUE(request_.followed());
      bool followed = true;
      for (int i = 0; i <= 20; ++i) {
        EXPECT_TRUE(followed) << i;
        now_.t += kSample;
        told_N_ -= 3.0;
        sample(sign * (off_N - 0.15 * (i + 1)));  // 5 % of what it falls
        followed = request_.followed();
      }
      EXPECT_EQ(followed, off_N < 376.0) << sign;
      EXPECT_NEAR(request_.off_N(), off_N - 3.15, 1e-6);
    }
  }
}

// The last 0.3 s, and the sample of now.
TEST_F(Followed, TheSlowestRateOfLate) {
  fall(100 * kMillisecond, 600.0);
  EXPECT_NEAR(request_.rate_least_N_per_s(), 600.0, 1e-6);
  fall(400 * kMillisecond, 600.0);
  fall(100 * kMillisecond, 200.0);
  fall(300 * kMillisecond, 600.0);
  EXPECT_NEAR(request_.rate_least_N_per_s(), 200.0, 1e-6);
  fall(kSample, 600.0);
  EXPECT_NEAR(request_.rate_least_N_per_s(), 600.0, 1e-6);
  fall(kSample, 100.0);
  EXPECT_NEAR(request_.rate_least_N_per_s(), 100.0, 1e-6);
}

// Also where it was slow for a moment, a short while after the start.
TEST_F(Followed, TheSlowestRateSinceTheStart) {
  fall(100 * kMillisecond, 600.0);
  fall(60 * kMillisecond, 200.0);
  fall(60 * kMillisecond, 600.0);
  EXPECT_NEAR(request_.rate_least_N_per_s(), 200.0, 1e-6);
}

// Since when has it changed by more than the band, 376 N? 600 N/s and a force every 20 ms.
TEST_F(Followed, HasChangedByMoreThanTheBand) {
  const MonoTime begun = now_.t;
  fall(kSecond, 600.0);
  EXPECT_TRUE(request_.changed_since(begun + 360 * kMillisecond));    // 384 N
  EXPECT_FALSE(request_.changed_since(begun + 361 * kMillisecond));   // 372 N
  EXPECT_FALSE(request_.changed_since(begun + 1000 * kMillisecond));  // nothing
  EXPECT_TRUE(request_.changed_since(begun));
  EXPECT_TRUE(request_.changed_since(MonoTime{}));
}

// A force 1.26 s ago is still known, one before is not: 252 N of 200 N/s, beyond 105 + 80 + 42.
TEST_F(Followed, HasChangedSlowly) {
  begin(2500.0);
  fall(2 * kSecond, 200.0);
  EXPECT_NEAR(request_.follow_band_N(), 105.0 + 80.0 + 42.0, 1e-6);
  EXPECT_TRUE(request_.changed_since(now_.t - 1260 * kMillisecond));
  EXPECT_FALSE(request_.changed_since(now_.t - 1130 * kMillisecond));  // 224 N
  EXPECT_TRUE(request_.changed_since(MonoTime{kSecond}));
}

// After its end the slip comes to the ratio's, with a mean of 0.2 s: half of it has gone after 28
// samples, 0.975 to that power.
class Released : public Followed {
 protected:
  void end_with(double slip_share) {
    now_.t += 100 * kMillisecond;
    now_.omega_s_rad_s = 315.0 * (1.0 + slip_share);
    sample();
    request_.end(now_.t);
  }
  int samples_until_held(double slip_share) {
    now_.omega_s_rad_s = 315.0 * (1.0 + slip_share);
    for (int i = 0; i < 400; ++i) {
      if (request_.grips_again() != false) return i;
      now_.t += kSample;
      request_.follow_release(now_);
    }
    return -1;
  }
};

TEST_F(Released, TheBeltHoldsAgainWhenHalfOfItsSlipHasGone) {
  end_with(0.02);
  EXPECT_EQ(request_.grips_again(), false);
  EXPECT_EQ(samples_until_held(0.0), 28);
  SetUp();
  end_with(0.02);
  EXPECT_EQ(samples_until_held(0.0101), -1);
  SetUp();
  end_with(0.02);
  EXPECT_NE(samples_until_held(0.0099), -1);
  request_.end(now_.t);  // again: of a request that no longer stands it takes nothing
  EXPECT_EQ(request_.grips_again(), true);
}

TEST_F(Released, SlipThatWasTooSmallSaysNothing) {
  end_with(0.0029);
  EXPECT_EQ(request_.grips_again(), std::nullopt);
  SetUp();
  end_with(0.0031);
  EXPECT_EQ(request_.grips_again(), false);
}

TEST_F(Released, WhatComesAfterTheEndIsNotJudged) {
  request_.end(now_.t);
  now_.t += kSample;
  now_.torque_Nm = -100.0;
  request_.step(now_, kFloor_N);
  EXPECT_EQ(request_.backup_stop(), StopReason::kNone);
  EXPECT_EQ(request_.force_N(), 0.0);
}

// 85 % of 4000 N after 0.3 s, or 1.5 s.
TEST_F(Released, AtTheEdges) {
  fall(kSecond, 600.0);
  request_.end(now_.t);
  struct Case {
    Duration after;
    double force_N;
    bool released;
  };
  const Case cases[] = {
      {299 * kMillisecond, 4000.0, false}, {300 * kMillisecond, 3400.0, true},
      {300 * kMillisecond, 3399.9, false}, {1499 * kMillisecond, 3399.9, false},
      {1500 * kMillisecond, 3399.9, true},
  };
  for (const Case& c : cases) {
    ClampRequest::Now then = now_;
    then.t += c.after;
    then.clamp_force_N = c.force_N;
    EXPECT_EQ(request_.released(then), c.released) << c.after << " " << c.force_N;
  }
}

// Stuck: after 1.5 s not a tenth above the last request, with 0.8 of the friction expected, 0.11.
TEST_F(Released, AForceThatStaysDown) {
  begin(2200.0);
  told_N_ = 2000.0;
  now_.t += kSample;
  sample();
  request_.end(now_.t);
  struct Case {
    Duration after;
    double force_N, mu_star;
    bool stuck;
  };
  const Case cases[] = {
      {1500 * kMillisecond, 1.1 * 2000.0, 0.8 * 0.11, true},
      {1499 * kMillisecond, 2000.0, 0.09, false},
      {1500 * kMillisecond, 2200.1, 0.09, false},
      {1500 * kMillisecond, 2000.0, 0.0879, false},
  };
  for (const Case& c : cases) {
    ClampRequest::Now then = now_;
    then.t += c.after;
    then.clamp_force_N = c.force_N;
    then.mu_star = c.mu_star;
    EXPECT_EQ(request_.stuck(then), c.stuck) << c.after << " " << c.force_N;
  }
}

// 60 s and 1000 m, from the first sample after the end on.
TEST(CoolDown, AtTheEdges) {
  struct Case {
    double speed_m_s;
    int half_seconds;
  };
  for (const Case& c : {Case{30.0, 120}, Case{10.0, 200}}) {
    ClampRequest request{Config{}};
    MonoTime t{1000 * kSecond};  // the machine has been up, the daemon has not
    const auto travel = [&](Duration step, double speed_m_s) {
      t += step;
      request.travel(t, speed_m_s);
    };
    for (int round = 0; round < 2; ++round) {
      travel(500 * kSecond, c.speed_m_s);  // nothing was seen of these
      for (int i = 1; i < c.half_seconds; ++i) travel(kSecond / 2, c.speed_m_s);
      EXPECT_FALSE(request.cooled()) << c.speed_m_s;
      travel(kSecond / 2, c.speed_m_s);
      EXPECT_TRUE(request.cooled()) << c.speed_m_s;
      request.end(t);
    }
  }
}

// The first one came near the belt's peak, slipped beyond it, rested on its floor and was not
// followed. The second, to a low floor or from it, does what a first one does.
TEST(SecondRequest, KnowsNothingOfTheFirst) {
  const ClampRequest::Now start{MonoTime{kSecond}, 140.0, 315.0, -30.0, 4000.0, 0.08};
  constexpr double kHighFloor_N = 3950.0;
  for (const double floor_N : {kFloor_N, kHighFloor_N}) {
    ClampRequest fresh{Config{}}, second{Config{}};
    ClampRequest::Now now = start;
    second.begin(now, plan(), kHighFloor_N, {});
    for (int i = 0; i < 150; ++i) {
      now.t += kSample;
      now.mu_star = i < 50 ? 0.1 : 0.105;
      now.omega_s_rad_s = 315.0 * (1.0 + 1e-4 * i);
      now.clamp_force_N = 4500.0;
      second.step(now, kHighFloor_N);
    }
    EXPECT_FALSE(second.followed());
    second.end(now.t);
    now = start;
    now.t += 100 * kSecond;
    fresh.begin(now, plan(), floor_N, {});
    second.begin(now, plan(), floor_N, {});
    EXPECT_TRUE(second.followed());
    EXPECT_EQ(second.follow_band_N(), 280.0);
    EXPECT_EQ(second.rate_least_N_per_s(), 600.0);
    EXPECT_EQ(second.backup_stop(), StopReason::kNone);
    for (int i = 0; i < 400; ++i) {
      now.t += kSample;
      now.omega_s_rad_s = 315.0 * (1.0 + 1e-4 * i);
      now.clamp_force_N = fresh.force_N();
      fresh.step(now, floor_N);
      second.step(now, floor_N);
      ASSERT_EQ(second.force_N(), fresh.force_N()) << i;
      ASSERT_EQ(second.backup_stop(), fresh.backup_stop()) << i;
      ASSERT_EQ(second.follow_band_N(), fresh.follow_band_N()) << i;
      ASSERT_EQ(second.rate_least_N_per_s(), fresh.rate_least_N_per_s()) << i;
      ASSERT_EQ(second.followed(), fresh.followed()) << i;
    }
    EXPECT_NE(fresh.backup_stop(), StopReason::kNone);
  }
}

}  // namespace
}  // namespace beltgrip::daemon
