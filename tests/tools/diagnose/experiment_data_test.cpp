// What is taken from the samples before any model: slow copies and the rounding that stays.
#include "tools/diagnose/data/experiment_data.h"
#include "tools/diagnose/model/learned.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "tests/tools/diagnose/noise.h"
#include "tests/tools/diagnose/rig_table.h"

namespace beltgrip::diagnose {
namespace {

using Eigen::ArrayXd;

constexpr double kStep_s = 0.1;

struct Copies {
  double slow = 0.0, wide = 0.0;  // rms of what is left of the noise
  double slow_slope = 0.0, wide_slope = 0.0;
  double largest = 0.0;  // departure of the wide copy from the truth
  double sharp = 0.0, slow_at_turn = 0.0, sharp_at_turn = 0.0;
};

// A signal that falls on a straight line and rises again, twenty times as fast or in a step.
Copies copies_of(bool with_step) {
  constexpr int kCount = 600, kFrom = 300;
  constexpr double kNoise = 30.0;
  const auto truth = [&](int k) {
    const double falling = 3000.0 - 8.0 * std::min(k, kFrom);
    if (k <= kFrom) return falling;
    return with_step ? 3000.0 : std::min(3000.0, falling + 160.0 * (k - kFrom));
  };
  Noise noise;
  GridSignal signal;
  signal.value = ArrayXd(kCount);
  signal.slope = ArrayXd::Zero(kCount);
  for (int k = 0; k < kCount; ++k) signal.value[k] = truth(k) + kNoise * noise();
  add_slow(signal, kStep_s);
  const GridSignal before = signal;
  widen_slow(signal, kStep_s);
  Copies out;
  const auto square = [](double v) { return v * v; };
  for (int k = 100; k < 250; ++k) {
    out.slow += square(before.slow[k] - truth(k)) / 150.0;
    out.wide += square(signal.slow[k] - truth(k)) / 150.0;
    out.sharp += square(signal.sharp[k] - truth(k)) / 150.0;
    out.slow_slope += square(before.slow_slope[k] + 80.0) / 150.0;
    out.wide_slope += square(signal.slow_slope[k] + 80.0) / 150.0;
  }
  for (int k = 0; k < kCount; ++k) {
    // Next to the corner the slow copy itself is off; the wide one may not be off by more.
    const double off = std::abs(before.slow[k] - truth(k));
    out.largest = std::max(out.largest, std::abs(signal.slow[k] - truth(k)) - off);
    out.slow_at_turn = std::max(out.slow_at_turn, off);
    out.sharp_at_turn = std::max(out.sharp_at_turn, std::abs(signal.sharp[k] - truth(k)));
  }
  return out;
}

TEST(SlowCopy, LosesItsNoiseOnStraightLinesAndKeepsWhatMovesFast) {
  for (const bool with_step : {false, true}) {
    const Copies out = copies_of(with_step);
    EXPECT_LT(out.wide, 0.3 * out.slow);
    EXPECT_LT(out.wide_slope, 0.1 * out.slow_slope);
    EXPECT_LT(out.largest, 60.0);
  }
}

TEST(SharpCopy, LosesItsNoiseOnStraightLinesAndIsNotRoundedWhereTheSignalTurns) {
  const Copies step = copies_of(true), turn = copies_of(false);
  for (const Copies& out : {step, turn}) EXPECT_LT(out.sharp, 0.4 * out.slow);
  EXPECT_LT(step.sharp_at_turn, 0.2 * step.slow_at_turn);
  EXPECT_LT(turn.sharp_at_turn, 0.6 * turn.slow_at_turn);
}

// Two shafts in overdrive; rounded to the step, with noise before the rounding.
ExperimentData shafts(double step_rad_s, double noise_rad_s) {
  Noise noise;
  const auto rounded = [&](double value) {
    return std::round((value + noise_rad_s * noise()) / step_rad_s) * step_rad_s;
  };
  return prepare(rig_table(4000, 0.01,
                           [&](double t_s) -> RigSample {
                             return {rounded(100.03 + 0.2 * std::sin(0.1 * t_s)),
                                     rounded(222.0 - 0.5 * std::sin(0.1 * t_s)), 3e5, 50.0};
                           }),
                 estimator::VariatorParameters{});
}

TEST(Rounding, StaysWhereNoNoiseCarriesTheSamplesFromStepToStep) {
  const double held = 0.1 / std::sqrt(12.0) * std::hypot(1.0 / 100.0, 1.0 / 222.0);
  EXPECT_NEAR(shafts(0.1, 0.0).rounding_slip_share, held, 0.1 * held);
  EXPECT_LT(shafts(0.1, 0.1).rounding_slip_share, 0.4 * held);
  EXPECT_LT(shafts(1e-4, 0.02).rounding_slip_share, 0.001 * held);
}

// A pressure that is held, then falls, and is held again; in steps of step_Pa.
SignalTable held_pressure(double from_Pa, double to_Pa, double step_Pa) {
  Noise noise;
  return rig_table(2000, 0.01, [&](double t_s) -> RigSample {
    const double share = std::clamp((t_s - 6.0) / 8.0, 0.0, 1.0);
    return {100.0 + 0.01 * noise(), 222.0 + 0.01 * noise(),
            std::round((from_Pa + share * (to_Pa - from_Pa) + 6e3 * noise()) / step_Pa) * step_Pa,
            50.0};
  });
}

// On the steps it is held on, before the fall and after it; those on the way it passes.
TEST(Rounding, RestsWhereAReadingIsHeldAndNotWhereItPasses) {
  const ExperimentData data = prepare(held_pressure(6e5, 3.2e5, 4e4), {});
  ASSERT_EQ(data.rests_pressure.size(), 2U);
  EXPECT_EQ(data.rests_pressure[0].begin, 0);
  EXPECT_NEAR(data.rests_pressure[0].end, 66, 3);     // half a step into the fall
  EXPECT_NEAR(data.rests_pressure[1].begin, 134, 3);  // as much before its end
  EXPECT_EQ(data.rests_pressure[1].end, data.size());
  EXPECT_NE(data.rests_pressure[0].step, data.rests_pressure[1].step);
  EXPECT_TRUE(prepare(held_pressure(6e5, 3.2e5, 1e3), {}).rests_pressure.empty());
}

// One that holds a value all along says nothing of the steps; another one does.
TEST(Rounding, OfASensorIsToldByAllExperiments) {
  const SignalTable held = held_pressure(5.2e5, 5.2e5, 4e4), falls = held_pressure(6e5, 3.2e5, 4e4);
  EXPECT_TRUE(prepare(held, {}).rests_pressure.empty());
  const ExperimentData data = prepare(held, {}, sensors_of(std::array{&held, &falls}));
  ASSERT_EQ(data.rests_pressure.size(), 1U);
  EXPECT_EQ(data.rests_pressure[0].begin, 0);
  EXPECT_EQ(data.rests_pressure[0].end, data.size());
  EXPECT_NEAR(data.rounding_pressure_Pa, 4e4 / std::sqrt(12.0), 100.0);
}

// It comes from a step above, stays for long and goes on to one below: no mere passage.
TEST(Rounding, RestsWhereAReadingStaysOnItsWay) {
  SignalTable table = held_pressure(6e5, 3.2e5, 4e4);
  for (int i = 0; i < 60; ++i) {
    table[Role::kSecondaryPressure].value[static_cast<std::size_t>(i)] = 6.4e5;
  }
  const ExperimentData data = prepare(table, {});
  const bool at_first = std::any_of(
      data.rests_pressure.begin(), data.rests_pressure.end(),
      [](const Rest& rest) { return rest.begin <= 10 && rest.end >= 60 && rest.end < 75; });
  EXPECT_TRUE(at_first);
}

// 50 Nm, but for what a belt that slips takes of it for a second at the end; or from 40 to 60 Nm.
ExperimentData torque_that(bool is_moved) {
  return prepare(
      rig_table(4000, 0.01,
                [&](double t_s) -> RigSample {
                  const bool gives_way = t_s > 38.0 && t_s < 39.0;
                  return {100.0, 222.0, 3e5, is_moved ? 40.0 + 0.5 * t_s : gives_way ? 40.0 : 50.0};
                }),
      estimator::VariatorParameters{});
}

TEST(Spread, OfATorqueThatGivesWayIsHeld) {
  const ExperimentData held = torque_that(false);
  EXPECT_FALSE(spread_of(held, held.torque).moves());
  EXPECT_NEAR(spread_of(held, held.torque).middle, 50.0, 0.1);
  const ExperimentData moved = torque_that(true);
  EXPECT_TRUE(spread_of(moved, moved.torque).moves());
  EXPECT_NEAR(spread_of(moved, moved.torque).low, 41.0, 0.5);
  EXPECT_NEAR(spread_of(moved, moved.torque).high, 59.0, 0.5);
}

// What gives way follows the friction, and is nothing that the friction follows.
TEST(Spread, OfAHeldTorqueIsOneValueToAFunction) {
  const Eigen::ArrayXd held = recorded(torque_that(false), estimator::LearnedVariable::kTorque);
  EXPECT_NEAR(held.minCoeff(), 50.0, 0.1);
  EXPECT_EQ(held.minCoeff(), held.maxCoeff());
  const Eigen::ArrayXd moved = recorded(torque_that(true), estimator::LearnedVariable::kTorque);
  EXPECT_NEAR(moved.maxCoeff() - moved.minCoeff(), 20.0, 1.0);
}

// What a sensor says that cannot go beyond.
SignalTable clipped_pressure(double low_Pa, double high_Pa) {
  SignalTable table = held_pressure(6e5, 3.2e5, 1e3);
  for (double& value : table[Role::kSecondaryPressure].value) {
    value = std::clamp(value, low_Pa, high_Pa);
  }
  return table;
}

TEST(Saturation, IsALevelThatNoExperimentGoesBeyond) {
  const SignalTable table = clipped_pressure(4e5, 5.2e5);
  const ExperimentData alone = prepare(table, {});
  EXPECT_TRUE(alone.saturated_pressure);
  const SignalTable beyond = held_pressure(6.4e5, 2.8e5, 1e3);
  const ExperimentData among_others = prepare(table, {}, sensors_of(std::array{&table, &beyond}));
  EXPECT_FALSE(among_others.saturated_pressure);
  EXPECT_GT(among_others.valid_count, 180);  // of 200, less the ends
  EXPECT_LT(alone.valid_count, 100);
}

// Steps of 40 kPa, as a pressure of 8 bits has: it rests on all of them, on the outer ones too.
TEST(Saturation, IsNotWhereAPressureIsHeldOnOneOfItsSteps) {
  const ExperimentData data = prepare(held_pressure(5.2e5, 4.0e5, 4e4), {});
  EXPECT_FALSE(data.saturated_pressure);
  EXPECT_GT(data.valid_count, 150);  // of 200, less the ends and the steps
}

// A ramp at whose end the belt runs away, and the pressure that catches it.
SignalTable run_away(double doubles_in_s) {
  constexpr double kCaught_s = 14.2;
  Noise noise;
  return rig_table(2000, 0.01, [&](double t_s) -> RigSample {
    const double caught_s = std::max(0.0, t_s - kCaught_s);
    const double grown = std::exp2((std::min(t_s, kCaught_s) - 14.0) / doubles_in_s);
    const double slip_share = (0.01 + 0.01 * grown) * std::exp(-5.0 * caught_s);
    return {100.0 + 0.005 * noise(), 225.0 * (1.0 - slip_share) + 0.005 * noise(),
            6e5 - 2e4 * t_s + std::min(5e5 * caught_s, 2e5) + 1e3 * noise(), 50.0};
  });
}

TEST(RunAway, IsUsedUntilItIsFast) {
  const auto last_s = [](const ExperimentData& data) {
    double out = 0.0;
    for (int k = 0; k < 142; ++k) {
      if (data.valid[static_cast<std::size_t>(k)]) out = data.t_s[k];
    }
    return out;
  };
  // 0.012 per second at 13.8 s, 0.03 at 14.1 s.
  const double fast_s = last_s(prepare(run_away(0.25), {}));
  EXPECT_GE(fast_s, 13.55);
  EXPECT_LE(fast_s, 13.95);
}

// A pressure that comes down in steps, each a tenth of a second long.
TEST(Staircase, KeepsThePlateausAndNotTheSteps) {
  constexpr double kPlateau_s = 1.3, kHeight_Pa = 5e4;
  const auto pressure_Pa = [](double t_s) {
    const double steps = std::floor(t_s / kPlateau_s);
    const double into_s = t_s - steps * kPlateau_s;
    return 5e5 - kHeight_Pa * (steps - std::max(0.0, 1.0 - into_s / 0.1));
  };
  SignalTable table;
  for (int i = 0; i < 650; ++i) {
    const auto add = [&](Role role, double value) {
      table[role].t_s.push_back(0.01 * i);
      table[role].value.push_back(value);
    };
    add(Role::kPrimarySpeed, 100.0);
    add(Role::kSecondarySpeed, 222.0);
    add(Role::kSecondaryPressure, pressure_Pa(0.01 * i));
    add(Role::kPrimaryTorque, 50.0);
  }
  const ExperimentData data = prepare(table, estimator::VariatorParameters{});
  int kept = 0;
  for (int k = 0; k < data.size(); ++k) {
    if (!data.valid[static_cast<std::size_t>(k)]) continue;
    ++kept;
    EXPECT_NEAR(data.pressure.value[k], pressure_Pa(data.t_s[k]), 0.1 * kHeight_Pa) << k;
    EXPECT_NEAR(data.pressure.slow[k], pressure_Pa(data.t_s[k]), 0.4 * kHeight_Pa) << k;
  }
  EXPECT_EQ(kept, data.valid_count);
  EXPECT_GE(kept, 3 * 6);  // of 13 samples of a whole plateau, half a second and more
  // The first and the last plateau are cut short by the ends of the data.
  EXPECT_EQ(data.stretches.size(), 3U);
}

// Of the secondary speed. late_s: of its stamps; every: so many rows repeat a value.
double age_of_secondary_speed_s(double late_s, int every) {
  SignalTable table;
  Noise noise;
  double held = 0.0;
  for (int i = 0; i < 2000; ++i) {
    const double t_s = 0.01 * i;
    const auto add = [&](Role role, double stamp_s, double value) {
      table[role].t_s.push_back(stamp_s);
      table[role].value.push_back(value);
    };
    if (i % every == 0) held = 200.0 + 0.1 * noise();
    add(Role::kPrimarySpeed, t_s, 100.0 + 0.1 * noise());
    add(Role::kSecondarySpeed, t_s + late_s, held);
    add(Role::kSecondaryPressure, t_s, 5e5);
    add(Role::kPrimaryTorque, t_s, 60.0);
  }
  return prepare(table, estimator::VariatorParameters{}).omega_s.age_s;
}

// A minute at 100 Hz in overdrive: the shaft behind the belt turns to and fro at 1.25 Hz, or the
// reading of the torque before it does, by as much as an inertia of 0.05 kg m2 there would take.
double power_at_the_swing(bool shaft_moves, bool reading_moves) {
  constexpr double kSwing_Hz = 1.25, kInertia_kg_m2 = 0.05, kAmplitude_rad_s = 2.0, kRatio = 2.25;
  constexpr double kTurn = 2.0 * 3.14159265358979;
  Noise noise;
  SignalTable table;
  for (int i = 0; i < 6000; ++i) {
    const double t = 0.01 * i;
    const double acceleration =
        kAmplitude_rad_s * kTurn * kSwing_Hz * std::cos(kTurn * kSwing_Hz * t);
    const double inertia_Nm = kInertia_kg_m2 * acceleration;
    const auto push = [&](Role role, double value) {
      table[role].t_s.push_back(t);
      table[role].value.push_back(value);
    };
    const double omega_s =
        220.0 + (shaft_moves ? kAmplitude_rad_s * std::sin(kTurn * kSwing_Hz * t) : 0.0);
    push(Role::kPrimarySpeed, 100.0 + 0.02 * noise());
    push(Role::kSecondarySpeed, omega_s + 0.03 * noise());
    push(Role::kSecondaryPressure, 5e5 + 1e3 * noise());
    push(Role::kPrimaryTorque, 50.0 + 0.2 * noise() + (reading_moves ? kRatio * inertia_Nm : 0.0));
    push(Role::kSecondaryTorque, 20.0 + 0.2 * noise() - (shaft_moves ? inertia_Nm : 0.0));
  }
  const ExperimentData data = prepare(table, {});
  const auto at = static_cast<std::size_t>(kSwing_Hz / PooledSpectrum::kStep_Hz);
  const std::vector<double>& power = data.unbalanced_spectrum.power;
  return power.at(at) / power.at(2 * at);
}

TEST(UnbalancedTorque, IsNotWhatTheInertiaBehindTheBeltTakes) {
  EXPECT_GT(power_at_the_swing(false, true), 100.0);
  EXPECT_LT(power_at_the_swing(true, false), 3.0);
}

TEST(Age, IsNoneInOneRowUnlessValuesAreRepeated) {
  EXPECT_EQ(age_of_secondary_speed_s(0.0, 1), 0.0);
  EXPECT_NEAR(age_of_secondary_speed_s(0.0, 5), 0.01, 1e-9);
  EXPECT_NEAR(age_of_secondary_speed_s(0.003, 1), 0.01, 1e-9);
}

}  // namespace
}  // namespace beltgrip::diagnose
