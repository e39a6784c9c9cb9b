// What slip beyond the peak has done to the belt, by hand.
#include "daemon/core/experiment/slip_damage.h"

#include <gtest/gtest.h>

namespace beltgrip::daemon {
namespace {

constexpr Duration kSample = 5 * kMillisecond;
constexpr double kMu = 0.1;

class Damage : public testing::Test {
 protected:
  void SetUp() override {
    now_ = {.mu_star = kMu, .power_W = 90.0, .slip_speed_m_s = 0.3, .grows = true};
    damage_.begin(now_.t, kMu);
  }
  void run(double seconds) {
    for (int left = static_cast<int>(200.0 * seconds + 0.5); left > 0; --left) {
      now_.t += kSample;
      damage_.step(now_);
    }
  }
  // Friction rises or falls evenly to that; slip stands meanwhile, and until the mean has followed.
  void lead_to(double mu_star, double seconds) {
    now_.grows = false;
    const int steps = static_cast<int>(200.0 * seconds + 0.5);
    const double first = now_.mu_star;
    for (int i = 1; i <= steps; ++i) {
      now_.mu_star = first + (mu_star - first) * i / steps;
      run(0.005);
    }
    run(0.5);
    now_.grows = true;
  }

  SlipDamage damage_;
  SlipDamage::Now now_;
};

TEST_F(Damage, CountsSlipEnergyWhileFrictionDoesNotRise) {
  run(0.4);
  EXPECT_NEAR(damage_.energy_J(), 36.0, 1e-9);
  now_.mu_star = 0.95 * kMu;
  now_.power_W = 200.0;
  run(0.1);
  EXPECT_NEAR(damage_.energy_J(), 56.0, 1e-9);
  EXPECT_TRUE(damage_.beyond());
}

TEST_F(Damage, CountsNothingWhileSlipStands) {
  now_.grows = false;
  now_.slip_speed_m_s = 0.5;
  run(1.0);
  EXPECT_EQ(damage_.energy_J(), 0.0);
  EXPECT_EQ(damage_.fast_s(), 0.0);
  EXPECT_FALSE(damage_.beyond());
}

// Faster than 0.4 m/s.
TEST_F(Damage, CountsTheTimeOfFastSlip) {
  now_.slip_speed_m_s = 0.39;
  run(0.2);
  EXPECT_EQ(damage_.fast_s(), 0.0);
  now_.slip_speed_m_s = 0.41;
  run(0.3);
  EXPECT_NEAR(damage_.fast_s(), 0.3, 1e-9);
}

// By 0.1 %: less than the noise of the mean.
TEST_F(Damage, KeepsAllThroughARiseThatMayBeNoise) {
  run(0.4);
  lead_to(1.001 * kMu, 0.1);
  EXPECT_NEAR(damage_.energy_J(), 36.0, 1e-9);
  EXPECT_TRUE(damage_.beyond());
}

// By 0.2 %: one rise by 0.15 %, seen at up to 0.16 %, of the 0.6 % that forget all.
TEST_F(Damage, ForgetsAQuarterByOneRise) {
  now_.slip_speed_m_s = 0.5;
  run(0.4);
  now_.slip_share = 0.02;
  lead_to(1.002 * kMu, 0.1);
  EXPECT_LE(damage_.energy_J(), 36.0 * 0.75);
  EXPECT_GE(damage_.energy_J(), 36.0 * (1.0 - 0.16 / 0.6));
  EXPECT_NEAR(damage_.fast_s() / 0.4, damage_.energy_J() / 36.0, 1e-9);
  EXPECT_FALSE(damage_.beyond());
  EXPECT_EQ(damage_.slip_at_best_share(), 0.02);
}

// By 3 % in 0.5 s: each sample by 0.03 %, so at least 16 rises of 0.15 to 0.18 %.
TEST_F(Damage, ForgetsByAndByAsFrictionGoesOnRising) {
  run(0.4);
  lead_to(1.03 * kMu, 0.5);
  EXPECT_LT(damage_.energy_J(), 36.0 * 0.0101);  // 0.75 ^ 16
  EXPECT_FALSE(damage_.beyond());
  run(0.2);
  EXPECT_NEAR(damage_.energy_J(), 18.0, 0.4);
}

TEST_F(Damage, HardlyCountsOnTheWayToThePeak) {
  for (int i = 0; i < 200; ++i) {  // 20 % in a second, 90 W
    now_.mu_star *= 1.0 + 0.2 / 200.0;
    run(0.005);
  }
  // Every second sample a rise by 0.2 %, which forgets a third: of 0.45 J a sample 1.35 J stay.
  EXPECT_LT(damage_.energy_J(), 1.4);
}

// Evenly up by 20 % a second and down again: two lags of 35 ms turn where (1 + x) exp(-x) = 1/2,
// 59 ms after it; the last rise by 0.15 % is up to 30 ms before that.
TEST_F(Damage, TheBestIsSeenSomewhatLate) {
  for (int i = 1; i <= 400; ++i) {
    const double t = 0.005 * i;
    now_.mu_star = kMu * (1.0 + 0.2 * (t < 1.0 ? t : 2.0 - t));
    now_.slip_share = 0.03 * t;
    run(0.005);
  }
  EXPECT_GT(damage_.slip_at_best_share(), 0.03 * 1.02);
  EXPECT_LT(damage_.slip_at_best_share(), 0.03 * 1.07);
  EXPECT_TRUE(damage_.beyond());
  // What was counted between the last rises is kept in part: 90 W for less than 30 ms.
  const double since_J = 90.0 * (2.0 - damage_.slip_at_best_share() / 0.03);
  EXPECT_GE(damage_.energy_J(), since_J);
  EXPECT_LT(damage_.energy_J(), since_J + 2.7);
}

// Two lags of 35 ms, a seventh of the way each sample: of a step three samples show 10 %,
// four 15.2.
TEST_F(Damage, AStepByAPercentIsARiseAfterFourSamples) {
  run(0.2);
  EXPECT_TRUE(damage_.beyond());
  now_.mu_star = 1.01 * kMu;
  run(0.015);
  EXPECT_TRUE(damage_.beyond());
  run(0.005);
  EXPECT_FALSE(damage_.beyond());
}

TEST_F(Damage, JustAsFastAsTheLimitIsNotFast) {
  now_.slip_speed_m_s = 0.4;
  run(0.5);
  EXPECT_EQ(damage_.fast_s(), 0.0);
}

TEST_F(Damage, BeginsAnew) {
  run(1.0);
  damage_.begin(now_.t, 0.08);
  EXPECT_EQ(damage_.energy_J(), 0.0);
  EXPECT_FALSE(damage_.beyond());
  now_.mu_star = 0.08;
  run(0.1);
  EXPECT_NEAR(damage_.energy_J(), 9.0, 1e-9);
}

}  // namespace
}  // namespace beltgrip::daemon
