// The ramp's rate, by hand.
#include "daemon/core/experiment/ramp_rate.h"

#include <gtest/gtest.h>

namespace beltgrip::daemon {
namespace {

constexpr RampLaw kLaw{.rate_max_N_per_s = 600.0,
                       .rate_top_N_per_s = 200.0,
                       .slip_rate_1_s = 0.025,
                       .mu_far = 0.0935,
                       .mu_top = 0.068};

TEST(RampRate, ThePeakIsFarWhileFrictionIsLowAndSlipIsSlow) {
  EXPECT_TRUE(peak_is_far(kLaw, 0.05, 0.0));
  EXPECT_TRUE(peak_is_far(kLaw, 0.0934, 0.0062));
  EXPECT_FALSE(peak_is_far(kLaw, 0.0936, 0.0));
  EXPECT_FALSE(peak_is_far(kLaw, 0.05, 0.0063));  // a quarter of 0.025 is 0.00625
}

TEST(RampRate, AtTheBorderThePeakIsNear) {
  EXPECT_FALSE(peak_is_far(kLaw, kLaw.mu_far, 0.0));
  EXPECT_FALSE(peak_is_far(kLaw, 0.05, 0.25 * 0.025));
  EXPECT_DOUBLE_EQ(ramp_near_N_per_s(kLaw, kLaw.mu_top, 0.0), 200.0);
}

TEST(RampRate, FallsByTheTopsRateWhileTheBeltHardlySlips) {
  EXPECT_DOUBLE_EQ(ramp_near_N_per_s(kLaw, 0.1, 0.0), 200.0);
  EXPECT_DOUBLE_EQ(ramp_near_N_per_s(kLaw, 0.1, -0.02), 200.0);  // noise of a slip rate
}

// 600 N/s over 0.7 of the rate that is held: at 0.0215 1/s a fifth of that is left.
TEST(RampRate, SlowsDownAsTheSlipRateComesNear) {
  EXPECT_NEAR(ramp_near_N_per_s(kLaw, 0.1, 0.0215), 120.0, 1e-9);
  EXPECT_NEAR(ramp_near_N_per_s(kLaw, 0.1, 0.02325), 60.0, 1e-9);
}

TEST(RampRate, StandsStillAboveTheSlipRateThatIsHeld) {
  EXPECT_DOUBLE_EQ(ramp_near_N_per_s(kLaw, 0.1, 0.025), 0.0);
  EXPECT_DOUBLE_EQ(ramp_near_N_per_s(kLaw, 0.1, 0.08), 0.0);
  EXPECT_DOUBLE_EQ(ramp_near_N_per_s(kLaw, 0.05, 0.08), 0.0);
}

TEST(RampRate, NeedNotBeSlowForAPeakWhereNoneLies) {
  EXPECT_NEAR(ramp_near_N_per_s(kLaw, 0.067, 0.0145), 360.0, 1e-9);
  EXPECT_NEAR(ramp_near_N_per_s(kLaw, 0.069, 0.0145), 200.0, 1e-9);
  EXPECT_DOUBLE_EQ(ramp_near_N_per_s(kLaw, 0.067, 0.0), 600.0);
}

TEST(RampRate, IsNeverAboveTheKey) {
  RampLaw slow = kLaw;
  slow.rate_max_N_per_s = 100.0;  // below the top's
  for (const double mu_star : {0.05, 0.067, 0.1}) {
    for (double slip_rate_1_s = -0.05; slip_rate_1_s < 0.05; slip_rate_1_s += 0.001) {
      EXPECT_LE(ramp_near_N_per_s(slow, mu_star, slip_rate_1_s), 100.0);
    }
    EXPECT_DOUBLE_EQ(ramp_near_N_per_s(slow, mu_star, 0.0), 100.0);
  }
}

}  // namespace
}  // namespace beltgrip::daemon
