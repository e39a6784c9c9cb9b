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
  MonoTime on_floor_from{1'000 * kSecond};
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
  proof.begin(MonoTime{}, {kStart_N, kBand_N, {0.06, 0.15}, {force.noise_N, 1.0}, kSample});
  EXPECT_TRUE(proof.falls());
  std::vector<double> asked_N{kStart_N};
  // Its own force, until what is asked for comes below it.
  const double own_N = kStart_N - force.above_N;
  const auto dead = static_cast<std::size_t>(std::lround(force.dead_s / 5e-3));
  double given_N = own_N;
  Shown out;
  for (std::size_t i = 1; i <= 600 && !out.late && !out.unshown; ++i) {
    const auto t = MonoTime{i * kSample};
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
  EXPECT_NEAR(shown({.on_floor_from = MonoTime{100 * kMillisecond}}).fallen_N, 60.0, 3.1);
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

// The rules beside a lag that is measured the same: rest after the band or half of it, or on the
// floor; at least 0.48 s of it until something is late, a second until nothing is shown; 0.312 s is
// late, 0.45 s is not in time.
TEST(AnswerProof, IsTheSameByHand) {
  std::mt19937 random(17);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  AnswerProof proof;
  int late = 0, unshown = 0, in_time = 0;
  for (int request = 0; request < 400; ++request) {
    const MonoTime begin{request * 20 * kSecond};
    const double noise_N = 60.0 * uniform(random), step_N = request % 3 == 0 ? 60.0 : 0.0;
    const double lag_s = 0.05 + 0.6 * uniform(random), above_N = 60.0 * normal(random);
    const bool near = request % 5 == 0;
    const int floor_from = request % 7 == 0 ? 30 : 10'000;
    proof.begin(begin, {kStart_N, kBand_N, {0.06, 0.15}, {noise_N, step_N}, kSample});
    EXPECT_NEAR(proof.late_s(), 1.3 * 0.24, 1e-12);
    EXPECT_NEAR(proof.credible_s(), 2.0 * 0.21 + 0.03, 1e-12);
    EXPECT_NEAR(proof.rest_N_per_s(), step_N / 1.0, 1e-9);
    AnswerLag lag;
    lag.begin(begin, {kStart_N, {0.06, 0.15}, {noise_N, step_N}, kSample});
    double asked_N = kStart_N, given_N = kStart_N;
    int rests_since = -1, over_since = -1;
    bool is_late = false, is_in_time = false;
    MonoTime read_at = begin;
    double read_N = kStart_N;
    for (int i = 1; i <= 600; ++i) {
      const MonoTime t = begin + i * kSample;
      given_N -= std::expm1(-5e-3 / lag_s) * (asked_N - given_N);
      const bool comes = i % 2 == 0;
      if (comes) {
        read_at = t - (i % 12 == 0 ? 1 : 0) * kSample;
        read_N = given_N + above_N + noise_N * normal(random);
        lag.read(read_at, read_N);
      }
      is_in_time = is_in_time || lag.most_s() < 0.45;
      const bool waited = rests_since >= 0 && over_since < 0 && i - rests_since >= 96;
      is_late = is_late || (lag.least_s() > 0.312 && (waited || over_since >= 0));
      if (rests_since < 0) {
        const double fallen_N = kStart_N - asked_N;
        if (fallen_N >= (near ? 140.0 : 280.0) || i >= floor_from) {
          rests_since = i;
          lag.measure(t, fallen_N, fallen_N / (5e-3 * i));
        }
      } else if (over_since < 0 && (is_in_time || i - rests_since >= 200)) {
        over_since = i;
        lag.resume(t);
      }
      proof.step({t, asked_N, read_at, read_N, near, i >= floor_from});
      ASSERT_EQ(proof.falls(), rests_since < 0) << request << ' ' << i;
      ASSERT_EQ(proof.rests(), rests_since >= 0 && over_since < 0) << request << ' ' << i;
      ASSERT_EQ(proof.late(), is_late) << request << ' ' << i;
      ASSERT_EQ(proof.unshown(), over_since >= 0 && !is_in_time) << request << ' ' << i;
      ASSERT_NEAR(proof.least_s(), lag.least_s(), 1e-9) << request << ' ' << i;
      ASSERT_NEAR(1.0 / proof.most_s(), 1.0 / lag.most_s(), 1e-9) << request << ' ' << i;
      const double rate_N_per_s = !proof.rests() ? kRate_N_per_s : proof.rest_N_per_s();
      asked_N -= i < floor_from ? 5e-3 * rate_N_per_s : 0.0;
      lag.ask(t, asked_N);
      proof.ask(t, asked_N);
    }
    late += is_late ? 1 : 0;
    unshown += proof.unshown() ? 1 : 0;
    in_time += is_in_time ? 1 : 0;
  }
  EXPECT_GT(late, 50);
  EXPECT_GT(unshown, 10);
  EXPECT_GT(in_time, 50);
}

TEST(AnswerProof, NothingIsKnownOfTheRequestBefore) {
  AnswerProof proof;
  for (int request = 0; request < 2; ++request) {
    const MonoTime begin{request * 10 * kSecond};
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
