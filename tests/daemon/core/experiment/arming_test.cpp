// Arming: every precondition alone, at its boundary; settling; what is out of reach.
#include "daemon/core/experiment/arming.h"

#include <gtest/gtest.h>

#include <set>

#include <cmath>
#include <functional>
#include <random>

namespace beltgrip::daemon {
namespace {

constexpr Duration kSample = 5 * kMillisecond;
constexpr Duration kSearch = 40 * kSample;  // a ramp, at the most

Config config(Trigger trigger = Trigger::kCoastDown) {
  Config c;
  c.trigger = trigger;
  c.control = Control::kCommand;
  c.estimator.ratio = estimator::RatioChoice::kEither;
  c.variator.primary_inertia_kg_m2 = 0.18;
  c.variator.secondary_centrifugal_N_s2 = 9.5e-3;
  c.experiment.secondary_pressure_floor_Pa = 2e4;
  c.experiment.actuator_dead_time_s = 0.035;
  c.experiment.actuator_lag_s = 0.1;
  return c;
}

// Overdrive at 58 km/h with 32 Nm of overrun.
Arming::Now coasting() {
  Arming::Now now;
  now.usable = true;
  now.omega_p_rad_s = 130.0;
  now.omega_s_rad_s = 130.0 * 2.25 * 0.995;
  now.torque_Nm = -32.0;
  now.clamp_force_N = 4000.0;
  now.stale = 50 * kMillisecond;
  now.conditions.oil_degC = 80.0;
  return now;
}

class ArmingTest : public testing::Test {
 protected:
  void run(Duration duration, const std::function<void(Arming::Now&)>& change = {}) {
    for (const MonoTime end = now_.t + duration; now_.t < end;) {
      now_.t += kSample;
      Arming::Now given = now_;
      if (change) change(given);
      arming_.step(given);
    }
  }
  Arming::Now now_ = coasting();
  Arming arming_{config()};
};

TEST_F(ArmingTest, SettlesAfterOneAndAHalfSecondsAndFindsARamp) {
  run(Arming::kSettle);
  EXPECT_TRUE(arming_.triggered());
  EXPECT_FALSE(arming_.settled());
  run(kSearch);
  EXPECT_TRUE(arming_.settled());
  EXPECT_TRUE(arming_.cleared());
  EXPECT_GE(arming_.plan().crossing.slip_rate_1_s, 0.02);
  EXPECT_LE(arming_.plan().crossing.slip_rate_1_s, 0.03);
  EXPECT_GT(arming_.plan().crossing.peak_slip_max_share, 0.02);
}

struct Case {
  Inhibit inhibit;
  void (*inside)(Arming::Now&);
  void (*outside)(Arming::Now&);
};

TEST_F(ArmingTest, EveryPreconditionAloneAtItsBoundary) {
  const Case cases[] = {
      {Inhibit::kInputs, [](Arming::Now&) {}, [](Arming::Now& n) { n.usable = false; }},
      {Inhibit::kInputs, [](Arming::Now&) {}, [](Arming::Now& n) { n.conditions.fresh = false; }},
      {Inhibit::kFault, [](Arming::Now&) {}, [](Arming::Now& n) { n.faulted = true; }},
      {Inhibit::kPermission, [](Arming::Now&) {},
       [](Arming::Now& n) { n.conditions.permitted = false; }},
      {Inhibit::kPedal, [](Arming::Now& n) { n.conditions.accelerator = 0.02; },
       [](Arming::Now& n) { n.conditions.accelerator = 0.0201; }},
      {Inhibit::kBrake, [](Arming::Now&) {},
       [](Arming::Now& n) { n.conditions.brake_pressed = true; }},
      {Inhibit::kLockup, [](Arming::Now&) {},
       [](Arming::Now& n) { n.conditions.lockup_closed = false; }},
      // 3 %, and 1.6 % by which 4 kN may bend the pulleys.
      {Inhibit::kRatio, [](Arming::Now& n) { n.omega_s_rad_s = 130.0 * 2.25 * 0.955; },
       [](Arming::Now& n) { n.omega_s_rad_s = 130.0 * 2.25 * 0.953; }},
      {Inhibit::kTorque, [](Arming::Now& n) { n.torque_Nm = -10.0; },
       [](Arming::Now& n) { n.torque_Nm = -9.99; }},
      {Inhibit::kTorque, [](Arming::Now& n) { n.torque_Nm = -100.0; },
       [](Arming::Now& n) { n.torque_Nm = -100.01; }},
      {Inhibit::kTorque, [](Arming::Now&) {}, [](Arming::Now& n) { n.torque_Nm = 32.0; }},
      {Inhibit::kSpeed,
       [](Arming::Now& n) {
         n.omega_p_rad_s = 105.0;
         n.omega_s_rad_s = 105.0 * 2.25;
       },
       [](Arming::Now& n) {
         n.omega_p_rad_s = 104.99;
         n.omega_s_rad_s = 104.99 * 2.25;
       }},
      {Inhibit::kOil, [](Arming::Now& n) { n.conditions.oil_degC = 40.0; },
       [](Arming::Now& n) { n.conditions.oil_degC = 39.9; }},
      {Inhibit::kCooldown, [](Arming::Now&) {}, [](Arming::Now& n) { n.cooled = false; }}};
  for (const Case& c : cases) {
    Arming arming(config());
    Arming::Now now = coasting();
    c.inside(now);
    now.t = MonoTime{kSample};
    arming.step(now);
    EXPECT_TRUE(arming.triggered()) << static_cast<int>(c.inhibit);
    c.outside(now);
    now.t += kSample;
    arming.step(now);
    EXPECT_EQ(arming.inhibits(), inhibit_bit(c.inhibit)) << static_cast<int>(c.inhibit);
    EXPECT_FALSE(arming.triggered());
    EXPECT_FALSE(arming.cleared());
  }
}

// Nothing is asked of the belt: it may carry more, and turn at half the speed.
TEST(ArmingObserve, BeginsAtAnyTorqueAndAtHalfTheSpeed) {
  Config observed = config();
  observed.control = Control::kObserve;
  Arming arming(observed);
  Arming::Now now = coasting();
  const auto inhibits_at = [&](double omega_p_rad_s, double torque_Nm) {
    now.t += kSample;
    now.omega_p_rad_s = omega_p_rad_s;
    now.omega_s_rad_s = omega_p_rad_s * 2.25;
    now.torque_Nm = torque_Nm;
    arming.step(now);
    return arming.inhibits();
  };
  EXPECT_EQ(inhibits_at(52.5, -32.0), 0U);
  EXPECT_EQ(inhibits_at(52.49, -32.0), inhibit_bit(Inhibit::kSpeed));
  EXPECT_EQ(inhibits_at(130.0, -400.0), 0U);
  EXPECT_EQ(inhibits_at(130.0, -9.99), inhibit_bit(Inhibit::kTorque));
}

TEST_F(ArmingTest, WhatEndsAnExperimentUnderWay) {
  const Conditions sound = coasting().conditions;
  EXPECT_FALSE(arming_.ended_by(sound));
  const auto reason = [&](auto change) {
    Conditions now = sound;
    change(now);
    return arming_.ended_by(now).reason;
  };
  using estimator::StopReason;
  EXPECT_EQ(reason([](Conditions& c) { c.permitted = false; }), StopReason::kPermission);
  EXPECT_EQ(reason([](Conditions& c) { c.brake_pressed = true; }), StopReason::kDriver);
  EXPECT_EQ(reason([](Conditions& c) { c.accelerator = 0.05; }), StopReason::kNone);
  EXPECT_EQ(reason([](Conditions& c) { c.accelerator = 0.051; }), StopReason::kDriver);
  EXPECT_EQ(reason([](Conditions& c) { c.lockup_closed = false; }), StopReason::kTorque);
  // One kelvin below what it may begin with.
  EXPECT_EQ(reason([](Conditions& c) { c.oil_degC = 39.0; }), StopReason::kNone);
  EXPECT_EQ(reason([](Conditions& c) { c.oil_degC = 38.9; }), StopReason::kPermission);
  // Whoever drives has the pedal down.
  Conditions driving = sound;
  driving.accelerator = 0.5;
  EXPECT_FALSE(Arming(config(Trigger::kSteady)).ended_by(driving));
}

TEST_F(ArmingTest, AnInterruptionStartsTheSettlingAnew) {
  run(Arming::kSettle - kSample);
  run(kSample, [](Arming::Now& n) { n.conditions.brake_pressed = true; });
  run(Arming::kSettle);
  EXPECT_FALSE(arming_.settled());
  run(kSearch);
  EXPECT_TRUE(arming_.settled());
}

TEST_F(ArmingTest, ADriftOfRatioOrTorqueStartsItAnew) {
  run(kSecond);
  run(kSample, [](Arming::Now& n) { n.omega_s_rad_s *= 1.0101; });
  run(kSecond);
  EXPECT_FALSE(arming_.settled());
  run(kSecond);
  EXPECT_TRUE(arming_.settled());
  Arming steady(config());
  Arming::Now now = coasting();
  for (int i = 0; i < 320; ++i) {
    now.t += kSample;
    now.torque_Nm = i < 200 ? -32.0 : -45.0;  // 25 % and 4 Nm: 44 Nm
    steady.step(now);
  }
  EXPECT_FALSE(steady.settled());
}

TEST_F(ArmingTest, OutOfReachSaysSoAndRunsOutOfPatience) {
  Config c = config();
  c.experiment.secondary_pressure_floor_Pa = 1e5;
  Arming arming(c);
  now_.torque_Nm = -20.0;
  MonoTime refused{};
  while (refused == MonoTime{} && now_.t < MonoTime{60 * kSecond}) {
    now_.t += kSample;
    arming.step(now_);
    if (arming.settled()) refused = now_.t;
  }
  EXPECT_EQ(arming.inhibits(), inhibit_bit(Inhibit::kUnreachable));
  EXPECT_TRUE(arming.triggered());
  EXPECT_FALSE(arming.cleared());
  EXPECT_NEAR(static_cast<double>(refused.ns()),
              static_cast<double>((Arming::kSettle + Arming::kPatience).ns()), 1e7);
}

// After a tip-in the controller takes its force back at its own pace: what falls by itself is not
// followed by a request that falls from there.
TEST_F(ArmingTest, NoRequestWhileTheOwnForceStillMoves) {
  const double force_N = now_.clamp_force_N;
  for (const double rate_N_per_s : {-700.0, -250.0, 700.0}) {
    Arming arming(config());
    now_.clamp_force_N = force_N - rate_N_per_s * 2.5;
    for (int i = 0; i < 500; ++i) {
      now_.t += kSample;
      now_.clamp_force_N += rate_N_per_s * 0.005;
      arming.step(now_);
      ASSERT_FALSE(arming.cleared()) << rate_N_per_s << " " << i;
    }
    EXPECT_TRUE((arming.inhibits() & inhibit_bit(Inhibit::kForce)) != 0);
    for (int i = 0; i < 200 && !arming.cleared(); ++i) {
      now_.t += kSample;
      arming.step(now_);
    }
    EXPECT_TRUE(arming.cleared()) << rate_N_per_s;
  }
}

// However short before the decision the fall has begun, and under the noise of its pressure.
TEST_F(ArmingTest, AFallOfTheOwnForceThatHasJustBegunIsSeen) {
  const double force_N = now_.clamp_force_N;
  for (const double begun_s : {0.12, 0.15, 0.2, 0.3}) {
    for (const double noise_N : {0.0, 20.0}) {
      Arming arming(config());
      std::mt19937_64 random(7);
      std::normal_distribution<double> normal;
      for (int i = 0; i < 400; ++i) {
        now_.t += kSample;
        const double falling_s = std::max(0.0, 0.005 * i - (1.5 - begun_s));
        now_.clamp_force_N = force_N - 700.0 * falling_s + noise_N * normal(random);
        arming.step(now_);
        ASSERT_FALSE(arming.cleared()) << begun_s << " s, " << noise_N << " N, " << i;
      }
    }
  }
}

// Noise of every kind: within a sample, and a pressure that is told in steps.
TEST_F(ArmingTest, ARestingForceIsTakenForOneInNearlyEveryLook) {
  const double force_N = now_.clamp_force_N;
  for (const double step_N : {0.0, 113.0}) {
    Config c = config();
    c.estimator.pressure_step_Pa = step_N / c.variator.secondary_piston_area_m2;
    int seen = 0, cleared = 0;
    Arming arming(c);
    std::mt19937_64 random(7);
    std::normal_distribution<double> normal;
    for (int i = 0; i < 1600; ++i) {
      now_.t += kSample;
      const double slow_N = force_N - 50.0 * 0.005 * i + 20.0 * normal(random);
      now_.clamp_force_N = step_N > 0.0 ? step_N * std::round(slow_N / step_N) : slow_N;
      arming.step(now_);
      if (i < 400) continue;
      ++seen;
      cleared += arming.cleared();
    }
    EXPECT_GT(cleared, 9 * seen / 10) << step_N;
    now_.clamp_force_N = force_N;
  }
}

TEST_F(ArmingTest, AnOwnForceThatFallsWithTheSpeedOrIsNoisyIsAtRest) {
  for (const double rate_N_per_s : {-50.0, 0.0}) {
    Arming arming(config());
    const double force_N = now_.clamp_force_N;
    for (int i = 0; i < 500; ++i) {
      now_.t += kSample;
      now_.clamp_force_N = force_N + rate_N_per_s * 0.005 * i + (i % 2 == 0 ? 60.0 : -60.0);
      arming.step(now_);
    }
    now_.clamp_force_N = force_N;
    EXPECT_TRUE(arming.cleared()) << rate_N_per_s;
  }
}

TEST_F(ArmingTest, AKnownBeltNeedsLessReach) {
  Config c = config();
  c.experiment.secondary_pressure_floor_Pa = 42e3;  // floor 1791 N: 0.112 at 32 Nm
  c.experiment.friction_expected = 0.13;
  Arming arming(c);
  for (int i = 0; i < 400; ++i) {
    now_.t += kSample;
    arming.step(now_);
  }
  EXPECT_EQ(arming.inhibits(), inhibit_bit(Inhibit::kUnreachable));
  now_.mu_max_known = 0.100;
  for (int i = 0; i < 400; ++i) {
    now_.t += kSample;
    arming.step(now_);
  }
  EXPECT_EQ(arming.inhibits(), 0U);
}

TEST_F(ArmingTest, NoRequestWhereTheOwnForceHardlyHoldsTheBelt) {
  now_.shown = {0.6, 1.6};
  now_.slip_percent = 0.99;  // 40 % of the way to the peak: 1.0 %
  run(2 * kSecond);
  EXPECT_EQ(arming_.inhibits(), 0U);
  EXPECT_TRUE(arming_.cleared());
  EXPECT_NEAR(arming_.slip_percent(), 0.99, 1e-9);
  now_.slip_percent = 1.02;
  run(3 * kSecond);
  EXPECT_EQ(arming_.inhibits(), inhibit_bit(Inhibit::kGrip));
  EXPECT_TRUE(arming_.triggered());
  EXPECT_FALSE(arming_.cleared());
  now_.slip_percent = 0.7;  // it was something else
  run(3 * kSecond);
  EXPECT_TRUE(arming_.cleared());
}

TEST_F(ArmingTest, SlipOfTheOwnForceIsJudgedAgainstAPeakOnly) {
  now_.slip_percent = 3.0;
  run(2 * kSecond);
  EXPECT_TRUE(arming_.cleared());
  now_.shown = {2.9, 3.0};  // a narrow one: noise is no loss of grip
  run(2 * kSecond);
  EXPECT_TRUE(arming_.cleared());
  now_.slip_percent = 3.06;
  run(4 * kSecond);
  EXPECT_EQ(arming_.inhibits(), inhibit_bit(Inhibit::kGrip));
}

TEST_F(ArmingTest, NoRampWhereTheSlipWouldRunAway) {
  now_.torque_Nm = -90.0;
  now_.clamp_force_N = 9000.0;
  run(2 * kSecond);
  EXPECT_EQ(arming_.inhibits(), inhibit_bit(Inhibit::kRamp));
}

TEST_F(ArmingTest, NoRequestThatWouldOutlastTheCoastDown) {
  // Slows by 8 rad/s^2: 25 rad/s last 3 s, the ramp needs more.
  for (int i = 0; i < 345; ++i) {
    now_.t += kSample;
    now_.omega_p_rad_s -= 8.0 * 5e-3;
    now_.omega_s_rad_s = now_.omega_p_rad_s * 2.25 * 0.995;
    arming_.step(now_);
  }
  EXPECT_EQ(arming_.inhibits(), inhibit_bit(Inhibit::kTime));
}

// From 170 rad/s, 77 km/h, down by 5 rad/s^2: the floor, the slip speed and the energy leave more
// room further on, and it begins there; while there is still time for the ramp.
TEST_F(ArmingTest, WaitsWhileTheCrossingGainsRoom) {
  now_.omega_p_rad_s = 170.0;
  now_.torque_Nm = -25.0;
  bool waited = false;
  while (!arming_.cleared() && now_.omega_p_rad_s > 105.0) {
    now_.t += kSample;
    now_.omega_p_rad_s -= 5.0 * 5e-3;
    now_.omega_s_rad_s = now_.omega_p_rad_s * 2.25 * 0.995;
    arming_.step(now_);
    waited = waited || (arming_.inhibits() & inhibit_bit(Inhibit::kWait)) != 0;
  }
  EXPECT_TRUE(waited);
  EXPECT_TRUE(arming_.cleared());
  EXPECT_LT(now_.omega_p_rad_s, 160.0);
  EXPECT_GT(now_.omega_p_rad_s, 125.0);
}

// A belt that fell gently may be crossed where one that falls by 12e-3 may not.
TEST_F(ArmingTest, TheFirstRequestSurvivesTheSteepestFallAndLaterOnesTheOneThatWasSeen) {
  Config c = config();
  c.experiment.fall_max_per_percent = 20e-3;
  Arming arming(c);
  std::set<double> figures;  // nothing on the way to the one that is found is said
  for (int i = 0; i < 400; ++i) {
    now_.t += kSample;
    arming.step(now_);
    const bool fall = arming.obstacle().wall == CrossingWall::kFall;
    if (fall && !std::isnan(arming.obstacle().figure)) figures.insert(arming.obstacle().figure);
  }
  EXPECT_EQ(figures.size(), 1U);
  EXPECT_EQ(arming.inhibits(), inhibit_bit(Inhibit::kRamp));
  EXPECT_EQ(arming.obstacle().wall, CrossingWall::kFall);
  EXPECT_NEAR(arming.obstacle().limit, 2.0, 1e-12);  // per unit of slip
  EXPECT_GT(arming.obstacle().figure, 0.1);
  EXPECT_LT(arming.obstacle().figure, 2.0);
  // The own force, in that of the peak: 32 Nm at a friction of 0.085 and 78.4 mm.
  EXPECT_NEAR(arming.obstacle().needed, 4000.0 / (32.0 * 0.98163 / (2.0 * 0.0784 * 0.085)), 1e-4);
  now_.shown = {0.6, 2.0, {0.0, 0.4}};  // 4e-3 per percent at most
  for (int i = 0; i < 400; ++i) {
    now_.t += kSample;
    arming.step(now_);
  }
  EXPECT_TRUE(arming.cleared());
}

// What leaves a gentle fall open is no reason against a request that was right before it.
TEST_F(ArmingTest, AFallThatMayBeGentleForbidsNothing) {
  const auto asks = [&](FallRange shown) {
    Arming arming(config());
    now_.shown = {0.6, 2.0, shown};
    for (int i = 0; i < 400; ++i) {
      now_.t += kSample;
      arming.step(now_);
    }
    return arming.cleared();
  };
  EXPECT_TRUE(asks({}));
  EXPECT_TRUE(asks({0.1, 3.0}));
  EXPECT_FALSE(asks({2.5, 3.0}));  // 25e-3 per percent
}

TEST_F(ArmingTest, SteadyTakesDriveTorqueWithThePedalDown) {
  Arming arming(config(Trigger::kSteady));
  now_.torque_Nm = 32.0;
  now_.conditions.accelerator = 0.3;
  for (int i = 0; i < 400; ++i) {
    now_.t += kSample;
    arming.step(now_);
  }
  EXPECT_TRUE(arming.settled());
  EXPECT_EQ(arming.inhibits(), 0U);
}

TEST_F(ArmingTest, ObservationNeedsNoClearance) {
  Config c = config();
  c.control = Control::kObserve;
  c.experiment.secondary_pressure_floor_Pa = 5e6;
  Arming arming(c);
  for (int i = 0; i < 400; ++i) {
    now_.t += kSample;
    arming.step(now_);
  }
  EXPECT_TRUE(arming.settled());
}

// A speed that would not show that it stands still: it waits, and is refused in the end.
TEST_F(ArmingTest, ASpeedThatHardlyMovesIsNotRestedOn) {
  const auto quiet = [](Arming::Now& now) { now.watched = false; };
  run(Arming::kSettle + kSearch, quiet);
  EXPECT_TRUE(arming_.triggered());
  EXPECT_FALSE(arming_.settled());
  EXPECT_EQ(arming_.inhibits(), inhibit_bit(Inhibit::kQuiet));
  run(Arming::kPatience, quiet);
  EXPECT_TRUE(arming_.settled());
  EXPECT_FALSE(arming_.cleared());
  run(kSample);
  EXPECT_TRUE(arming_.cleared());
}

}  // namespace
}  // namespace beltgrip::daemon
