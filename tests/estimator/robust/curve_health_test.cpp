// Points on one curve and points that are not, against curves written down here; and a reading that
// steps.
#include "estimator/robust/curve_health.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "estimator/reading/step_watch.h"
#include "estimator/robust/follow_on.h"
#include "estimator/robust/force_step.h"
#include "estimator/signal/trend.h"

namespace beltgrip::estimator {
namespace {

constexpr double kNoise = 2e-4;

std::vector<CurveSums> sums_of(double (*curve)(double), std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<CurveSums> sums(1);
  for (int i = 0; i < 100; ++i) {
    const double slip_percent = 0.02 * i;
    const double mu = curve(slip_percent) + kNoise * normal(random);
    const double weight = 1.0 / (kNoise * kNoise);
    const CurveSums& before = sums.back();
    sums.push_back({before.weight + weight, before.slip_percent + weight * slip_percent,
                    before.mu + weight * mu, before.force_N + weight * 3000.0,
                    before.t_s + 0.05 * 0.05 * (i + 0.5), before.duration_s + 0.05});
  }
  return sums;
}

double largest(double (*curve)(double), std::uint64_t seed) {
  double out = 0.0;
  const std::vector<CurveSums> sums = sums_of(curve, seed);
  for (std::size_t length = 1; length <= 16; length *= 2) {
    out = std::max(out, below_chord(sums, length, {.slip_noise_percent2_s = 1e-8}));
  }
  return out;
}

TEST(CurveHealth, ConcaveCurvesAreWhole) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    EXPECT_LT(largest([](double slip_percent) { return 0.1 * std::tanh(slip_percent); }, seed),
              5.5);
    EXPECT_LT(largest([](double slip_percent) { return 0.05 * std::min(slip_percent, 1.5); }, seed),
              5.5);
  }
}

TEST(CurveHealth, AStepOfTorqueOrSlipIsNot) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    EXPECT_GT(largest(
                  [](double slip_percent) {
                    return 0.1 * std::tanh(slip_percent) * (slip_percent < 1.0 ? 1.0 : 1.05);
                  },
                  seed),
              5.5);
    EXPECT_GT(largest(
                  [](double slip_percent) {
                    return 0.1 * std::tanh(slip_percent < 1.0 ? slip_percent : slip_percent - 0.3);
                  },
                  seed),
              5.5);
  }
}

// An error that wanders (Ornstein-Uhlenbeck), one value each 50 ms.
std::vector<double> wandering(std::size_t count, double deviation, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  const double faded = std::exp(-0.05 / 1.2);
  std::vector<double> out(count);
  double now = normal(random);
  for (double& each : out) {
    each = deviation * now;
    now = faded * now + std::sqrt(1.0 - faded * faded) * normal(random);
  }
  return out;
}

TEST(CurveHealth, AnErrorThatWandersLeavesTheChord) {
  int known = 0, unknown = 0, stepped = 0;
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    std::mt19937_64 random(seed);
    for (const double step : {0.0, 0.4}) {
      const std::vector<double> slow = wandering(100, 0.05, random);
      std::vector<CurveSums> sums =
          sums_of([](double slip_percent) { return 0.1 * std::tanh(slip_percent); }, seed);
      double wandered = 0.0;
      for (std::size_t i = 1; i < sums.size(); ++i) {
        const double mu = (sums[i].mu - sums[i - 1].mu + wandered) * kNoise * kNoise;
        wandered += mu * (slow[i - 1] + (i > 50 ? step : 0.0)) / (kNoise * kNoise);
        sums[i].mu += wandered;
      }
      double with = 0.0, without = 0.0;
      for (std::size_t length = 1; length <= 16; length *= 2) {
        with = std::max(with, below_chord(sums, length, {1e-8, 0.05 * 0.05}));
        without = std::max(without, below_chord(sums, length, {1e-8, 0.0}));
      }
      (step > 0.0 ? stepped : known) += with > 5.5;
      unknown += step > 0.0 ? 0 : without > 5.5;
    }
  }
  EXPECT_LE(known, 1);
  EXPECT_GE(unknown, 50);
  EXPECT_GE(stepped, 90);
}

std::vector<Residual> residuals_of(const std::vector<double>& values, double slow_variance) {
  std::vector<Residual> out;
  for (const double each : values) {
    out.push_back({0.05 * static_cast<double>(out.size()), each, 1.0, slow_variance});
  }
  whiten(out);
  return out;
}

TEST(CurveHealth, ResidualsOfNoiseAreNoneOfACurve) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  int rejected = 0, wandering_rejected = 0, not_known = 0;
  const auto rejects = [](const ResidualTests& tests) {
    return tests.innovation > 5.0 || tests.runs > 4.5;
  };
  for (int i = 0; i < 1000; ++i) {
    std::vector<double> residuals(64);
    for (double& each : residuals) each = normal(random);
    rejected += rejects(test_residuals(residuals_of(residuals, 0.0)));
    std::vector<double> wandered = wandering(64, 3.0, random);
    for (std::size_t k = 0; k < residuals.size(); ++k) wandered[k] += residuals[k];
    wandering_rejected += rejects(test_residuals(residuals_of(wandered, 9.0)));
    not_known += rejects(test_residuals(residuals_of(wandered, 0.0)));
    for (std::size_t k = 0; k < residuals.size(); ++k) residuals[k] += k < 32 ? 1.5 : -1.5;
    const ResidualTests stepped = test_residuals(residuals_of(residuals, 0.0));
    EXPECT_GT(stepped.innovation, 5.0);
    EXPECT_GT(stepped.runs, 1.0);
  }
  EXPECT_LE(rejected, 3);
  EXPECT_LE(wandering_rejected, 3);
  EXPECT_GE(not_known, 900);
}

TEST(StepWatch, SeesAStepAndNoDriftAndNoneWhereSlipMoves) {
  const auto steps = [](double (*torque)(double), double (*slip_percent)(double)) {
    std::mt19937_64 random(1);
    std::normal_distribution<double> normal;
    StepWatch watch(200.0);
    Trend trend(200.0, 4096);
    bool seen = false;
    for (int i = 0; i < 4000; ++i) {
      const double t = i / 200.0;
      const double value = torque(t) + 0.3 * normal(random);
      trend.step(t, value, slip_percent(t));
      seen |= watch.step(value, slip_percent(t), 1e-6, trend, 0.0);
    }
    return seen;
  };
  const auto still = [](double) { return 0.3; };
  const auto up = [](double t) { return t < 10.0 ? 50.0 : 53.0; };
  EXPECT_TRUE(steps(up, still));
  EXPECT_TRUE(steps([](double t) { return t < 10.0 ? -50.0 : -47.0; }, still));
  EXPECT_FALSE(steps([](double t) { return t < 10.0 ? 50.0 : 51.0; }, still));
  EXPECT_FALSE(steps([](double t) { return 50.0 - 2.0 * t; }, still));
  EXPECT_FALSE(steps([](double t) { return 50.0 + 0.5 * std::sin(4.0 * t); }, still));
  EXPECT_FALSE(steps(up, [](double t) { return 2.0 * t; }));
  // A torque that falls as slip begins to grow speeds some inertia up; one that rises does not.
  const auto down = [](double t) { return t < 10.0 ? 50.0 : 47.0; };
  const auto creeps = [](double t) { return 0.3 + 0.2 * std::max(0.0, t - 9.7); };
  EXPECT_TRUE(steps(down, still));
  EXPECT_FALSE(steps(down, creeps));
  EXPECT_TRUE(steps(up, creeps));
}

TEST(StepWatch, ATorqueWhoseErrorWandersDoesNotStep) {
  // Of 40 recordings of a minute.
  const auto stepping = [](double step_Nm, double slow_variance) {
    int seen = 0;
    for (std::uint64_t seed = 1; seed <= 40; ++seed) {
      std::mt19937_64 random(seed);
      std::normal_distribution<double> normal;
      StepWatch watch(200.0);
      Trend trend(200.0, 4096);
      const double faded = std::exp(-1.0 / (200.0 * 1.2));
      double slow = normal(random);
      bool stepped = false;
      for (int i = 0; i < 12000; ++i) {
        slow = faded * slow + std::sqrt(1.0 - faded * faded) * normal(random);
        const double value = 25.0 + 0.8 * slow + 1.5 * normal(random) + (i < 6000 ? 0.0 : step_Nm);
        trend.step(i / 200.0, value, 0.3);
        stepped |= watch.step(value, 0.3, 1e-6, trend, slow_variance);
      }
      seen += stepped;
    }
    return seen;
  };
  EXPECT_LE(stepping(0.0, 0.64), 1);
  EXPECT_GE(stepping(0.0, 0.0), 4);
  EXPECT_GE(stepping(6.0, 0.64), 38);
}

// The clamp force stays about where it counts as lowered, and the torque swings: read only while
// the force lies below, it seems to step. By hand: 1.6 Nm of 30 Nm from one such time to the next.
TEST(ExperimentRecord, ATorqueThatSwingsIsNoStepWhereTheForceHovers) {
  const auto stepped = [](double (*torque_Nm)(double)) {
    std::mt19937_64 random(1);
    std::normal_distribution<double> normal;
    ExperimentRecord record(200.0);
    for (int i = 0; i < 4000; ++i) {
      const double t = i / 200.0;
      const double force_N = 5000.0 * (1.0 - 0.010 * std::min(t, 2.0) +
                                       0.015 * std::sin(std::numbers::pi * std::max(0.0, t - 2.0)));
      record.step({.t_s = t,
                   .slip_percent = 0.3 + 0.01 * normal(random),
                   .torque_Nm = torque_Nm(t) + 0.1 * normal(random),
                   .clamp_force_N = force_N + 5.0 * normal(random),
                   .omega_p_rad_s = 105.0});
    }
    return std::isfinite(record.torque_stepped_s());
  };
  EXPECT_FALSE(stepped([](double t) { return 30.0 + 0.8 * std::sin(2.2 * t); }));
  EXPECT_TRUE(stepped([](double t) { return t < 15.0 ? 30.0 : 33.0; }));
}

// mu* is T / F, the curve a straight line of slip over mu*: a belt follows the true force.
TEST(ForceStep, SeesAReadingThatStepsWhereSlipStaysAndNoForceThatSlipFollows) {
  using Force = double (*)(double);
  // rounded_to_N: what the signal shows changes by; known_N: by what it is known to.
  const auto steps = [](Force truth, Force read_of_truth, double rounded_to_N = 0.0,
                        double known_N = 0.0, double slip_noise_percent2_s = 0.02) {
    std::mt19937_64 random(1);
    std::normal_distribution<double> normal;
    ForceStep watch(200.0, known_N);
    Trend trend(200.0, 4096);
    bool seen = false;
    for (int i = 0; i < 4000; ++i) {
      const double t = i / 200.0;
      double force_N = truth(t) * read_of_truth(t) + 10.0 * normal(random);
      if (rounded_to_N > 0.0) force_N = std::round(force_N / rounded_to_N) * rounded_to_N;
      const Cell cell{
          .t_s = t,
          .slip_percent = 8000.0 / truth(t) - 1.0 + slip_noise_percent2_s * normal(random),
          .torque_Nm = 50.0,
          .clamp_force_N = force_N,
          .omega_p_rad_s = 100.0};
      seen |= watch.step(cell, 0.0, slip_noise_percent2_s * slip_noise_percent2_s / 200.0, trend);
      trend.step(t, force_N, 0.0);
    }
    return seen;
  };
  const auto ramp = [](double t) { return 5000.0 - 100.0 * t; };
  const auto right = [](double) { return 1.0; };
  EXPECT_FALSE(steps(ramp, right));
  EXPECT_TRUE(steps(ramp, [](double t) { return t < 10.0 ? 1.0 : 0.9; }));
  EXPECT_TRUE(steps(ramp, [](double t) { return t < 10.0 ? 1.0 : 1.1; }));
  EXPECT_FALSE(steps(ramp, [](double t) { return t < 10.0 ? 1.0 : 1.005; }));
  EXPECT_FALSE(
      steps([](double t) { return (t < 10.0 ? 1.0 : 0.9) * (5000.0 - 100.0 * t); }, right));
  EXPECT_FALSE(steps([](double t) { return 5000.0 - 200.0 * std::max(0.0, t - 5.0); }, right));
  // The end of a ramp, with a reading that falls a little too fast before it.
  const auto ends = [](double t) {
    return 1.0 - 0.02 * std::clamp(t - 9.0, 0.0, 1.0) * std::clamp(51.0 - 5.0 * t, 0.0, 1.0);
  };
  EXPECT_FALSE(steps([](double t) { return 5000.0 - 300.0 * std::min(t, 10.0); }, ends));
  // Slip that is too noisy to say whether it followed: no force is as quick.
  const auto quick = [](double t) { return t < 10.0 ? 1.0 : 0.9; };
  EXPECT_TRUE(steps(ramp, quick, 0.0, 0.0, 1.0));
  EXPECT_FALSE(steps(ramp, right, 0.0, 0.0, 1.0));
  EXPECT_FALSE(steps(
      ramp, [](double t) { return t < 10.0 ? 1.0 : 0.98; }, 0.0, 0.0, 1.0));
  // Rounded to steps larger than its noise: its stairs are none.
  const auto slow = [](double t) { return 5000.0 - 50.0 * t; };
  EXPECT_TRUE(steps(slow, right, 300.0, 0.0));
  EXPECT_FALSE(steps(slow, right, 300.0, 300.0));
  EXPECT_TRUE(steps(
      slow, [](double t) { return t < 10.0 ? 1.0 : 1.15; }, 150.0, 150.0));
}

// A ramp of 64 N/s whose pressure is read every 100 ms in such steps, with such noise, and foretold
// in between by the line of the last four readings. tells: whether the samples say how long they
// are foretold for. Of 40 ramps, those where a step is found.
int ramps_with_a_step(double rounded_N, double noise_N, double step_share, bool tells) {
  constexpr int kPer = 20;  // samples a reading
  int found = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    ForceStep watch(200.0, rounded_N);
    Trend trend(200.0, 4096, Course::kBends);
    std::vector<double> read_N;
    bool seen = false;
    for (int i = 0; i < 3000; ++i) {
      const double t = i / 200.0, truth_N = 5500.0 - 64.0 * t;
      if (i % kPer == 0) {
        const double shown_N =
            truth_N * (t < 8.0 ? 1.0 : 1.0 + step_share) + noise_N * normal(random);
        read_N.push_back(rounded_N * std::round(shown_N / rounded_N));
      }
      double slope_N = 0.0;  // from one reading to the next
      if (const std::size_t n = read_N.size(); n >= 4) {
        slope_N = 0.3 * (read_N[n - 1] - read_N[n - 4]) + 0.1 * (read_N[n - 2] - read_N[n - 3]);
      }
      const double ahead = static_cast<double>(i % kPer) / kPer;
      const Cell cell{.t_s = t,
                      .slip_percent = 8000.0 / truth_N - 1.0 + 0.02 * normal(random),
                      .torque_Nm = 50.0,
                      .clamp_force_N = read_N.back() + ahead * slope_N,
                      .omega_p_rad_s = 100.0};
      seen |= watch.step(cell, tells ? 0.1 * ahead : 0.0, 0.02 * 0.02 / 200.0, trend);
      trend.step(t, cell.clamp_force_N, 0.0);
    }
    found += seen;
  }
  return found;
}

// Rests on a step of the signal, then a reading on the next one and back, are none of the force.
TEST(ForceStep, WhatASeldomReadPressureIsForetoldByIsNoStep) {
  EXPECT_GT(ramps_with_a_step(452.0, 20.0, 0.0, false), 20);
  EXPECT_LE(ramps_with_a_step(452.0, 20.0, 0.0, true), 2);
  EXPECT_GE(ramps_with_a_step(113.0, 20.0, 0.25, true), 38);
  EXPECT_GE(ramps_with_a_step(113.0, 20.0, -0.25, true), 38);
}

TEST(Trend, LearnsTheNoiseBesideAStepAndACorner) {
  const auto density = [](double (*course)(double)) {
    std::mt19937_64 random(1);
    std::normal_distribution<double> normal;
    Trend trend(200.0, 4096);
    for (int i = 0; i < 4000; ++i) {
      const double t = i / 200.0;
      trend.step(t, course(t) + 0.3 * normal(random), 0.0);
    }
    return trend.density(0.2);
  };
  constexpr double kTruth = 0.09 / 200.0;
  EXPECT_NEAR(density([](double) { return 50.0; }), kTruth, 0.5 * kTruth);
  EXPECT_LT(density([](double t) { return 50.0 * std::min(1.0, t); }), 2.0 * kTruth);
  EXPECT_LT(density([](double t) { return t < 10.0 ? 50.0 : 53.0; }), 2.0 * kTruth);
}

double clamped_again_N(double t) {
  return 3300.0 - 30.0 * t + 2000.0 * std::clamp(t - 10.15, 0.0, 0.3);
}

// Slip runs from 10 s on and is stopped 0.1 s later; mu* is c T / F with c = 6.
TEST(FollowOn, TellsSlipThatComesToAStandFromSlipThatGoesOn) {
  constexpr double kStop_s = 10.1;
  const auto stood = [](double (*slip_percent)(double), double (*force_N)(double),
                        double (*torque_Nm)(double)) {
    std::mt19937_64 random(1);
    std::normal_distribution<double> normal;
    ExperimentRecord record(200.0);
    FollowOn follow_on;
    for (int i = 0; i < 2200; ++i) {
      const double t = i / 200.0;
      const Cell sample{.t_s = t,
                        .slip_percent = slip_percent(t) + 0.02 * normal(random),
                        .torque_Nm = torque_Nm(t) + 0.3 * normal(random),
                        .clamp_force_N = force_N(t) + 30.0 * normal(random),
                        .omega_p_rad_s = 105.0 + 0.02 * normal(random)};
      if (t < kStop_s) {
        record.step(sample);
      } else {
        follow_on.begin(record);
        follow_on.step(sample);
      }
    }
    EXPECT_FALSE(follow_on.waits());
    return follow_on.stood_still(0.1, 6.0, 0.0);
  };
  const auto lowered = [](double t) { return 3300.0 - 30.0 * t; };  // 2997 N at the stop
  const auto drift = [](double t) { return 1.0 + 2.5 * std::clamp(t - 10.0, 0.0, 0.3); };
  const auto slipping = [](double t) { return 1.0 + 2.5 * std::max(t - 10.0, 0.0); };
  const auto held = [](double) { return 50.0; };
  EXPECT_TRUE(stood(drift, lowered, held));
  EXPECT_FALSE(stood(slipping, lowered, held));
  // Clamped again it comes to a stand as well; mu* stays where it was as long as it slips.
  EXPECT_FALSE(stood(drift, clamped_again_N, held));
  EXPECT_FALSE(
      stood(drift, clamped_again_N, [](double t) { return 0.1 / 6.0 * clamped_again_N(t); }));
}

}  // namespace
}  // namespace beltgrip::estimator
