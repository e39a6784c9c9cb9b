// Which noise is taken for more than it is, by samples in which each stands for another share.
#include "tools/diagnose/infer/noise_balance.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace beltgrip::diagnose {
namespace {

// Samples whose share of the slip's noise goes from low to high.
std::vector<NoiseSample> samples(double low, double high, double slip_variance,
                                 double torque_variance) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  constexpr int kCount = 4000;
  std::vector<NoiseSample> out;
  for (int i = 0; i < kCount; ++i) {
    const double share = low + (high - low) * i / kCount;
    const double variance = share * slip_variance + (1.0 - share) * torque_variance;
    out.push_back({share, std::sqrt(variance) * normal(random)});
  }
  return out;
}

TEST(NoiseBalance, WhatIsRightStays) {
  const NoiseFactors found = noise_factors(samples(0.0, 1.0, 1.0, 1.0));
  EXPECT_NEAR(found.slip, 1.0, 0.1);
  EXPECT_NEAR(found.torque, 1.0, 0.1);
}

TEST(NoiseBalance, ATorqueTakenForMoreThanItIsCountsForLess) {
  const NoiseFactors found = noise_factors(samples(0.0, 1.0, 1.0, 0.25));
  EXPECT_EQ(found.slip, 1.0);
  EXPECT_NEAR(found.torque, 0.25, 0.06);
}

TEST(NoiseBalance, ASlipTakenForMoreThanItIsCountsForLess) {
  const NoiseFactors found = noise_factors(samples(0.0, 1.0, 0.25, 1.0));
  EXPECT_EQ(found.torque, 1.0);
  EXPECT_NEAR(found.slip, 0.25, 0.06);
}

TEST(NoiseBalance, WhatAllSamplesShareTellsNothing) {
  const NoiseFactors found = noise_factors(samples(0.9, 0.9001, 1.0, 0.25));
  EXPECT_NEAR(found.slip, 1.0, 0.1);
  EXPECT_NEAR(found.torque, 1.0, 0.2);
}

TEST(NoiseBalance, FewSamplesTellNothing) {
  const NoiseFactors found = noise_factors({{0.2, 1.0}, {0.8, 3.0}});
  EXPECT_EQ(found.slip, 1.0);
  EXPECT_EQ(found.torque, 1.0);
}

}  // namespace
}  // namespace beltgrip::diagnose
