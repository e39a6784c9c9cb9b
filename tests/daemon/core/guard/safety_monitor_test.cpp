// The safety monitor: every limit alone, just inside and just outside; what it withdraws stays
// withdrawn until the request has ended.
#include "daemon/core/guard/safety_monitor.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace beltgrip::daemon {
namespace {

constexpr Duration kSample = 5 * kMillisecond;

class Monitor : public testing::Test {
 protected:
  Monitor() {
    limits_.spring_force_N = 500.0;
    limits_.centrifugal_N_s2 = 0.01;
    limits_.floor_force_N = 200.0;  // floor at 300 rad/s: 1600 N
  }
  void SetUp() override { monitor_ = SafetyMonitor(limits_); }

  // One sample later with this drift of the speed ratio (primary slower: overrun).
  SafetyVerdict sample(double request_N, double drift = 0.0) {
    t_ += kSample;
    SafetySignals now = signals_;
    now.omega_s_rad_s *= 1.0 + drift;
    return monitor_.check(t_, now, request_N);
  }
  SafetyVerdict begin(double request_N = 3000.0) {
    t_ += 20 * kSecond;
    return sample(request_N);
  }

  // A request that has come down to 2500 N, below what is still near the first.
  void begin_and_lower() {
    EXPECT_EQ(begin(), SafetyVerdict::kAllowed);
    for (double request_N = 3000.0; request_N > 2500.0; request_N -= 1.0) {
      EXPECT_EQ(sample(request_N), SafetyVerdict::kAllowed);
    }
  }

  // Slip that grows to this drift at 5 % a second.
  void slide(double to, double sign = 1.0) {
    for (double drift = 0.0; drift < to; drift += 0.05 * 5e-3) {
      ASSERT_EQ(sample(2500.0, sign * drift), SafetyVerdict::kAllowed) << drift;
    }
  }

  SafetyLimits limits_;
  SafetyMonitor monitor_{limits_};
  SafetySignals signals_{true, 140.0, 300.0, -30.0, 0.0784, 0.0, 3000.0};
  MonoTime t_{};
};

TEST_F(Monitor, AllowsAQuietRamp) {
  EXPECT_EQ(begin(), SafetyVerdict::kAllowed);
  for (int i = 1; i <= 900; ++i) EXPECT_EQ(sample(3000.0 - 1.5 * i), SafetyVerdict::kAllowed) << i;
}

TEST_F(Monitor, InputsMustBeFreshAndNumbers) {
  signals_.fresh = false;
  EXPECT_EQ(begin(), SafetyVerdict::kInputs);
  for (double SafetySignals::*field :
       {&SafetySignals::omega_p_rad_s, &SafetySignals::omega_s_rad_s, &SafetySignals::torque_Nm}) {
    for (const double bad : {std::nan(""), std::numeric_limits<double>::infinity()}) {
      SetUp();
      signals_ = {true, 140.0, 300.0, -30.0, 0.0784, 0.0, 3000.0};
      EXPECT_EQ(begin(), SafetyVerdict::kAllowed);
      signals_.*field = bad;
      EXPECT_EQ(sample(3000.0), SafetyVerdict::kInputs);
    }
  }
}

TEST_F(Monitor, SpeedAtItsMinimum) {
  signals_.omega_p_rad_s = 85.0;
  EXPECT_EQ(begin(), SafetyVerdict::kAllowed);
  signals_.omega_p_rad_s = std::nextafter(85.0, 0.0);
  EXPECT_EQ(sample(3000.0), SafetyVerdict::kSpeed);
  SetUp();
  signals_.omega_p_rad_s = 140.0;
  signals_.omega_s_rad_s = 0.0;
  EXPECT_EQ(begin(), SafetyVerdict::kSecondary);
}

TEST_F(Monitor, SlipAtOnceAndDebouncedInEitherDirection) {
  for (const double sign : {1.0, -1.0}) {
    signals_.omega_p_rad_s = 95.0;  // slip speed stays inside
    SetUp();
    begin_and_lower();
    slide(0.074, sign);
    EXPECT_EQ(sample(2500.0, sign * 0.0899), SafetyVerdict::kAllowed);
    EXPECT_EQ(sample(2500.0, sign * 0.0901), SafetyVerdict::kSlip);
    SetUp();
    begin_and_lower();
    slide(0.074, sign);
    for (int i = 0; i < 2; ++i) {
      EXPECT_EQ(sample(2500.0, sign * 0.076), SafetyVerdict::kAllowed);
    }
    EXPECT_EQ(sample(2500.0, sign * 0.074), SafetyVerdict::kAllowed);  // counts anew
    for (int i = 0; i < 2; ++i) {
      EXPECT_EQ(sample(2500.0, sign * 0.076), SafetyVerdict::kAllowed);
    }
    EXPECT_EQ(sample(2500.0, sign * 0.076), SafetyVerdict::kSlip);
  }
}

// Near the force it began with, and so near the controller's own, slip means a belt that has lost
// friction, which that force would not catch beyond the peak. Limit: 0.15 % there, 0.48 % at 84 %.
TEST_F(Monitor, SlipWhileTheForceIsStillNearItsFirst) {
  struct Case {
    double request_N, limit;
  };
  for (const double sign : {1.0, -1.0}) {
    for (const Case& c : {Case{3000.0, 0.0015}, Case{2760.0, 0.00315}, Case{2521.0, 0.00479}}) {
      SetUp();
      begin();
      for (double N = 3000.0; N > c.request_N; N -= 1.0) {
        ASSERT_EQ(sample(N, sign * 0.0014), SafetyVerdict::kAllowed);
      }
      const double at = c.request_N == 3000.0 ? 0.0 : sign * 0.0014;  // where it began to count
      for (int i = 0; i < 100; ++i) {
        ASSERT_EQ(sample(c.request_N, at + sign * 0.97 * (c.limit - 0.0001)),
                  SafetyVerdict::kAllowed);
      }
      SafetyVerdict last = SafetyVerdict::kAllowed;
      int samples = 0;
      while (last == SafetyVerdict::kAllowed && samples < 100) {
        last = sample(c.request_N, at + sign * (c.limit + 0.002));
        ++samples;
      }
      EXPECT_EQ(last, SafetyVerdict::kSlip) << c.request_N;
      EXPECT_LE(samples, 20) << "within 0.1 s";
    }
    SetUp();
    begin();
    for (int i = 0; i < 16; ++i) sample(3000.0);
    EXPECT_EQ(sample(3000.0, sign * 0.008), SafetyVerdict::kAllowed) << "one sample is noise";
    SetUp();
    begin_and_lower();
    for (int i = 0; i < 100; ++i) {
      EXPECT_EQ(sample(2500.0, sign * 0.0199), SafetyVerdict::kAllowed);
    }
  }
}

TEST_F(Monitor, SlipSpeed) {
  signals_.omega_p_rad_s = 250.0;
  signals_.omega_s_rad_s = 560.0;
  limits_.floor_force_N = -2000.0;
  SetUp();
  begin();
  const double limit = 0.70 / (250.0 * 0.0784);
  EXPECT_EQ(sample(3000.0, 0.999 * limit), SafetyVerdict::kAllowed);
  EXPECT_EQ(sample(3000.0, 1.001 * limit), SafetyVerdict::kSlipSpeed);
}

TEST_F(Monitor, EngineSpeedThatLeavesThePrimarys) {
  for (const double sign : {1.0, -1.0}) {
    SetUp();
    signals_.omega_e_rad_s = 141.0;  // the lock-up clutch slips a little all the time
    begin();
    const auto engine = [&](double drift, int samples) {
      signals_.omega_e_rad_s = 141.0 * (1.0 + sign * drift);
      SafetyVerdict last{};
      for (int i = 0; i < samples; ++i) last = sample(3000.0);
      return last;
    };
    EXPECT_EQ(engine(0.0249, 100), SafetyVerdict::kAllowed);
    EXPECT_EQ(engine(0.0251, 5), SafetyVerdict::kAllowed);
    EXPECT_EQ(engine(0.0249, 1), SafetyVerdict::kAllowed);  // counts anew
    EXPECT_EQ(engine(0.0251, 5), SafetyVerdict::kAllowed);
    EXPECT_EQ(engine(0.0251, 1), SafetyVerdict::kEngine);
  }
  SetUp();
  signals_.omega_e_rad_s = 0.0;  // not known: not judged
  begin();
  for (int i = 0; i < 20; ++i) EXPECT_EQ(sample(3000.0), SafetyVerdict::kAllowed);
}

// 30 Nm * 140 rad/s * 6 % are 252 W.
TEST_F(Monitor, PowerForLongerThanItMay) {
  begin_and_lower();
  slide(0.059);
  for (int i = 0; i < 2000; ++i) ASSERT_EQ(sample(2500.0, 0.0595), SafetyVerdict::kAllowed);
  for (int i = 0; i < 120; ++i) ASSERT_EQ(sample(2500.0, 0.06), SafetyVerdict::kAllowed) << i;
  EXPECT_EQ(sample(2500.0, 0.0595), SafetyVerdict::kAllowed);  // counts anew
  for (int i = 0; i < 120; ++i) ASSERT_EQ(sample(2500.0, 0.06), SafetyVerdict::kAllowed) << i;
  EXPECT_EQ(sample(2500.0, 0.06), SafetyVerdict::kPower);
}

TEST_F(Monitor, SlipThatGrowsTooFast) {
  const auto largest = [this](double rate_1_s) {
    SetUp();
    begin_and_lower();
    SafetyVerdict last = SafetyVerdict::kAllowed;
    for (double drift = 0.0; drift < 0.06 && last == SafetyVerdict::kAllowed;
         drift += rate_1_s * 5e-3) {
      last = sample(2500.0, drift);
    }
    return last;
  };
  EXPECT_EQ(largest(0.14), SafetyVerdict::kAllowed);
  EXPECT_EQ(largest(0.17), SafetyVerdict::kSlipRate);
}

// Its limit is 87 % of it, smoothed over 100 ms, also before the request.
TEST_F(Monitor, ARequestBeginsAtTheForceThatActs) {
  EXPECT_EQ(begin(2610.0), SafetyVerdict::kAllowed);
  SetUp();
  EXPECT_EQ(begin(2609.9), SafetyVerdict::kStart);
  EXPECT_EQ(monitor_.figure(), 2609.9);
  EXPECT_NEAR(monitor_.limit(), 2610.0, 1e-9);
  for (const double unknown : {0.0, -1.0, std::nan("")}) {
    SetUp();
    signals_.clamp_force_N = unknown;
    EXPECT_EQ(begin(3000.0), SafetyVerdict::kStart) << unknown;
  }
  SetUp();
  signals_.clamp_force_N = 3000.0;
  for (int i = 0; i < 100; ++i) sample(0.0);
  signals_.clamp_force_N = 4000.0;                   // one reading moves it by 50 N
  EXPECT_EQ(sample(2653.0), SafetyVerdict::kStart);  // 0.87 * 3050
  SetUp();
  signals_.clamp_force_N = 3000.0;
  for (int i = 0; i < 100; ++i) sample(0.0);
  signals_.clamp_force_N = 4000.0;
  EXPECT_EQ(sample(2654.0), SafetyVerdict::kAllowed);
  SetUp();
  for (int i = 0; i < 100; ++i) sample(0.0);
  EXPECT_EQ(sample(3450.0), SafetyVerdict::kStart);
  // A force that was not known for a while is not the one of before.
  SetUp();
  signals_.clamp_force_N = 8000.0;
  for (int i = 0; i < 100; ++i) sample(0.0);
  signals_.fresh = false;
  sample(0.0);
  signals_.fresh = true;
  signals_.clamp_force_N = 3000.0;
  EXPECT_EQ(sample(3000.0), SafetyVerdict::kAllowed);
}

// Near the first force slip counts from the mean of the first 80 ms, and is smoothed over 40 ms.
TEST_F(Monitor, SlipNearTheFirstForceCountsFromTheMeanOfItsBegin) {
  begin();
  // 0 for 60 ms, 1.2 % until 80 ms: the mean is 0.3 %, and 0.4 % is 0.1 % from it.
  for (int i = 1; i <= 12; ++i) ASSERT_EQ(sample(3000.0), SafetyVerdict::kAllowed);
  for (int i = 1; i <= 4; ++i) ASSERT_EQ(sample(3000.0, 0.012), SafetyVerdict::kAllowed);
  for (int i = 1; i <= 100; ++i) ASSERT_EQ(sample(3000.0, 0.004), SafetyVerdict::kAllowed) << i;

  SetUp();
  begin();
  for (int i = 1; i <= 16; ++i) ASSERT_EQ(sample(3000.0), SafetyVerdict::kAllowed);
  int samples = 1;
  while (sample(3000.0, 0.002) == SafetyVerdict::kAllowed && samples < 100) ++samples;
  EXPECT_EQ(samples, 11);  // 1 - (7/8)^11 of 0.2 % is the first beyond 0.15 %
  EXPECT_NEAR(monitor_.limit(), 0.0015, 1e-9);
  EXPECT_GT(monitor_.figure(), 0.0015);
  EXPECT_LT(monitor_.figure(), 0.0016);
}

// Both shafts slow down: no slip.
TEST_F(Monitor, ACarThatSlowsDownIsNoSlip) {
  begin();
  for (int i = 0; i < 400; ++i) {
    signals_.omega_p_rad_s *= 0.9999;
    signals_.omega_s_rad_s *= 0.9999;
    ASSERT_EQ(sample(3000.0), SafetyVerdict::kAllowed) << i;
  }
}

TEST_F(Monitor, ASecondRequestKnowsNothingOfTheFirst) {
  signals_.omega_e_rad_s = 140.0;
  begin_and_lower();
  slide(0.03);
  sample(0.0);
  // At another speed ratio, with another engine speed.
  signals_.omega_s_rad_s = 285.0;
  signals_.omega_e_rad_s = 150.0;
  EXPECT_EQ(begin(), SafetyVerdict::kAllowed);
  for (int i = 0; i < 400; ++i) ASSERT_EQ(sample(3000.0), SafetyVerdict::kAllowed) << i;
}

TEST_F(Monitor, AnEngineThatIsNotKnownSaysNothing) {
  begin();
  signals_.omega_e_rad_s = 140.0;  // not known at the start
  for (int i = 0; i < 20; ++i) ASSERT_EQ(sample(3000.0), SafetyVerdict::kAllowed);
  SetUp();
  begin();
  signals_.omega_e_rad_s = 0.0;  // and not known any more
  for (int i = 0; i < 20; ++i) ASSERT_EQ(sample(3000.0), SafetyVerdict::kAllowed);
}

TEST_F(Monitor, TheDebounceIsTenMilliseconds) {
  signals_.omega_p_rad_s = 95.0;
  SetUp();
  begin_and_lower();
  slide(0.074);
  const auto at = [this](Duration since) {
    SafetySignals now = signals_;
    now.omega_s_rad_s *= 1.076;
    return monitor_.check(t_ + since, now, 2500.0);
  };
  EXPECT_EQ(at(kMillisecond), SafetyVerdict::kAllowed);
  EXPECT_EQ(at(11 * kMillisecond - kNanosecond), SafetyVerdict::kAllowed);
  EXPECT_EQ(at(11 * kMillisecond), SafetyVerdict::kSlip);
}

// The pause counts from where the permission was withdrawn, to the tick.
TEST_F(Monitor, ThePauseBeginsWhereTheRequestHadToEnd) {
  begin();
  signals_.fresh = false;
  EXPECT_EQ(sample(3000.0), SafetyVerdict::kInputs);
  signals_.fresh = true;
  const MonoTime withdrawn = t_;
  for (int i = 0; i < 100; ++i) sample(2990.0);
  sample(0.0);
  EXPECT_EQ(monitor_.check(withdrawn + limits_.pause_min - kNanosecond, signals_, 3000.0),
            SafetyVerdict::kPause);
  EXPECT_EQ(monitor_.check(withdrawn + limits_.pause_min - kNanosecond, signals_, 0.0),
            SafetyVerdict::kAllowed);
  EXPECT_EQ(monitor_.check(withdrawn + limits_.pause_min, signals_, 3000.0),
            SafetyVerdict::kAllowed);
}

TEST_F(Monitor, FloorMovesWithTheSpeed) {
  signals_.clamp_force_N = 1600.0;
  EXPECT_EQ(begin(1599.0), SafetyVerdict::kFloor);
  SetUp();
  EXPECT_EQ(begin(1600.0), SafetyVerdict::kAllowed);
  EXPECT_EQ(sample(1600.0), SafetyVerdict::kAllowed);
  EXPECT_EQ(sample(1599.9), SafetyVerdict::kFloor);
}

TEST_F(Monitor, NeverRisesAndFallsNoFasterThanItMay) {
  begin();
  EXPECT_EQ(sample(3000.0), SafetyVerdict::kAllowed);
  EXPECT_EQ(sample(3000.1), SafetyVerdict::kRise);
  SetUp();
  begin();
  EXPECT_EQ(sample(3000.0 - 2.5), SafetyVerdict::kAllowed);  // 1.5 N and 1 N of rounding
  EXPECT_EQ(sample(3000.0 - 2.5 - 2.51), SafetyVerdict::kRate);
}

TEST_F(Monitor, DurationAndPause) {
  begin();
  const MonoTime begun = t_;
  while (t_ < begun + limits_.duration_max - kSample) {
    ASSERT_EQ(sample(3000.0), SafetyVerdict::kAllowed);
  }
  EXPECT_EQ(sample(3000.0), SafetyVerdict::kAllowed);  // exactly the maximum
  EXPECT_EQ(sample(3000.0), SafetyVerdict::kDuration);
  const MonoTime ended = t_;
  EXPECT_EQ(sample(0.0), SafetyVerdict::kAllowed);
  while (t_ < ended + limits_.pause_min - 2 * kSample) sample(0.0);
  EXPECT_EQ(sample(3000.0), SafetyVerdict::kPause);
  sample(0.0);
  EXPECT_EQ(sample(3000.0), SafetyVerdict::kAllowed);
}

TEST_F(Monitor, WhatIsWithdrawnStaysWithdrawnUntilTheRequestHasEnded) {
  begin();
  signals_.fresh = false;
  EXPECT_EQ(sample(3000.0), SafetyVerdict::kInputs);
  signals_.fresh = true;
  for (int i = 0; i < 100; ++i) EXPECT_EQ(sample(2990.0), SafetyVerdict::kInputs);
  EXPECT_EQ(sample(0.0), SafetyVerdict::kAllowed);
  EXPECT_EQ(sample(2990.0), SafetyVerdict::kPause);
}

TEST_F(Monitor, ARequestThatIsNoNumberIsNone) {
  EXPECT_EQ(begin(std::nan("")), SafetyVerdict::kFloor);
  EXPECT_EQ(sample(-1.0), SafetyVerdict::kFloor);
}

}  // namespace
}  // namespace beltgrip::daemon
