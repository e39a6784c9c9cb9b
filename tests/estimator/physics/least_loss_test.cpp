// MinClampForce and the force of least loss, against figures worked out by hand and a search for
// the minimum.
#include "estimator/physics/least_loss.h"

#include <gtest/gtest.h>

#include <cmath>

#include "estimator/physics/slip.h"

namespace beltgrip::estimator {
namespace {

TEST(MinClampForce, HoldsTheTorqueAndItsReserve) {
  VariatorParameters variator;
  // 1.3 * 50 * cos 11 deg / (2 * 0.0784 * 0.1)
  EXPECT_NEAR(min_clamp_force_N(variator, EndStop::kOverdrive, 50.0, 0.1), 4069.25, 0.1);
  EXPECT_NEAR(min_clamp_force_N(variator, EndStop::kOverdrive, -50.0, 0.1), 4069.25, 0.1);
  variator.torque_reserve_Nm = 10.0;  // 60 Nm instead
  EXPECT_NEAR(min_clamp_force_N(variator, EndStop::kOverdrive, 50.0, 0.1), 4883.10, 0.1);
  EXPECT_NEAR(min_clamp_force_N(variator, EndStop::kOverdrive, -50.0, 0.1), 4883.10, 0.1);
  EXPECT_NEAR(min_clamp_force_N(variator, EndStop::kLow, 0.0, 0.1),
              1.3 * 10.0 * 0.981627 / (2.0 * 0.0324 * 0.1), 0.1);
}

// Share x of the least force at which x + K u(x) is smallest, where u is the slip over that of the
// peak: tanh(2.2 u) / tanh(2.2) = 1 / x.
double share_by_search(double slip_loss_over_clamp_loss) {
  double best = 0.0, least = 1e9;
  for (double x = 1.001; x < 4.0; x += 1e-3) {
    const double u = std::atanh(std::tanh(2.2) / x) / 2.2;
    const double loss = x + slip_loss_over_clamp_loss * u;
    if (loss < least) {
      least = loss;
      best = x;
    }
  }
  return best;
}

TEST(LeastLoss, IsWhereTheSumOfBothLossesIsSmallest) {
  const VariatorParameters variator;
  for (const EndStop stop : {EndStop::kOverdrive, EndStop::kLow}) {
    const double radius_m = stop == EndStop::kOverdrive ? 0.0784 : 0.0324;
    for (const double peak_percent : {1.0, 2.0, 4.0}) {
      for (const double loss_Nm_per_N : {1e-4, 2e-4, 4e-4}) {
        const double ratio =
            2.0 * radius_m * 0.105 / 0.981627 * 0.01 * peak_percent / loss_Nm_per_N;
        EXPECT_NEAR(least_loss_share(variator, stop, 0.105, peak_percent, loss_Nm_per_N),
                    share_by_search(ratio), 0.04 * share_by_search(ratio))
            << peak_percent << " " << loss_Nm_per_N;
      }
    }
  }
  EXPECT_NEAR(least_loss_share(variator, EndStop::kOverdrive, 0.105, 2.0, 1e-4), 1.56, 0.005);
}

TEST(LeastLoss, APumpCostsThreeTimesTheBelt) {
  // 19 cm3 at 1 kN / 0.0113 m2 = 88.5 kPa: 0.268 Nm, over 0.85.
  EXPECT_NEAR(1e3 * pump_loss_Nm_per_N({}), 0.315, 0.001);
  EXPECT_NEAR(pump_torque_Nm(1e6), 19.0 / 6.283185 / 0.85, 1e-4);
}

TEST(LeastLoss, TheSafetyFactorCountsTowardsTheReserve) {
  const VariatorParameters variator;  // safety factor 1.3
  EXPECT_NEAR(reserve_of_least_loss_Nm(variator, 1.56, 50.0), 10.0, 1e-9);
  EXPECT_NEAR(reserve_of_least_loss_Nm(variator, 1.56, -50.0), 10.0, 1e-9);
  EXPECT_EQ(reserve_of_least_loss_Nm(variator, 1.2, 50.0), 0.0);
}

}  // namespace
}  // namespace beltgrip::estimator
