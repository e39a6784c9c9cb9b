// Has the controller taken its force back? By its own course of force and torque.
#include "daemon/core/experiment/own_force.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace beltgrip::daemon {
namespace {

constexpr Duration kSample = 5 * kMillisecond;

class Returned : public testing::Test {
 protected:
  void for_s(double duration_s, double force_N, double torque_Nm, double noise_N = 0.0) {
    const auto samples = std::lround(duration_s / 5e-3);
    for (long i = 0; i < samples; ++i) {
      t_ += kSample;
      own_.step({t_, force_N + noise_N * normal_(random_), torque_Nm});
    }
  }
  // After 2 s at this force and torque a request of 5 s.
  void request(double force_N = 4000.0, double torque_Nm = -36.0, double noise_N = 0.0) {
    for_s(2.0, force_N, torque_Nm, noise_N);
    own_.begin();
    t_ += 5 * kSecond;
    own_.end();
  }
  OwnForce own_;
  MonoTime t_{kSecond};
  std::mt19937 random_{1};
  std::normal_distribution<double> normal_;
};

TEST_F(Returned, BeforeTheFirstRequestNothingIsMissing) {
  EXPECT_TRUE(own_.back());
  for_s(1.0, 2000.0, -36.0);
  EXPECT_TRUE(own_.back());
}

TEST_F(Returned, ItIsBackWithAllButItsScatter) {
  request();
  EXPECT_FALSE(own_.back());
  EXPECT_NEAR(own_.least_N(), 0.955 * 4000.0, 1e-6);
  for_s(10.0, 0.954 * 4000.0, -36.0);
  EXPECT_FALSE(own_.back());
  EXPECT_NEAR(own_.force_N(), 0.954 * 4000.0, 1e-6);
  for_s(2.0, 0.956 * 4000.0, -36.0);
  EXPECT_TRUE(own_.back());
  for_s(2.0, 3000.0, -36.0);  // once it was, its law may do as it likes
  EXPECT_TRUE(own_.back());
  request(3000.0);
  EXPECT_FALSE(own_.back());
}

// Means over 0.2 s: the first reading after the request is the first of them.
TEST_F(Returned, TakesItsTime) {
  request();
  for_s(0.005, 2400.0, -36.0);
  EXPECT_EQ(own_.force_N(), 2400.0);
  for_s(0.2, 4000.0, -36.0);
  EXPECT_NEAR(own_.force_N(), 4000.0 - 1600.0 * std::exp(-1.0), 10.0);
  EXPECT_FALSE(own_.back());
  for_s(0.6, 4000.0, -36.0);
  EXPECT_TRUE(own_.back());
}

// A law falls by no more than the torque does, in drive as in overrun; of more torque nothing less
// than before is enough.
TEST_F(Returned, LessTorqueNeedsLess) {
  for (const double torque_Nm : {-18.0, 18.0}) {
    request(4000.0, 2.0 * torque_Nm);
    for_s(2.0, 0.954 * 2000.0, torque_Nm);
    EXPECT_FALSE(own_.back());
    for_s(2.0, 0.956 * 2000.0, torque_Nm);
    EXPECT_TRUE(own_.back());
    request(4000.0, torque_Nm);
    for_s(2.0, 3800.0, 2.0 * torque_Nm);
    EXPECT_FALSE(own_.back());
    for_s(2.0, 3850.0, 2.0 * torque_Nm);
    EXPECT_TRUE(own_.back());
  }
}

// 7 % are missed, 40 N of noise in each reading.
TEST_F(Returned, NoiseHidesNothing) {
  for (int i = 0; i < 50; ++i) {
    request(4000.0, -36.0, 40.0);
    for_s(10.0, 0.93 * 4000.0, -36.0, 40.0);
    EXPECT_FALSE(own_.back()) << i;
    for_s(2.0, 0.985 * 4000.0, -36.0, 40.0);
    EXPECT_TRUE(own_.back()) << i;
  }
}

}  // namespace
}  // namespace beltgrip::daemon
