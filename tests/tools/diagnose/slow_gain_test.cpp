// What fits better by another course of the residuals, and what by weighing their noise less.
#include "tools/diagnose/infer/slow_gain.h"

#include <gtest/gtest.h>

#include <cmath>

namespace beltgrip::diagnose {
namespace {

constexpr Eigen::Index kSamples = 400, kBlock = 20;

Eigen::VectorXd noise() {
  Eigen::VectorXd out(kSamples);
  for (Eigen::Index i = 0; i < kSamples; ++i) out[i] = std::sin(7.3 * static_cast<double>(i * i));
  return out;
}

double share_of_noise(const Eigen::VectorXd& without, const Eigen::VectorXd& with) {
  const ResidualEnergy before = energy_of(without, 0, kSamples, kBlock);
  const ResidualEnergy after = energy_of(with, 0, kSamples, kBlock);
  const double whole = before.whole - after.whole;
  return (whole - (before.slow - after.slow)) / whole;
}

TEST(SlowGain, ACourseIsNoNoise) {
  Eigen::VectorXd without = noise();
  without.array() += 0.3;
  EXPECT_NEAR(share_of_noise(without, noise()), 0.0, 0.01);
}

TEST(SlowGain, NoiseThatWeighsLessIsNoCourse) {
  EXPECT_GT(share_of_noise(noise(), 0.98 * noise()), 0.9);
}

TEST(SlowGain, SamplesThatAreNotThereCountForNothing) {
  Eigen::VectorXd half = Eigen::VectorXd::Constant(kSamples, 0.5);
  for (Eigen::Index i = 0; i < kSamples; i += 2) half[i] = 0.0;
  const ResidualEnergy energy = energy_of(half, 0, kSamples, kBlock);
  EXPECT_NEAR(energy.slow, energy.whole, 1e-9);
}

Hypothesis usual() {
  Hypothesis out;
  out.state.nuisance = Eigen::VectorXd::Zero(kNuisanceCount);
  const NuisanceTable table = default_nuisances();
  for (int i = 0; i < kNuisanceCount; ++i) {
    out.state.nuisance[i] = table[static_cast<std::size_t>(i)].nominal;
  }
  out.fit.scatter = default_scatter();
  return out;
}

TEST(SlowGain, SeatsThatScatterAsUsualAgainAreAMachine) {
  constexpr int kSeat = 1;
  Hypothesis scattered = usual();
  scattered.fit.scatter.variance[kSeat] *= 64.0;
  EXPECT_TRUE(mends_machine(scattered, usual()));
  EXPECT_FALSE(mends_machine(usual(), scattered));
  EXPECT_FALSE(mends_machine(scattered, scattered));
  EXPECT_FALSE(mends_machine(usual(), usual()));
}

TEST(SlowGain, ACurveThatFrictionHasAgainIsAMachine) {
  Hypothesis bent = usual();
  bent.state.nuisance.segment(kShapeOverdrive, kShapeKnots).array() -= 0.6;
  EXPECT_TRUE(mends_machine(bent, usual()));
  EXPECT_FALSE(mends_machine(bent, bent));
}

}  // namespace
}  // namespace beltgrip::diagnose
