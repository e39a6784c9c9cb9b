// The rest in which a force shows that it answers in time: when it comes, when it is over, and what
// it then says. The force is this file's own: dead time, then a first-order answer.
#include "daemon/core/experiment/answer_proof.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace beltgrip::daemon {
namespace {

constexpr Duration kSample = 5 * kMillisecond;
constexpr double kStart_N = 4000.0, kBand_N = 280.0, kRate_N_per_s = 600.0;

struct Force {
  double dead_s = 0.06, lag_s = 0.15;
  double noise_N = 0.0;
  double above_N = 0.0;  // by which the daemon reckons it higher than the controller
  bool near = false;
  MonoTime on_floor_from = 1'000 * kSecond;
};

// 3 s of a fall that rests where it is told to.
struct Shown {
  double fallen_N = 0.0, rested_s = 0.0;
  bool late = false, unshown = false;
  double least_s = 0.0, most_s = 0.0;
};

Shown shown(const Force& force, unsigned seed = 1) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  AnswerProof proof;
  proof.begin(0, {kStart_N, kBand_N, {0.06, 0.15}, {force.noise_N, 1.0}, kSample});
  EXPECT_TRUE(proof.falls());
  std::vector<double> asked_N{kStart_N};
  // Its own force, until what is asked for comes below it.
  const double own_N = kStart_N - force.above_N;
  const auto dead = static_cast<std::size_t>(std::lround(force.dead_s / 5e-3));
  double given_N = own_N;
  Shown out;
  for (std::size_t i = 1; i <= 600 && !out.late && !out.unshown; ++i) {
    const auto t = static_cast<MonoTime>(i) * kSample;
    const double told_N = std::min(own_N, asked_N[i > dead ? i - 1 - dead : 0]);
    given_N -= std::expm1(-5e-3 / force.lag_s) * (told_N - given_N);
    const double read_N = given_N + force.above_N + force.noise_N * normal(random);
    proof.step({t, asked_N.back(), t, read_N, force.near, t >= force.on_floor_from});
    asked_N.push_back(asked_N.back() - (proof.rests() ? 0.0 : 5e-3 * kRate_N_per_s));
    proof.ask(t, asked_N.back());
    if (proof.falls()) out.fallen_N = kStart_N - asked_N.back();
    out.rested_s += proof.rests() ? 5e-3 : 0.0;
    out.late = proof.late();
    out.unshown = proof.unshown();
  }
  out.least_s = proof.least_s();
  out.most_s = proof.most_s();
  return out;
}

TEST(AnswerProof, RestsWhereAForceThatFollowsMustHaveBegunToFall) {
  EXPECT_NEAR(shown({}).fallen_N, kBand_N, 3.1);
  EXPECT_NEAR(shown({.near = true}).fallen_N, 0.5 * kBand_N, 3.1);
  EXPECT_NEAR(shown({.on_floor_from = 100 * kMillisecond}).fallen_N, 60.0, 3.1);
}

TEST(AnswerProof, AForceThatAnswersAsConfiguredIsShownSoon) {
  for (const Force& force : {Force{}, Force{.noise_N = 20.0}, Force{.dead_s = 0.0, .lag_s = 0.05},
                             Force{.dead_s = 0.08, .lag_s = 0.18}}) {
    const Shown now = shown(force);
    EXPECT_FALSE(now.late || now.unshown) << force.lag_s;
    EXPECT_GE(now.rested_s, 0.36);  // 1.5 times the configured answer and the bus
    EXPECT_LE(now.rested_s, 0.5) << force.lag_s << ' ' << force.noise_N;
    EXPECT_LT(now.most_s, 0.45);
  }
}

// Also where the controller begins later, or at once by more, for it reckons its force otherwise.
TEST(AnswerProof, WhoReckonsItsForceOtherwiseIsNotLate) {
  for (const double above_N : {-150.0, -80.0, 80.0, 150.0}) {
    for (unsigned seed = 1; seed <= 20; ++seed) {
      const Shown now = shown({.noise_N = 20.0, .above_N = above_N}, seed);
      EXPECT_FALSE(now.late || now.unshown) << above_N << ' ' << now.least_s << ' ' << now.most_s;
    }
  }
}

// 1.3 times 0.24 s is late, beyond 0.45 s it must not be.
TEST(AnswerProof, WhatAnswersLaterIsNeverLetPass) {
  for (const double dead_s : {0.34, 0.4, 0.5, 0.7, 1.0, 3.0}) {
    for (const double noise_N : {0.0, 20.0, 40.0}) {
      for (unsigned seed = 1; seed <= 20; ++seed) {
        const Shown now = shown({.dead_s = dead_s, .noise_N = noise_N}, seed);
        EXPECT_TRUE(now.late || now.unshown) << dead_s << ' ' << noise_N << ' ' << now.most_s;
      }
    }
  }
  for (const double lag_s : {0.5, 0.7}) EXPECT_TRUE(shown({.dead_s = 0.06, .lag_s = lag_s}).late);
}

// What no reading tells is not believed: after a second.
TEST(AnswerProof, WhatIsNotShownCountsAsLate) {
  const Shown now = shown({.noise_N = 500.0});
  EXPECT_TRUE(now.unshown);
  EXPECT_FALSE(now.late);
  EXPECT_NEAR(now.rested_s, 1.0, 0.006);
}

TEST(AnswerProof, NothingIsKnownOfTheRequestBefore) {
  AnswerProof proof;
  for (int request = 0; request < 2; ++request) {
    const MonoTime begin = request * 10 * kSecond;
    proof.begin(begin, {kStart_N, kBand_N, {0.06, 0.15}, {}, kSample});
    EXPECT_TRUE(proof.falls());
    EXPECT_FALSE(proof.late() || proof.unshown() || proof.rests());
    EXPECT_EQ(proof.least_s(), 0.0);
    for (int i = 1; i <= 500; ++i) {  // a deaf one
      const MonoTime t = begin + i * kSample;
      const double asked_N = std::max(kStart_N - 3.0 * i, kStart_N - kBand_N);
      proof.step({t, asked_N, t, kStart_N});
      proof.ask(t, asked_N);
    }
    EXPECT_TRUE(proof.unshown() || proof.late());
  }
}

}  // namespace
}  // namespace beltgrip::daemon
