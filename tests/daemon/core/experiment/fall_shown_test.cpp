// How steeply friction falls behind the peak, from points made by hand and by a line with noise.
#include "daemon/core/experiment/fall_shown.h"

#include <gtest/gtest.h>

#include <random>

namespace beltgrip::daemon {
namespace {

// 40 points of a belt whose friction is 0.1 at 2 % of slip and falls behind it, to a point beyond.
// noise: of mu*; drift: what the last point lies too high, evenly from the first on.
void crossing(double fall, double noise, double drift, std::mt19937_64& random, FallShown& to) {
  std::normal_distribution<double> normal;
  LastPoints points;
  for (int i = -20; i < 40; ++i) {
    const double beyond_percent = i / 40.0;
    const double mu = 0.1 - fall * (beyond_percent > 0.0 ? beyond_percent / 100.0 : 0.0);
    points.add(2.0 + beyond_percent, mu + noise * normal(random) + drift * i / 40.0);
  }
  points.show(2.0, to);
}

TEST(FallShown, NothingIsShownByWhatDoesNotPassThePeak) {
  FallShown shown;
  LastPoints points;
  points.show(2.0, shown);
  EXPECT_EQ(shown.range().most, 0.0);
  for (int i = 0; i < 100; ++i) points.add(0.02 * i, 0.001 * i);
  points.show(2.0, shown);
  EXPECT_EQ(shown.range().most, 0.0);
  for (int i = 0; i < 20; ++i) points.add(2.001 + 0.001 * i, 0.1);  // a fiftieth of a point
  points.show(2.0, shown);
  EXPECT_EQ(shown.range().most, 0.0);
}

TEST(FallShown, ALineWithoutNoise) {
  std::mt19937_64 random(1);
  for (const double fall : {0.0, 0.2, 0.8, 1.5}) {
    FallShown shown;
    for (int i = 0; i < 100; ++i) crossing(fall, 0.0, 0.0, random, shown);
    // 0.05 is what a single one leaves open.
    EXPECT_NEAR(shown.range().least, std::max(0.0, fall - 0.01), 1e-6);
    EXPECT_NEAR(shown.range().most, std::max(0.4, 1.5 * fall + 0.01), 1e-6);
  }
}

TEST(FallShown, OnlyTheLastPointsAreKeptAndAClearedListIsEmpty) {
  FallShown shown;
  LastPoints points;
  for (int i = 0; i < 500; ++i) points.add(5.0, 1.0);  // pushed out by what follows
  for (int i = 0; i < 128; ++i) points.add(2.0 + 0.01 * i, 0.1 - 1e-4 * 0.5 * i);
  points.show(2.0, shown);
  EXPECT_NEAR(shown.range().least, 0.5 - 0.1, 1e-6);
  points.clear();
  FallShown nothing;
  points.show(2.0, nothing);
  EXPECT_EQ(nothing.range().most, 0.0);
}

// Under noise and a drift of the sensors the range holds the truth, and one odd experiment neither
// makes a gentle belt steep for good nor a steep one gentle.
TEST(FallShown, HoldsTheTruthOfManyExperiments) {
  std::mt19937_64 random(2);
  std::normal_distribution<double> normal;
  for (const double fall : {0.15, 0.4, 1.2}) {
    int held = 0;
    constexpr int kBelts = 500;
    for (int belt = 0; belt < kBelts; ++belt) {
      FallShown shown;
      for (int i = 0; i < 1 + belt % 10; ++i) {
        crossing(fall, 1.5e-3, 1.5e-3 * normal(random), random, shown);
      }
      const FallRange range = shown.range();
      held += range.least <= fall && fall <= range.most ? 1 : 0;
    }
    EXPECT_GT(held, 0.95 * kBelts) << fall;
  }
  FallShown shown;
  for (int i = 0; i < 10; ++i) crossing(0.15, 1.5e-3, 0.0, random, shown);
  crossing(2.0, 1.5e-3, 0.0, random, shown);
  EXPECT_LT(shown.range().least, 0.4);
}

}  // namespace
}  // namespace beltgrip::daemon
