// The request: its ramp, each backup stop alone, whether the controller follows, release,
// cool-down.
#include "daemon/core/experiment/clamp_request.h"

#include <gtest/gtest.h>

#include <cmath>

namespace beltgrip::daemon {
namespace {

using estimator::StopReason;

constexpr Duration kSample = 5 * kMillisecond;
constexpr double kFloor = 1500.0;

class Request : public testing::Test {
 protected:
  void SetUp() override {
    request_ = ClampRequest(Config{});
    now_ = {kSecond, 140.0, 315.0, -30.0, 4000.0, 0.05};
    request_.begin(now_, 200.0, kFloor);
  }
  // One sample; the controller follows unless told otherwise.
  StopReason sample(double off_N = 0.0) {
    now_.t += kSample;
    now_.clamp_force_N = request_.force_N() + off_N;
    request_.step(now_, kFloor);
    return request_.backup_stop();
  }
  // Overrun: slip makes the primary slow.
  void slip(double share) { now_.omega_p_rad_s = 140.0 / (1.0 + share); }

  ClampRequest request_{Config{}};
  ClampRequest::Now now_;
};

TEST_F(Request, FallsFromThePresentForceAtItsRateToTheFloor) {
  double before = request_.force_N();
  EXPECT_EQ(before, 4000.0);
  while (sample() == StopReason::kNone) {
    EXPECT_NEAR(before - request_.force_N(), 1.0, 1e-6);
    before = request_.force_N();
    ASSERT_GE(before, kFloor);
  }
  EXPECT_EQ(request_.backup_stop(), StopReason::kForceFloor);
  EXPECT_NEAR(before, kFloor, 1e-6);
}

TEST_F(Request, HoldsWhileTheInputsCannotBeUsed) {
  sample();
  const double force = request_.force_N();
  for (int i = 0; i < 8; ++i) {
    now_.t += kSample;
    request_.hold(now_.t);
  }
  sample();
  EXPECT_NEAR(force - request_.force_N(), 1.0, 1e-6);
}

TEST_F(Request, NeverRisesWithTheFloor) {
  request_ = ClampRequest(Config{});
  request_.begin(now_, 200.0, kFloor);
  now_.t += kSample;
  request_.step(now_, 4500.0);
  EXPECT_LE(request_.force_N(), 4000.0);
  EXPECT_EQ(request_.backup_stop(), StopReason::kForceFloor);
}

TEST_F(Request, SlipStops) {
  // Slowly: below the rate.
  double share = 0.0;
  StopReason stop = StopReason::kNone;
  now_.torque_Nm = -1.0;  // no energy to speak of
  request_.begin(now_, 20.0, kFloor);
  while (stop == StopReason::kNone && share < 0.1) {
    share += 0.04 * 5e-3;
    slip(share);
    stop = sample();
  }
  EXPECT_EQ(stop, StopReason::kSlip);
  EXPECT_NEAR(share, limits::kRequestSlip, 0.0015);
}

TEST_F(Request, SlipRateStopsEarlier) {
  double share = 0.0;
  StopReason stop = StopReason::kNone;
  while (stop == StopReason::kNone && share < 0.1) {
    share += 0.15 * 5e-3;
    slip(share);
    stop = sample();
  }
  EXPECT_EQ(stop, StopReason::kSlipRate);
  EXPECT_LT(share, 0.02);
}

TEST_F(Request, SlipEnergyStops) {
  double share = 0.0;
  StopReason stop = StopReason::kNone;
  while (share < 0.025) {
    share += 0.05 * 5e-3;
    slip(share);
    ASSERT_EQ(sample(), StopReason::kNone);
  }
  int samples = 0;
  while (stop == StopReason::kNone && samples < 1000) {
    stop = sample();
    ++samples;
  }
  EXPECT_EQ(stop, StopReason::kSlipEnergy);
  // 1 % are taken to be slip of the start. 30 Nm * 137 rad/s * 3.5 % = 144 W; on the way from 2 %
  // came 13 J.
  EXPECT_NEAR(samples * 5e-3, (35.0 - 13.0) / 144.0, 0.02);
}

TEST_F(Request, TimeStops) {
  request_.begin(now_, 1.0, kFloor);
  while (now_.t < kSecond + limits::kRequestLongest - kSample) {
    ASSERT_EQ(sample(), StopReason::kNone);
  }
  EXPECT_EQ(sample(), StopReason::kTime);
}

TEST_F(Request, EngineSpeedStopsWhenItFallsBelowItsLeast) {
  const double least = 0.93 * 105.0;
  now_.omega_p_rad_s = least + 0.1;
  now_.omega_s_rad_s = now_.omega_p_rad_s * 2.25;
  EXPECT_EQ(sample(), StopReason::kNone);
  now_.omega_p_rad_s = least - 0.1;
  now_.omega_s_rad_s = now_.omega_p_rad_s * 2.25;
  EXPECT_EQ(sample(), StopReason::kEngineSpeed);
}

TEST_F(Request, EngineSpeedStopsOnAJumpEitherWay) {
  for (const double factor : {1.07, 0.93}) {
    SetUp();
    now_.torque_Nm = 30.0;
    request_.begin(now_, 200.0, kFloor);
    now_.omega_p_rad_s *= factor;
    sample();
    EXPECT_NE(request_.backup_stop(), StopReason::kNone);
  }
}

TEST_F(Request, TorqueStepStopsEitherWay) {
  const double band = 0.35 * 30.0 + 5.0;
  for (const double sign : {1.0, -1.0}) {
    SetUp();
    now_.torque_Nm = -30.0 + sign * (band - 0.01);
    EXPECT_EQ(sample(), StopReason::kNone);
    now_.torque_Nm = -30.0 + sign * (band + 0.01);
    EXPECT_EQ(sample(), StopReason::kTorque);
  }
}

TEST_F(Request, RatioDriftAgainstTheTorqueStops) {
  slip(-0.014);
  EXPECT_EQ(sample(), StopReason::kNone);
  SetUp();
  slip(-0.017);
  EXPECT_EQ(sample(), StopReason::kRatio);
}

// Slip falls while the force does. Overrun: the primary seems fast, or the secondary slow.
class Course : public Request {
 protected:
  void SetUp() override {
    Request::SetUp();
    now_.omega_e_rad_s = 140.5;
    now_.speed_m_s = 17.5;
    request_.begin(now_, 200.0, kFloor);
  }
  std::optional<Role> role() const { return request_.cause().role; }
};

TEST_F(Course, AShaftThatAloneMovesAgainstTheTorqueIsNotTrue) {
  now_.omega_p_rad_s *= 1.014;
  EXPECT_EQ(sample(), StopReason::kNone);
  now_.omega_p_rad_s = 140.0 * 1.017;
  EXPECT_EQ(sample(), StopReason::kInputFrozen);
  EXPECT_EQ(role(), Role::kPrimarySpeed);
  SetUp();
  now_.omega_s_rad_s /= 1.017;
  EXPECT_EQ(sample(), StopReason::kInputFrozen);
  EXPECT_EQ(role(), Role::kSecondarySpeed);
}

// The primary stays while the car slows down.
TEST_F(Course, AlsoWhereTheTrueOneMoves) {
  for (double* each : {&now_.omega_s_rad_s, &now_.speed_m_s, &now_.omega_e_rad_s}) *each /= 1.017;
  EXPECT_EQ(sample(), StopReason::kInputFrozen);
  EXPECT_EQ(role(), Role::kPrimarySpeed);
}

TEST_F(Course, AShiftOfTheTransmissionIsNone) {
  now_.omega_p_rad_s *= 1.02;
  now_.omega_e_rad_s *= 1.02;
  EXPECT_EQ(sample(), StopReason::kRatio);
  EXPECT_EQ(role(), std::nullopt);
}

// Tip-in: the belt slips the other way and the engine runs ahead through its clutch.
TEST_F(Course, ATorqueThatChangesIsNone) {
  now_.torque_Nm = -20.0;  // late
  now_.omega_p_rad_s *= 1.017;
  now_.omega_e_rad_s *= 1.04;
  EXPECT_EQ(sample(), StopReason::kRatio);
}

TEST_F(Course, WithoutAnotherNodesSpeedNobodyIsNamed) {
  now_.omega_e_rad_s = now_.speed_m_s = 0.0;
  now_.omega_p_rad_s *= 1.017;
  EXPECT_EQ(sample(), StopReason::kRatio);
}

TEST_F(Request, TheFirstStopStays) {
  now_.torque_Nm = -60.0;
  EXPECT_EQ(sample(), StopReason::kTorque);
  now_.torque_Nm = -30.0;
  EXPECT_EQ(sample(), StopReason::kTorque);
}

TEST_F(Request, NoticesAControllerThatDoesNotFollow) {
  for (const double sign : {1.0, -1.0}) {
    SetUp();
    const double band = 0.05 * 4000.0 + 80.0;
    for (int i = 0; i < 20; ++i) {
      sample(sign * (band + 5.0));
      EXPECT_TRUE(request_.followed()) << i;
    }
    sample(sign * (band + 5.0));
    EXPECT_FALSE(request_.followed());
    sample();
    EXPECT_TRUE(request_.followed());
  }
}

TEST_F(Request, ReleasedWhenTheForceIsBackOrTimeIsUp) {
  while (request_.force_N() > 2000.0) sample();
  request_.end(now_.t);
  const MonoTime ended = now_.t;
  EXPECT_EQ(request_.force_N(), 0.0);
  now_.clamp_force_N = 4000.0;
  now_.t = ended + 299 * kMillisecond;
  EXPECT_FALSE(request_.released(now_));
  now_.t = ended + 300 * kMillisecond;
  EXPECT_TRUE(request_.released(now_));
  now_.clamp_force_N = 3399.0;  // 85 % of 4000
  EXPECT_FALSE(request_.released(now_));
  now_.t = ended + ClampRequest::kReleaseTime;
  EXPECT_TRUE(request_.released(now_));
}

TEST_F(Request, StuckWhenTheForceStaysDownUnderLoad) {
  while (request_.force_N() > 2000.0) sample();
  request_.end(now_.t);
  now_.t += ClampRequest::kReleaseTime;
  now_.clamp_force_N = 2000.0;
  now_.mu_star = 0.09;
  EXPECT_TRUE(request_.stuck(now_));
  now_.mu_star = 0.05;  // the torque has gone: so may the force
  EXPECT_FALSE(request_.stuck(now_));
  now_.mu_star = 0.09;
  now_.clamp_force_N = 2300.0;
  EXPECT_FALSE(request_.stuck(now_));
}

TEST_F(Request, CoolsDownInTimeAndDistanceAlsoAfterTheStart) {
  ClampRequest fresh{Config{}};
  EXPECT_FALSE(fresh.cooled());
  MonoTime t = 0;
  const auto travel = [&](double seconds, double speed_m_s) {
    for (const MonoTime end = t + static_cast<MonoTime>(seconds * 1e9); t < end;) {
      t += kSecond;
      fresh.travel(t, speed_m_s);
    }
  };
  travel(70.0, 5.0);
  EXPECT_FALSE(fresh.cooled());  // 350 m of 1000
  travel(140.0, 5.0);
  EXPECT_TRUE(fresh.cooled());
  fresh.end(t);
  EXPECT_FALSE(fresh.cooled());
  travel(55.0, 30.0);
  EXPECT_FALSE(fresh.cooled());  // 55 s of 60
  travel(10.0, 0.0);
  EXPECT_TRUE(fresh.cooled());
}

}  // namespace
}  // namespace beltgrip::daemon
