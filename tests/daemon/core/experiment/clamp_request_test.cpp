// The request: its ramp, each backup stop alone, whether the controller follows, release,
// cool-down.
#include "daemon/core/experiment/clamp_request.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace beltgrip::daemon {
namespace {

using estimator::StopReason;

constexpr Duration kSample = 5 * kMillisecond;
constexpr double kFloor = 1500.0;
constexpr double kOnFloor = kFloor + 10.0;  // above its noise

// 140 rad/s, 30 Nm: 90 J are 2.1 % of slip for a second.
RequestPlan plan(double rate_top_N_per_s = 200.0) {
  RequestPlan p;
  p.crossing.slip_rate_1_s = 0.025;
  p.crossing.ramp_top_N_per_s = rate_top_N_per_s;
  p.crossing.dearest = {0.01, 0.25, 0.001};
  p.point.mu_expected = 0.11;
  p.point.mu_least = 0.085;
  p.point.primary_radius_m = 0.0784;
  p.point.wedge_cosine = 0.98;
  p.point.inertia_kg_m2 = 0.18;
  p.point.fall = 0.8;
  p.point.fall_at_fault = 0.4;
  p.point.peak_slip_share = 0.02;
  p.reaction = {.detection_s = 0.03, .stale_s = 0.05, .dead_time_s = 0.06, .lag_s = 0.15};
  return p;
}

class Request : public testing::Test {
 protected:
  void SetUp() override {
    request_ = ClampRequest(Config{});
    now_ = {MonoTime{kSecond}, 140.0, 315.0, -30.0, 4000.0, 0.05};
    request_.begin(now_, plan(), kFloor, {});
  }
  // One sample; the controller follows unless told otherwise.
  StopReason sample(double off_N = 0.0) {
    now_.t += kSample;
    now_.clamp_force_N = now_.read_N = request_.force_N() + off_N;
    now_.read_at = now_.t;
    request_.step(now_, kFloor);
    return request_.backup_stop();
  }
  void past_its_rest() {
    double before_N = 0.0;
    for (int rested = 0; rested == 0 || request_.force_N() == before_N;) {
      before_N = request_.force_N();
      ASSERT_EQ(sample(), StopReason::kNone);
      rested += request_.force_N() == before_N ? 1 : 0;
    }
  }
  // Overrun: slip makes the primary slow.
  void slip(double share) { now_.omega_p_rad_s = 140.0 / (1.0 + share); }

  ClampRequest request_{Config{}};
  ClampRequest::Now now_;
};

// Far from the peak at the largest rate, 600 N/s, to the rest after 5 % of the force and 80 N; then
// near it at the top's; and it rests on a floor that does not fall for a second.
TEST_F(Request, FallsFastThenSlowlyToTheFloorAndEndsThere) {
  double before = request_.force_N();
  EXPECT_EQ(before, 4000.0);
  for (int i = 0; i < 94; ++i) {  // 280 N
    ASSERT_EQ(sample(), StopReason::kNone);
    ASSERT_NEAR(before - request_.force_N(), 3.0, 1e-6) << i;
    before = request_.force_N();
  }
  int rested = 0;
  while (sample() == StopReason::kNone && request_.force_N() == before) ++rested;
  EXPECT_NEAR(rested, 73, 2);  // 1.5 times 0.21 s of the actuator and 0.03 s of the bus
  EXPECT_NEAR(before - request_.force_N(), 3.0, 1e-6);
  before = request_.force_N();
  now_.mu_star = 0.0936;  // above 0.85 of 0.11
  int at_floor = 0;
  while (sample() == StopReason::kNone) {
    const double fall = before - request_.force_N();
    ASSERT_TRUE(std::abs(fall - 1.0) < 1e-6 || request_.force_N() == kOnFloor) << fall;
    before = request_.force_N();
    at_floor += before == kOnFloor ? 1 : 0;
  }
  EXPECT_EQ(request_.backup_stop(), StopReason::kForceFloor);
  EXPECT_NEAR(at_floor, 201, 2);
}

// Noise of the slip rate may say before that the peak is near.
TEST_F(Request, FallsFastToItsRestWhateverTheSlipRate) {
  now_.mu_star = 0.09;  // of no peak's, with 0.8 of 0.085, and below 0.85 of 0.11
  for (int i = 0; i < 20; ++i) {
    slip(i % 2 == 0 ? 5e-4 : 0.0);
    const double before = request_.force_N();
    ASSERT_EQ(sample(), StopReason::kNone);
    ASSERT_NEAR(before - request_.force_N(), 3.0, 1e-6) << i;
  }
}

// Slip that grows by 0.8 % a second, a third of what is held, says so truly: slow it is for that
// alone (583 N/s), not for where peaks lie (200 N/s).
TEST_F(Request, NorDoesAPeakThatIsNearSlowTheFallToItsRest) {
  now_.mu_star = 0.09;
  for (int i = 0; i < 60; ++i) {
    slip(4e-5 * i);
    const double before = request_.force_N();
    ASSERT_EQ(sample(), StopReason::kNone);
    ASSERT_GT(before - request_.force_N(), 2.7) << i;
  }
}

// The first request came near its peak; the second is far from it, beyond its rest as well.
TEST_F(Request, TheSecondIsFarFromItsPeak) {
  past_its_rest();
  now_.mu_star = 0.1;
  sample();
  request_.end(now_.t);
  now_.t += 100 * kSecond;
  now_.mu_star = 0.05;
  now_.clamp_force_N = 4000.0;
  request_.begin(now_, plan(), kFloor, {});
  past_its_rest();
  now_.mu_star = 0.08;
  const double before = request_.force_N();
  sample();
  EXPECT_NEAR(before - request_.force_N(), 3.0, 1e-6);
}

// 0.85 of the largest friction expected is near, once for all; below 0.8 of the least none lies.
TEST_F(Request, IsSlowWhereAPeakMayLie) {
  past_its_rest();
  const auto fallen_N = [&](double mu_star) {
    const double before_N = request_.force_N();
    now_.mu_star = mu_star;
    sample();
    return before_N - request_.force_N();
  };
  EXPECT_NEAR(fallen_N(0.0934), 3.0, 1e-6);
  EXPECT_NEAR(fallen_N(0.0936), 1.0, 1e-6);
  EXPECT_NEAR(fallen_N(0.0681), 1.0, 1e-6);
  EXPECT_NEAR(fallen_N(0.0679), 3.0, 1e-6);
}

TEST_F(Request, RidesAFloorThatFalls) {
  double floor = 3900.0;
  for (int i = 0; i < 600; ++i) {
    now_.t += kSample;
    now_.clamp_force_N = request_.force_N();
    floor -= 50.0 * 5e-3;
    request_.step(now_, floor);
    ASSERT_EQ(request_.backup_stop(), StopReason::kNone) << i;
    ASSERT_GE(request_.force_N(), floor);
  }
  EXPECT_NEAR(request_.force_N(), floor + 10.0, 0.3);
}

TEST_F(Request, HoldsWhileTheInputsCannotBeUsed) {
  sample();
  const double force = request_.force_N();
  for (int i = 0; i < 8; ++i) {
    now_.t += kSample;
    request_.hold(now_.t);
  }
  sample();
  EXPECT_NEAR(force - request_.force_N(), 3.0, 1e-6);
}

TEST_F(Request, NeverRisesWithTheFloor) {
  now_.t += kSample;
  request_.step(now_, 4500.0);
  EXPECT_LE(request_.force_N(), 4000.0);
  EXPECT_EQ(request_.backup_stop(), StopReason::kForceFloor);
}

// Slip that grows at this rate, friction with it or level, until the request stops.
struct Slipped {
  StopReason stop;
  double share, since_level_s;
};
class Slipping : public Request {
 protected:
  static RequestPlan roomy_plan() {
    RequestPlan roomy = plan();
    roomy.crossing.dearest = {0.0, 0.1, 0.0};
    roomy.point.primary_radius_m = 0.05;
    return roomy;
  }
  double mu_first_ = 0.05;
  Slipped until_stop(double rate_1_s, double level_from, double noise = 0.0) {
    Slipped out{StopReason::kNone, 0.0, 0.0};
    for (int i = 0; out.stop == StopReason::kNone && out.share < 0.2; ++i) {
      out.share += rate_1_s * 5e-3;
      now_.mu_star = mu_first_ + std::min(out.share, level_from);
      if (out.share > level_from) out.since_level_s += 5e-3;
      slip(out.share + (i % 2 == 0 ? noise : -noise));
      out.stop = sample();
    }
    return out;
  }
};

TEST_F(Slipping, SlipThatFrictionRisesWithIsNoDamage) {
  now_.torque_Nm = -10.0;  // room for late peaks
  const RequestPlan roomy = roomy_plan();
  request_.begin(now_, roomy, kFloor, {});
  const Slipped end = until_stop(0.05, 1.0);
  EXPECT_EQ(end.stop, StopReason::kSlip);
  EXPECT_NEAR(end.share, 0.07, 0.001);
}

// 2 points beyond where friction was largest, which is noticed 70 ms late.
TEST_F(Slipping, SlipPastTheLargestFrictionStops) {
  now_.torque_Nm = -3.0;  // no energy to speak of
  const RequestPlan roomy = roomy_plan();
  request_.begin(now_, roomy, kFloor, {});
  const Slipped end = until_stop(0.02, 0.02);
  EXPECT_EQ(end.stop, StopReason::kSlip);
  EXPECT_NEAR(end.share, 0.04 + 0.02 * 0.1, 0.003);
}

// |T| omega slip, with 1 % of slip at the start: 30 Nm * 140 rad/s * 3 % = 126 W and more. What is
// still to come counts, the actuator told 0.08 s later: as the motion has it (reachability_test).
TEST_F(Slipping, EnergyBeyondTheLargestFrictionStops) {
  const RequestPlan roomy = roomy_plan();
  now_.mu_star = mu_first_ = 0.08;
  request_.begin(now_, roomy, kFloor, {});
  const Slipped end = until_stop(0.02, 0.02);
  EXPECT_EQ(end.stop, StopReason::kSlipEnergy);
  const double since_s = end.since_level_s, beyond = 0.02 * since_s;
  RampPoint point = roomy.point;
  point.torque_Nm = 30.0;
  point.omega_p_rad_s = 140.0;
  point.own_force_N = 4000.0;
  point.mu_least = 0.10;
  const double to_come_J =
      energy_to_come_J(point, roomy.reaction, {0.03 + beyond, beyond, 0.02}, 0.08);
  EXPECT_GT(to_come_J, 15.0);
  // That friction no longer rises is noticed 0.07 to 0.1 s late.
  const double counted_J = 4200.0 * (0.03 + 0.5 * beyond) * (since_s - 0.085);
  EXPECT_NEAR(counted_J + to_come_J, 70.0, 5.0);
}

TEST_F(Slipping, ASlipRateAboveWhatIsHeldStopsOnceFrictionIsLevel) {
  const RequestPlan roomy = roomy_plan();
  now_.torque_Nm = -10.0;
  request_.begin(now_, roomy, kFloor, {});
  const Slipped held = until_stop(0.05, 1.0);  // below 2.5 + 3 %/s
  EXPECT_EQ(held.stop, StopReason::kSlip);
  SetUp();
  now_.torque_Nm = -10.0;
  request_.begin(now_, roomy, kFloor, {});
  const Slipped rises = until_stop(0.06, 1.0);
  EXPECT_EQ(rises.stop, StopReason::kSlip);
  SetUp();
  now_.torque_Nm = -10.0;
  request_.begin(now_, roomy, kFloor, {});
  const Slipped level = until_stop(0.06, 0.02);
  EXPECT_EQ(level.stop, StopReason::kSlipRate);
  EXPECT_LT(level.since_level_s, 0.25);
}

TEST_F(Slipping, ABeltThatRunsAwayStopsWhateverFrictionDoes) {
  const Slipped end = until_stop(0.15, 1.0);
  EXPECT_EQ(end.stop, StopReason::kSlipRate);
  EXPECT_LT(end.share, 0.02);
}

// The own force is 1.3 times that of a peak of 0.085 at 30 Nm, and 1.7 times that of one of 0.11.
// What the belt has carried by then counts: it is caught more easily than one of 0.085 would be,
// and there is room for a later peak.
TEST_F(Slipping, APeakThatHasNoRoomIsNotWaitedForAndAStrongBeltHasRoomForALaterOne) {
  double stopped_at[2] = {};
  for (const bool strong : {false, true}) {
    SetUp();
    now_.clamp_force_N = 2900.0;
    now_.mu_star = 0.065;
    RequestPlan near = plan();
    near.point.torque_Nm = 30.0;
    near.point.omega_p_rad_s = 140.0;
    near.point.own_force_N = 2900.0;
    near.point.fall = 0.4;
    CrossingSearch search(near.point, near.reaction, SlipLimits{});
    while (!search.step()) {
    }
    near.crossing = search.crossing();
    ASSERT_GT(near.crossing.slip_rate_1_s, 0.0);
    request_.begin(now_, near, kFloor, {});
    StopReason stop = StopReason::kNone;
    double share = 0.0;
    for (; stop == StopReason::kNone && share < 0.07; share += 0.02 * 5e-3) {
      now_.mu_star = 0.065 + (strong ? 1.0 : 0.4) * share;
      slip(share);
      stop = sample();
    }
    EXPECT_EQ(stop, StopReason::kRoom) << strong;
    stopped_at[strong ? 1 : 0] = share;
    // The start's slip is not in it.
    if (!strong) {
      EXPECT_NEAR(std::max(share + 0.01, 1.3 * share),
                  peak_slip_max_share(near.crossing, SlipLimits{}, 30.0, 138.0, 0.0784), 0.003);
    }
  }
  EXPECT_GT(stopped_at[1], 1.2 * stopped_at[0]);
}

// The force answers later than configured, 0.06 + 0.15 s, or a reading of it says so little that it
// might: the rest in the fall shows it, an offset of the reading does not.
TEST_F(Request, AnAnswerThatIsLaterThanConfiguredStops) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  for (const double noise_N : {0.0, 20.0, 2000.0}) {
    for (const double lag_s : {0.21, 0.60}) {
      for (const double offset_N : {-100.0, 0.0, 100.0}) {
        now_ = {MonoTime{kSecond}, 140.0, 315.0, -30.0, 4000.0, 0.05};
        request_ = ClampRequest(Config{});
        request_.begin(now_, plan(), kFloor, {noise_N, 1.0});
        double given_N = 4000.0;
        StopReason stop = StopReason::kNone;
        for (int i = 0; i < 500 && stop == StopReason::kNone; ++i) {
          if (i == 400) now_.mu_star = 0.0936;  // near the peak
          now_.t += kSample;
          given_N += 5e-3 / lag_s * (request_.force_N() - given_N);
          now_.clamp_force_N = given_N + offset_N;
          now_.read_N = now_.clamp_force_N + noise_N * normal(random);
          now_.read_at = now_.t;
          request_.step(now_, kFloor);
          stop = request_.backup_stop();
        }
        const bool stops = lag_s > 0.3 || noise_N > 100.0;
        EXPECT_EQ(stop, stops ? StopReason::kLag : StopReason::kNone)
            << lag_s << ' ' << offset_N << ' ' << noise_N << ' ' << request_.cause().what << ' '
            << request_.cause().figure;
      }
    }
  }
}

TEST_F(Request, TimeStops) {
  RequestPlan still = plan(1e-3);
  still.point.mu_expected = 0.05;  // near the peak from the first sample on
  still.point.mu_least = 0.05;
  request_.begin(now_, still, kFloor, {});
  while (now_.t < MonoTime{kSecond + limits::kRequestLongest - kSample}) {
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
    request_.begin(now_, plan(), kFloor, {});
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
    request_.begin(now_, plan(), kFloor, {});
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

// 5 % and 80 N, and what the request fell within the configured answer of 0.21 s.
TEST_F(Request, NoticesAControllerThatDoesNotFollow) {
  for (const double sign : {1.0, -1.0}) {
    SetUp();
    for (int i = 0; i < 20; ++i) {
      sample(sign * (0.05 * 4000.0 + 80.0 + 600.0 * 0.21 + 5.0));
      EXPECT_TRUE(request_.followed()) << i;
    }
    for (int i = 0; i < 20; ++i) sample(sign * (0.05 * 4000.0 + 80.0 + 600.0 * 0.21 + 5.0));
    EXPECT_FALSE(request_.followed());
    sample();
    EXPECT_TRUE(request_.followed());
    for (int i = 0; i < 40; ++i) {
      sample(sign * (0.05 * request_.force_N() + 80.0 + 600.0 * 0.21 - 15.0));
      EXPECT_TRUE(request_.followed()) << i;
    }
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
  MonoTime t{};
  const auto travel = [&](double seconds, double speed_m_s) {
    for (const MonoTime end = t + Duration::of_s(seconds); t < end;) {
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
