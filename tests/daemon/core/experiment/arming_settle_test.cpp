// How long a trigger must hold, what starts it anew, what the own force and its noise may do, and
// when it looks again.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "daemon/core/experiment/arming.h"

namespace beltgrip::daemon {
namespace {

using estimator::StopReason;

constexpr Duration kSample = 5 * kMillisecond;

Config config(Control control = Control::kCommand) {
  Config c;
  c.trigger = Trigger::kCoastDown;
  c.control = control;
  c.estimator.ratio = estimator::RatioChoice::kEither;
  c.variator.primary_inertia_kg_m2 = 0.18;
  c.experiment.secondary_pressure_floor_Pa = 2e4;
  c.experiment.actuator_dead_time_s = 0.035;
  c.experiment.actuator_lag_s = 0.1;
  return c;
}

Arming::Now coasting() {
  Arming::Now now;
  now.t = MonoTime{kSecond};
  now.usable = true;
  now.omega_p_rad_s = 130.0;
  now.omega_s_rad_s = 130.0 * 2.25;
  now.torque_Nm = -32.0;
  now.clamp_force_N = 4000.0;
  now.stale = 50 * kMillisecond;
  return now;
}

class Settling : public testing::Test {
 protected:
  // The first sample of a trigger, or the one after so long.
  void step(Duration after = kSample) {
    now_.t += after;
    arming_.step(now_);
  }
  void hold(Duration duration, Duration every = kSample) {
    for (const MonoTime end = now_.t + duration; now_.t < end;) step(every);
  }
  void interrupt() {
    now_.conditions.brake_pressed = true;
    step();
    now_.conditions.brake_pressed = false;
  }
  bool inhibited(Inhibit which) const { return (arming_.inhibits() & inhibit_bit(which)) != 0; }

  Arming::Now now_ = coasting();
  Arming arming_{config()};
};

class Observing : public Settling {
 protected:
  void SetUp() override { arming_ = Arming(config(Control::kObserve)); }
};

TEST_F(Observing, SettlesAtOneAndAHalfSeconds) {
  step();
  hold(1495 * kMillisecond);
  EXPECT_FALSE(arming_.settled());
  step();
  EXPECT_TRUE(arming_.settled());
  interrupt();
  EXPECT_FALSE(arming_.settled());
}

// 1 % of the ratio; 25 % of the torque and 4 Nm, from 32 to 44.
TEST_F(Observing, ARatioOrTorqueThatHasDriftedStartsItAnew) {
  struct Case {
    double ratio, torque_Nm;
    bool settles;
  };
  for (const Case& c :
       {Case{1.0099, -32.0, true}, Case{0.9901, -32.0, true}, Case{1.0101, -32.0, false},
        Case{0.9899, -32.0, false}, Case{1.0, -44.0, true}, Case{1.0, -20.0, true},
        Case{1.0, -44.01, false}, Case{1.0, -19.99, false}}) {
    arming_ = Arming(config(Control::kObserve));
    now_ = coasting();
    step();
    hold(kSecond);
    now_.omega_s_rad_s *= c.ratio;
    now_.torque_Nm = c.torque_Nm;
    hold(500 * kMillisecond);
    EXPECT_EQ(arming_.settled(), c.settles) << c.ratio << " " << c.torque_Nm;
  }
}

// Of the last half second, 100 samples: what is left of it falls by a hundredth with each.
TEST_F(Observing, MeanSlipSinceTheTriggerHolds) {
  now_.slip_percent = 5.0;
  step();
  EXPECT_NEAR(arming_.slip_percent(), 5.0, 1e-12);
  interrupt();
  now_.slip_percent = 2.0;
  step();
  EXPECT_NEAR(arming_.slip_percent(), 2.0, 1e-12);  // nothing of before
  now_.slip_percent = 1.0;
  step();
  EXPECT_NEAR(arming_.slip_percent(), 1.5, 1e-12);
  hold(2 * kSecond);
  now_.slip_percent = 0.0;
  const double before = arming_.slip_percent();
  for (int i = 0; i < 50; ++i) step();
  EXPECT_NEAR(arming_.slip_percent(), before * std::pow(0.99, 50), 1e-9);
}

// What cannot be told without the inputs is not told.
TEST_F(Observing, AFaultOrAModelLeavesNothingElseToSay) {
  now_.conditions.brake_pressed = true;
  now_.faulted = true;
  step();
  EXPECT_EQ(arming_.inhibits(), inhibit_bit(Inhibit::kFault));
  now_.faulted = false;
  now_.beyond_box = true;
  now_.usable = false;
  step();
  EXPECT_EQ(arming_.inhibits(), inhibit_bit(Inhibit::kModel));
  now_.conditions.fresh = false;
  step();
  EXPECT_EQ(arming_.inhibits(), inhibit_bit(Inhibit::kModel) | inhibit_bit(Inhibit::kInputs));
}

// 3 % around the end stops that the curve is for.
TEST_F(Observing, TheEndStopsOfTheCurve) {
  using enum estimator::RatioChoice;
  struct Case {
    estimator::RatioChoice choice;
    bool low, overdrive;
  };
  for (const Case& c :
       {Case{kLow, true, false}, Case{kOverdrive, false, true}, Case{kEither, true, true}}) {
    Config chosen = config();
    chosen.estimator.ratio = c.choice;
    const Arming arming(chosen);
    // 3 % either way; of deformation 0.4 % per kN more, below the stop alone, up to 8 %.
    struct Window {
      double force_N, below, above;
    };
    for (const Window& window : {Window{0.0, 0.97, 1.03}, Window{10000.0, 0.93, 1.03},
                                 Window{20000.0, 0.92, 1.03}, Window{-500.0, 0.97, 1.03}}) {
      for (const double at : {window.below + 1e-4, window.above - 1e-4}) {
        EXPECT_EQ(arming.at_end_stop(0.405 * at, window.force_N), c.low);
        EXPECT_EQ(arming.at_end_stop(2.25 * at, window.force_N), c.overdrive);
      }
      for (const double at : {window.below - 1e-4, window.above + 1e-4}) {
        EXPECT_FALSE(arming.at_end_stop(0.405 * at, window.force_N));
        EXPECT_FALSE(arming.at_end_stop(2.25 * at, window.force_N));
      }
    }
  }
}

TEST_F(Observing, SaysWhatEndsAnExperiment) {
  struct Case {
    std::function<void(Conditions&)> change;
    StopReason reason;
    const char* what;
    double figure, limit;  // 0: none
    const char* unit;
    Role role;
  };
  const Case cases[] = {
      {[](Conditions& c) { c.permitted = false; }, StopReason::kPermission, "permission withdrawn",
       0.0, 0.0, "", Role::kExperimentPermitted},
      {[](Conditions& c) { c.brake_pressed = true; }, StopReason::kDriver, "brake pressed", 0.0,
       0.0, "", Role::kBrakePressed},
      {[](Conditions& c) { c.accelerator = 0.06; }, StopReason::kDriver, "pedal at", 6.0, 5.0, "%",
       Role::kAcceleratorPedal},
      {[](Conditions& c) { c.lockup_closed = false; }, StopReason::kTorque, "lock-up opens", 0.0,
       0.0, "", Role::kLockupClosed},
      {[](Conditions& c) { c.oil_degC = 38.5; }, StopReason::kPermission, "oil at", 38.5, 39.0,
       "degC", Role::kOilTemperature},
  };
  for (const Case& c : cases) {
    Conditions now;
    c.change(now);
    const Stop stop = arming_.ended_by(now);
    EXPECT_EQ(stop.reason, c.reason);
    EXPECT_STREQ(stop.cause.what, c.what);
    EXPECT_EQ(stop.cause.role, c.role);
    EXPECT_STREQ(stop.cause.unit, c.unit);
    if (c.limit == 0.0) {
      EXPECT_TRUE(std::isnan(stop.cause.figure)) << c.what;
      continue;
    }
    EXPECT_NEAR(stop.cause.figure, c.figure, 1e-9);
    EXPECT_NEAR(stop.cause.limit, c.limit, 1e-9);
  }
}

// It looks every tenth of a second, from 1.5 s on: the figure of a belt that slips ever more.
TEST_F(Settling, LooksEveryTenthOfASecond) {
  now_.shown = {1.0, 2.0, {}};
  now_.slip_percent = 1.5;
  step();
  const MonoTime held = now_.t;
  double figure = 0.0;
  int looks = 0;
  while (now_.t < held + 2 * kSecond) {
    step();
    now_.slip_percent += 0.001;
    const Duration since = now_.t - held;
    const bool looked = arming_.obstacle().figure != figure;
    EXPECT_EQ(looked, since >= 1500 * kMillisecond && since % (100 * kMillisecond) == Duration{})
        << since;
    looks += looked ? 1 : 0;
    figure = arming_.obstacle().figure;
    if (looked) {
      EXPECT_NEAR(figure, arming_.slip_percent() - 1.0, 1e-9);
      EXPECT_NEAR(arming_.obstacle().limit, 0.4, 1e-12);
    }
  }
  EXPECT_EQ(looks, 6);
  EXPECT_EQ(arming_.inhibits(), inhibit_bit(Inhibit::kGrip));
}

// What an earlier trigger found says nothing of this one.
TEST_F(Settling, AnInterruptionForgetsWhatWasFound) {
  step();
  hold(2 * kSecond);
  ASSERT_TRUE(arming_.cleared());
  interrupt();
  step();
  EXPECT_FALSE(arming_.cleared());
  hold(1500 * kMillisecond);
  EXPECT_FALSE(arming_.cleared());
  EXPECT_FALSE(arming_.settled());  // before it has looked
  now_.slip_percent = 3.0;
  now_.shown = {1.0, 2.0, {}};
  hold(2 * kSecond);
  ASSERT_EQ(arming_.inhibits(), inhibit_bit(Inhibit::kGrip));
  interrupt();
  now_.shown = {};
  step();
  hold(1500 * kMillisecond);
  EXPECT_EQ(arming_.inhibits(), 0U);
}

TEST_F(Settling, PatienceEndsAtNineAndAHalfSeconds) {
  now_.watched = false;
  step();
  hold(9495 * kMillisecond);
  EXPECT_FALSE(arming_.settled());
  step();
  EXPECT_TRUE(arming_.settled());
  EXPECT_EQ(arming_.inhibits(), inhibit_bit(Inhibit::kQuiet));
}

// A car that keeps its speed at the least that is asked for has all the time there is.
TEST_F(Settling, AtTheLeastSpeedAndNotSlowing) {
  now_.omega_p_rad_s = 105.0;
  now_.omega_s_rad_s = 105.0 * 2.25;
  step();
  hold(2 * kSecond);
  EXPECT_TRUE(arming_.cleared());
}

// The crossing has more room further on: it waits beyond the patience, for as long as the ramp and
// three seconds fit in what is left of the coast-down, and is not refused meanwhile.
TEST_F(Settling, WaitsBeyondThePatienceWhileThereIsTimeForIt) {
  now_ = coasting();
  now_.omega_p_rad_s = 176.0;
  now_.torque_Nm = -28.0;
  const MonoTime begun = now_.t;
  const auto slowed = [&](Duration after) {
    now_.omega_p_rad_s = 176.0 - 1.6 * seconds(now_.t + after - begun);
    now_.omega_s_rad_s = now_.omega_p_rad_s * 2.25;
    step(after);
  };
  slowed({});
  while (!inhibited(Inhibit::kWait) && now_.t < begun + 3 * kSecond) slowed(kSample);
  ASSERT_TRUE(inhibited(Inhibit::kWait));
  while (inhibited(Inhibit::kWait)) {
    ASSERT_FALSE(arming_.settled());
    slowed(kSample);
  }
  EXPECT_TRUE(arming_.cleared());
  EXPECT_GT(now_.t - begun, Arming::kSettle + Arming::kPatience);
  const double left_s = (now_.omega_p_rad_s - 105.0) / 1.6;
  EXPECT_GT(left_s, 3.0);
  EXPECT_LT(left_s, 15.0);
}

// The own force, as the means of blocks of 0.1 s. A block is what its samples were.
class OwnForce : public Settling {
 protected:
  void SetUp() override { step(); }
  void block(double force_N) {
    now_.clamp_force_N = force_N;
    hold(100 * kMillisecond);
  }
  void with_pressure_step(double step_N) {
    Config c = config();
    c.estimator.pressure_step_Pa = step_N / 0.0113;
    arming_ = Arming(c);
    now_ = coasting();
    step();
  }
  // 20 blocks of 5000 N, falling evenly and to and fro.
  bool moves(double per_block_N, double to_and_fro_N = 0.0) {
    for (int i = 0; i < 20; ++i) {
      block(5000.0 - per_block_N * i + (i % 2 == 0 ? to_and_fro_N : -to_and_fro_N));
    }
    return inhibited(Inhibit::kForce);
  }
};

TEST_F(OwnForce, FallsByLessThanAHundredAndFiftyNewtonASecond) {
  EXPECT_FALSE(moves(14.9));
  with_pressure_step(0.0);
  EXPECT_TRUE(moves(15.1));
  with_pressure_step(0.0);
  EXPECT_FALSE(moves(-14.9));
  with_pressure_step(0.0);
  EXPECT_TRUE(moves(-15.1));
}

// A step S of the pressure scatters by S / root 12, the slope of a line through five means by that
// over root 10: three times 10 N with S = 109.54 N.
TEST_F(OwnForce, LessWhatTheStepOfThePressureMayHaveMadeOfIt) {
  with_pressure_step(109.54);
  EXPECT_FALSE(moves(44.5));
  with_pressure_step(109.54);
  EXPECT_TRUE(moves(45.5));
}

// To and fro by d: second differences of 4 d, a noise of 4 d / (0.6745 root 6) = 2.4211 d; in the
// slope of five 0.7656 of it, three times that is 30 N with d = 13.06.
TEST_F(OwnForce, LessWhatItsNoiseMayHaveMadeOfIt) {
  EXPECT_FALSE(moves(44.5, 13.06));
  with_pressure_step(0.0);
  EXPECT_TRUE(moves(45.5, 13.06));
}

// One bend among ten means is no noise, wherever it lies; five means show the fall after it.
TEST_F(OwnForce, ABendIsNoNoise) {
  for (int falling = 4; falling <= 8; ++falling) {
    with_pressure_step(0.0);
    for (int i = 0; i < 16; ++i) block(4000.0);
    for (int i = 1; i <= falling; ++i) block(4000.0 - 20.0 * i);
    EXPECT_TRUE(inhibited(Inhibit::kForce)) << falling;
  }
}

// A jump shows at the end of its block, and until five later means are level.
TEST_F(OwnForce, ABlockLastsATenthOfASecond) {
  hold(2 * kSecond);
  EXPECT_FALSE(inhibited(Inhibit::kForce));
  now_.clamp_force_N = 3000.0;
  hold(95 * kMillisecond);
  EXPECT_FALSE(inhibited(Inhibit::kForce));
  step();
  EXPECT_TRUE(inhibited(Inhibit::kForce));
}

// So few samples that ten means take longer than the trigger.
TEST_F(OwnForce, IsNotAtRestBeforeTenMeans) {
  for (int round = 0; round < 2; ++round) {
    hold(1800 * kMillisecond, 200 * kMillisecond);
    EXPECT_TRUE(inhibited(Inhibit::kForce)) << round;
    step(200 * kMillisecond);
    EXPECT_FALSE(inhibited(Inhibit::kForce)) << round;
    interrupt();
    step();
  }
}

}  // namespace
}  // namespace beltgrip::daemon
