// Fusion, drift, wear and consistency over many experiments, against belts whose truth is drawn
// here. Rates are counted over thousands of belts, and a wrong test of wear is seen to fail.
#include "estimator/belt/belt_history.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <functional>
#include <random>
#include <vector>

namespace beltgrip::estimator {
namespace {

constexpr double kDay_s = 86400.0;
constexpr double kBegin_s = 1.7e9;

BeltExperiment experiment(double mu, double stated_percent, double time_s = kBegin_s) {
  BeltExperiment each;
  each.time_s = time_s;
  each.kind = PeakKind::kValue;
  each.mu_max = mu;
  each.mu_max_std = 0.01 * stated_percent * mu;
  each.ci95_low = mu - 1.96 * each.mu_max_std;
  each.ci95_high = mu + 1.96 * each.mu_max_std;
  each.omega_p_rad_s = 150.0;
  each.torque_Nm = 40.0;
  return each;
}

FusedFriction fused(const std::vector<BeltExperiment>& history) {
  return fuse(history, Direction::kDrive, EndStop::kOverdrive, history.back().time_s);
}

// --- wear -------------------------------------------------------------------------------------

struct Sides {
  std::vector<double> before, after;
};

// Five experiments before and five after, ln(mu): one constant error of the sensors for all ten.
Sides draw(std::mt19937_64& random, double scatter_percent, double drop) {
  std::normal_distribution<double> normal;
  const double level = std::log(0.1) + 0.05 * normal(random);
  Sides sides;
  for (int i = 0; i < 5; ++i)
    sides.before.push_back(level + 0.01 * scatter_percent * normal(random));
  for (int i = 0; i < 5; ++i) {
    sides.after.push_back(level + std::log1p(-drop) + 0.01 * scatter_percent * normal(random));
  }
  return sides;
}

double share_found(double scatter_percent, double drop, int belts,
                   const std::function<bool(const Sides&)>& found) {
  std::mt19937_64 random(static_cast<unsigned>(1000 * scatter_percent + 1e6 * drop));
  int count = 0;
  for (int i = 0; i < belts; ++i) count += found(draw(random, scatter_percent, drop));
  return static_cast<double>(count) / belts;
}

bool wear_found(const Sides& sides) { return compare(sides.before, sides.after).found; }

// The same with the normal distribution's 1 % in place of Student's, and with the scatter that the
// experiments would state: what the rates below must tell from the real one.
bool naive_found(const Sides& sides) {
  const auto mean = [](const std::vector<double>& values) {
    double sum = 0.0;
    for (const double each : values) sum += each / static_cast<double>(values.size());
    return sum;
  };
  const auto square = [&](const std::vector<double>& values) {
    double sum = 0.0;
    for (const double each : values) sum += (each - mean(values)) * (each - mean(values));
    return sum;
  };
  const double std = std::sqrt((square(sides.before) + square(sides.after)) / 8.0 * 0.4);
  return (mean(sides.after) - mean(sides.before)) / std < -2.326;
}

// 12,000 belts a row: the rate of 1 % is known to 0.09 points.
TEST(Wear, FalseAlarmsAndPower) {
  constexpr int kBelts = 12'000;
  struct Row {
    double scatter_percent, power_min, power_max;
  };
  // Power of the one-sided 1 % test with 8 degrees of freedom for a drop of 3 %.
  for (const Row& row : {Row{0.3, 0.999, 1.0},
                         {0.5, 0.999, 1.0},
                         {1.0, 0.93, 0.97},
                         {1.5, 0.55, 0.70},
                         {2.3, 0.22, 0.34}}) {
    const double alarms = share_found(row.scatter_percent, 0.0, kBelts, wear_found);
    const double power = share_found(row.scatter_percent, 0.03, kBelts, wear_found);
    std::printf("scatter %.1f %%: 3 %% drop found in %.2f %%, false alarms %.2f %%\n",
                row.scatter_percent, 100.0 * power, 100.0 * alarms);
    EXPECT_NEAR(alarms, 0.01, 0.003) << row.scatter_percent;
    EXPECT_GE(power, row.power_min) << row.scatter_percent;
    EXPECT_LE(power, row.power_max) << row.scatter_percent;
  }
  EXPECT_GT(share_found(1.0, 0.0, kBelts, naive_found), 0.02);
}

TEST(Wear, IntervalOfTheDropCovers) {
  std::mt19937_64 random(5);
  int covered = 0;
  constexpr int kBelts = 4000;
  for (int i = 0; i < kBelts; ++i) {
    const Sides sides = draw(random, 1.0, 0.03);
    const WearTest test = compare(sides.before, sides.after);
    covered += test.ci95_low <= -3.0 && -3.0 <= test.ci95_high;
  }
  EXPECT_NEAR(covered / double{kBelts}, 0.95, 0.012);
}

TEST(Wear, EqualConditionsOnly) {
  std::vector<BeltExperiment> history;
  for (int i = 0; i < 5; ++i) history.push_back(experiment(0.105 + 1e-4 * i, 0.3));
  for (int i = 0; i < 5; ++i) history.push_back(experiment(0.1015 + 1e-4 * i, 0.3));
  const auto found = [&] { return wear(history, Direction::kDrive, EndStop::kOverdrive); };
  EXPECT_TRUE(found().found);
  EXPECT_NEAR(found().change_percent, -3.3, 0.2);
  EXPECT_FALSE(wear(history, Direction::kOverrun, EndStop::kOverdrive).judged);
  EXPECT_FALSE(wear(history, Direction::kDrive, EndStop::kLow).judged);
  const auto unlike = [&](auto&& change) {
    const std::vector<BeltExperiment> kept = history;
    for (std::size_t i = 0; i < 5; ++i) change(history[i]);
    const bool judged = found().judged;
    history = kept;
    return !judged;
  };
  EXPECT_TRUE(unlike([](BeltExperiment& each) { each.torque_Nm = 20.0; }));
  EXPECT_TRUE(unlike([](BeltExperiment& each) { each.omega_p_rad_s = 300.0; }));
  for (BeltExperiment& each : history) each.oil_degC = 80.0;
  EXPECT_TRUE(found().found);
  EXPECT_TRUE(unlike([](BeltExperiment& each) { each.oil_degC = 50.0; }));
  EXPECT_TRUE(unlike([](BeltExperiment& each) { each.kind = PeakKind::kLowerBound; }));
  EXPECT_EQ(notes_on_last(history, kBegin_s) & note_bit(Note::kWear), note_bit(Note::kWear));
  history.pop_back();
  EXPECT_FALSE(found().judged);
}

// Friction fell by 5 % after so many experiments, and stayed: the place and the size of the fall
// are told whatever came after it.
TEST(Wear, TheStepIsFoundWhereItIs) {
  std::mt19937_64 random(8);
  std::normal_distribution<double> normal;
  const auto history = [&](int before, int after) {
    std::vector<BeltExperiment> all;
    for (int i = 0; i < before + after; ++i) {
      const double level = i < before ? 0.105 : 0.105 * 0.95;
      all.push_back(experiment(level * std::exp(0.002 * normal(random)), 0.3));
    }
    return all;
  };
  for (const auto& [before, after] :
       {std::pair{10, 2}, {10, 4}, {10, 6}, {10, 10}, {4, 3}, {5, 30}}) {
    const std::vector<BeltExperiment> all = history(before, after);
    const WearStep step = wear_step(all, Direction::kDrive, EndStop::kOverdrive);
    EXPECT_TRUE(step.test.found) << before << " + " << after;
    EXPECT_EQ(step.first, static_cast<std::size_t>(before)) << before << " + " << after;
    EXPECT_EQ(step.test.after, after);
    EXPECT_NEAR(step.test.change_percent, -5.0, 0.7) << before << " + " << after;
  }
  EXPECT_FALSE(wear_step(history(2, 1), Direction::kDrive, EndStop::kOverdrive).test.judged);
  EXPECT_FALSE(wear_step(history(5, 5), Direction::kOverrun, EndStop::kOverdrive).test.judged);
}

TEST(Wear, AStepIsSeldomFoundWhereThereIsNone) {
  std::mt19937_64 random(9);
  std::normal_distribution<double> normal;
  constexpr int kBelts = 4000;
  int found = 0;
  for (int i = 0; i < kBelts; ++i) {
    std::vector<BeltExperiment> all;
    for (int k = 0; k < 4 + i % 16; ++k) {
      all.push_back(experiment(0.105 * std::exp(0.01 * normal(random)), 0.3));
    }
    found += wear_step(all, Direction::kDrive, EndStop::kOverdrive).test.found;
  }
  EXPECT_LE(found, 0.003 * kBelts);  // 0.2 % at most, and what 4,000 belts scatter by
}

// --- fusion -----------------------------------------------------------------------------------

struct Belt {
  std::vector<BeltExperiment> history;
  double truth = 0.0;  // now
};

// A belt whose friction walks, and experiments that scatter by what they state and by more.
Belt draw_belt(std::mt19937_64& random, std::size_t experiments) {
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  const auto pick = [&](std::initializer_list<double> of) {
    return of.begin()[random() % of.size()];
  };
  const double stated_percent = pick({0.2, 0.5, 1.0, 2.0});
  const double more_percent = pick({0.0, 0.2, 0.5, 1.0, 2.0});
  const double walk_percent = pick({0.0, 0.0, 0.1, 0.3, 1.0});
  double level = std::log(0.06) + uniform(random) * std::log(0.14 / 0.06);
  Belt belt;
  for (std::size_t i = 0; i < experiments; ++i) {
    level += 0.01 * walk_percent * normal(random);
    const double y = level + 0.01 * std::hypot(stated_percent, more_percent) * normal(random);
    belt.history.push_back(
        experiment(std::exp(y), stated_percent, kBegin_s + kDay_s * static_cast<double>(i)));
    belt.truth = std::exp(level);
  }
  return belt;
}

TEST(Fusion, CoversTheTruthAndBeatsTheLastExperiment) {
  for (const std::size_t experiments : {1U, 3U, 10U, 40U}) {
    std::mt19937_64 random(experiments);
    int covered = 0;
    double square_fused = 0.0, square_last = 0.0;
    constexpr int kBelts = 1500;
    for (int i = 0; i < kBelts; ++i) {
      const Belt belt = draw_belt(random, experiments);
      const FusedFriction now = fused(belt.history);
      covered += now.ci95_low <= belt.truth && belt.truth <= now.ci95_high;
      square_fused += std::pow(std::log(now.mu_max / belt.truth), 2) / kBelts;
      square_last += std::pow(std::log(belt.history.back().mu_max / belt.truth), 2) / kBelts;
    }
    const double share = covered / double{kBelts};
    std::printf("%zu experiments: error %.2f %% (the last one alone %.2f %%), covered %.1f %%\n",
                experiments, 100.0 * std::sqrt(square_fused), 100.0 * std::sqrt(square_last),
                100.0 * share);
    EXPECT_GE(share, 0.93) << experiments;
    EXPECT_LE(share, 0.985) << experiments;
    EXPECT_LE(square_fused, (experiments >= 10 ? 0.45 : 1.02) * square_last) << experiments;
  }
}

TEST(Fusion, ConstantErrorsAreNotAveragedOut) {
  std::vector<BeltExperiment> history;
  for (int i = 0; i < 40; ++i) {
    BeltExperiment each = experiment(0.1, 0.2);
    each.sensor_std = 0.005;  // 5 %
    each.ci95_low = 0.1 * (1.0 - 1.96 * 0.05);
    each.ci95_high = 0.1 * (1.0 + 1.96 * 0.05);
    history.push_back(each);
  }
  EXPECT_NEAR(fused(history).mu_max_std, 0.005, 0.0002);
}

TEST(Fusion, OneOutlierWaitsForASecond) {
  std::vector<BeltExperiment> history;
  for (int i = 0; i < 20; ++i) history.push_back(experiment(i % 2 == 0 ? 0.1003 : 0.0997, 0.3));
  history.push_back(experiment(0.08, 0.3));
  EXPECT_NEAR(fused(history).mu_max, 0.1, 0.0003);
  EXPECT_EQ(notes_on_last(history, kBegin_s), note_bit(Note::kOutlier));
  EXPECT_EQ(fused(history).weighed, 20);
  EXPECT_TRUE(fused(history).last_waits);
  history.push_back(experiment(0.0802, 0.3));
  EXPECT_NEAR(fused(history).mu_max, 0.0801, 0.0005);
  EXPECT_EQ(fused(history).weighed, 2);
  EXPECT_FALSE(fused(history).last_waits);
  history.pop_back();
  history.push_back(experiment(0.1001, 0.3));
  EXPECT_NEAR(fused(history).mu_max, 0.1, 0.0003);
  EXPECT_EQ(fused(history).weighed, 21);
  EXPECT_EQ(notes_on_last(history, kBegin_s), 0U);
}

TEST(Fusion, FollowsAStepOfWear) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  std::vector<BeltExperiment> history;
  for (int i = 0; i < 50; ++i) {
    history.push_back(experiment(0.105 * std::exp(0.004 * normal(random)), 0.4));
  }
  for (int i = 0; i < 4; ++i) {
    history.push_back(experiment(0.100 * std::exp(0.004 * normal(random)), 0.4));
  }
  EXPECT_NEAR(fused(history).mu_max, 0.100, 0.0007);
}

TEST(Fusion, KnowledgeAges) {
  std::vector<BeltExperiment> history;
  for (int i = 0; i < 20; ++i) history.push_back(experiment(i % 2 == 0 ? 0.1005 : 0.0995, 0.5));
  const auto relative = [&](double later_s) {
    const FusedFriction now =
        fuse(history, Direction::kDrive, EndStop::kOverdrive, kBegin_s + later_s);
    return now.mu_max_std / now.mu_max;
  };
  EXPECT_LT(relative(0.0), 0.004);
  EXPECT_NEAR(relative(365.25 * kDay_s), 0.05, 0.005);
  EXPECT_NEAR(relative(10.0 * 365.25 * kDay_s), 0.16, 0.01);
  EXPECT_NEAR(relative(1000.0 * 365.25 * kDay_s), 0.25, 0.01);
  EXPECT_NEAR(relative(-2.0 * kDay_s), 0.25, 0.01);  // rows from the future
}

TEST(Fusion, TemperatureIsToldFromFriction) {
  std::mt19937_64 random(4);
  std::normal_distribution<double> normal;
  std::vector<BeltExperiment> history;
  for (int i = 0; i < 40; ++i) {
    BeltExperiment each = experiment(0.1, 0.3);
    each.oil_degC = 50.0 + 10.0 * (i % 5);
    each.mu_max *= std::exp(-1.5e-3 * (each.oil_degC - 80.0) + 0.003 * normal(random));
    history.push_back(each);
  }
  EXPECT_NEAR(fused(history).mu_max, 0.1, 0.0003);
}

TEST(Fusion, DriftIsAPercentageForEachExperiment) {
  std::vector<BeltExperiment> history;
  for (int i = 0; i < 30; ++i) {
    history.push_back(experiment(0.1 * std::exp(-0.001 * i) * (i % 2 == 0 ? 1.001 : 0.999), 0.1));
  }
  const FusedFriction now = fused(history);
  EXPECT_NEAR(now.drift_percent, -0.1, 0.01);
  EXPECT_GT(now.drift_percent_std, 0.0);
  EXPECT_LT(now.drift_percent_std, 0.01);
}

TEST(Fusion, WhatIsNoResultDoesNotCount) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  std::vector<BeltExperiment> history;
  EXPECT_FALSE(fuse(history, Direction::kDrive, EndStop::kOverdrive, kBegin_s).known);
  for (const auto& [mu, std] : {std::pair{nan, 0.001},
                                {0.1, nan},
                                {0.1, 0.0},
                                {0.1, -1.0},
                                {5.0, 0.001},
                                {-0.1, 0.001},
                                {1e-9, 1e-12}}) {
    BeltExperiment each = experiment(0.1, 1.0);
    each.mu_max = mu;
    each.mu_max_std = std;
    history.push_back(each);
  }
  history.push_back(experiment(0.1, 1.0));
  history.back().kind = PeakKind::kLowerBound;
  EXPECT_FALSE(fused(history).known);
  history.push_back(experiment(0.1, 1.0));
  EXPECT_EQ(fused(history).experiments, 1);
  EXPECT_FALSE(fuse(history, Direction::kOverrun, EndStop::kOverdrive, kBegin_s).known);
  // Nothing near any belt: waits, and is no knowledge.
  history.pop_back();
  history.push_back(experiment(0.9, 0.1));
  EXPECT_FALSE(fused(history).known || fused(history).mu_max > 0.0);
}

// --- notes ------------------------------------------------------------------------------------

TEST(Notes, RatesOnBeltsThatAreWell) {
  std::mt19937_64 random(11);
  std::normal_distribution<double> normal;
  constexpr int kBelts = 3000;
  int outliers = 0, trends = 0, wears = 0, disagreements = 0;
  for (int i = 0; i < kBelts; ++i) {
    std::vector<BeltExperiment> history;
    for (int k = 0; k < 20; ++k) {
      history.push_back(experiment(0.1 * std::exp(0.006 * normal(random)), 0.5));
      if (k % 2 == 0) continue;
      history.back().direction = Direction::kOverrun;  // a loss of 2 Nm at 40 Nm
      history.back().mu_max *= 0.9;
      history.back().torque_Nm = -40.0;
    }
    const std::uint32_t notes = notes_on_last(history, history.back().time_s);
    outliers += (notes & note_bit(Note::kOutlier)) != 0;
    trends += (notes & note_bit(Note::kTrend)) != 0;
    wears += (notes & note_bit(Note::kWear)) != 0;
    disagreements += (notes & note_bit(Note::kDirections)) != 0;
  }
  std::printf("of %d: %d outliers, %d trends, %d wear, %d disagreements\n", kBelts, outliers,
              trends, wears, disagreements);
  EXPECT_LE(outliers, kBelts / 200);
  EXPECT_LE(trends, kBelts / 50);
  EXPECT_NEAR(wears, 0.01 * kBelts, 0.006 * kBelts);
  EXPECT_EQ(disagreements, 0);
}

TEST(Notes, DirectionsAndEndStopsThatContradict) {
  const auto with = [](double other, Direction direction, EndStop end_stop) {
    std::vector<BeltExperiment> history;
    for (int i = 0; i < 6; ++i) {
      history.push_back(experiment(i % 4 < 2 ? 0.1003 : 0.0997, 0.4));
      history.push_back(experiment(other * (i % 4 < 2 ? 0.997 : 1.003), 0.4));
      history.back().direction = direction;
      history.back().end_stop = end_stop;
    }
    return notes_on_last(history, kBegin_s);
  };
  const auto overrun = [&](double mu) {
    return with(mu, Direction::kOverrun, EndStop::kOverdrive) & note_bit(Note::kDirections);
  };
  EXPECT_EQ(overrun(0.085), 0U);  // losses of 3.2 Nm at 40 Nm
  EXPECT_NE(overrun(0.070), 0U);
  EXPECT_NE(overrun(0.108), 0U);
  const auto low = [&](double mu) {
    return with(mu, Direction::kDrive, EndStop::kLow) & note_bit(Note::kEndStops);
  };
  EXPECT_EQ(low(0.110), 0U);
  EXPECT_NE(low(0.125), 0U);
  EXPECT_NE(low(0.080), 0U);
}

TEST(Notes, ABoundAboveWhatIsKnown) {
  std::vector<BeltExperiment> history;
  for (int i = 0; i < 6; ++i) history.push_back(experiment(i % 2 == 0 ? 0.1003 : 0.0997, 0.4));
  history.push_back(experiment(0.09, 0.4));
  history.back().kind = PeakKind::kLowerBound;
  EXPECT_EQ(notes_on_last(history, kBegin_s), 0U);
  history.back().mu_max = 0.12;
  EXPECT_EQ(notes_on_last(history, kBegin_s), note_bit(Note::kOutlier));
  EXPECT_EQ(notes_on_last({}, kBegin_s), 0U);
}

}  // namespace
}  // namespace beltgrip::estimator
