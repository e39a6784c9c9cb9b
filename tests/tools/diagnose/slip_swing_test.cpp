// One speed that swings and the other does not: told as a line, unless it is a ripple once per
// revolution, what both shafts do, or what something recorded drives.
#include "tools/diagnose/data/slip_swing.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/tools/diagnose/noise.h"
#include "tests/tools/diagnose/recorded_runs.h"
#include "tests/tools/diagnose/rig_table.h"
#include "tools/diagnose/decide/thresholds.h"

namespace beltgrip::diagnose {
namespace {

using daemon::Role;

constexpr double kTurn = 2.0 * std::numbers::pi;
constexpr double kSwing_Hz = 9.7, kPrimary_rad_s = 120.0;

// Shares of the primary speed, of the secondary one, and Pa.
struct Swings {
  double primary = 0.0, secondary = 0.0, pressure_Pa = 0.0;
  double ratio = 2.25;
};

// Two minutes at 100 Hz: bursts every seven seconds that die out within one.
Hump hump_of(const Swings& swings) {
  Noise noise;
  const SignalTable table = rig_table(12000, 0.01, [&](double t_s) -> RigSample {
    const double burst = std::sin(kTurn * kSwing_Hz * t_s) * std::exp(-std::fmod(t_s, 7.0) / 0.8);
    return {kPrimary_rad_s * (1.0 + swings.primary * burst) + 0.01 * noise(),
            kPrimary_rad_s * swings.ratio * (0.99 + swings.secondary * burst) + 0.01 * noise(),
            5e5 + swings.pressure_Pa * burst + 500.0 * noise(), 50.0};
  });
  const PooledSpectrum torque = pooled_spectrum(table[Role::kPrimaryTorque], kChannelMost_Hz);
  return slip_swing(slip_spectra(table, 0.0), torque, {});
}

TEST(SlipSwing, IsOfOneSpeedAlone) {
  const Hump one = hump_of({.primary = 5e-4});
  EXPECT_GT(one.excess, 5.0 * thresholds::kSlipSwing);
  EXPECT_NEAR(one.frequency_Hz, kSwing_Hz, PooledSpectrum::kStep_Hz);
  EXPECT_GT(hump_of({.secondary = 5e-4}).excess, 5.0 * thresholds::kSlipSwing);
}

TEST(SlipSwing, IsNoneOfNoise) { EXPECT_LT(hump_of({}).excess, 0.7 * thresholds::kSlipSwing); }

// The tenth that differs is what readings some milliseconds apart leave.
TEST(SlipSwing, IsNoneOfWhatBothShaftsDo) {
  EXPECT_LT(hump_of({.primary = 5e-3, .secondary = 4.5e-3}).excess, thresholds::kSlipSwing);
}

TEST(SlipSwing, IsNoneOfWhatThePressureDrives) {
  const Hump driven = hump_of({.primary = 5e-4, .pressure_Pa = 5e3});
  EXPECT_LT(driven.excess, thresholds::kSlipSwing);
}

// The secondary shaft turns 9.7 times a second.
TEST(SlipSwing, IsNoRippleOncePerRevolution) {
  EXPECT_EQ(hump_of({.secondary = 5e-4, .ratio = kTurn * kSwing_Hz / kPrimary_rad_s}).excess, 0.0);
}

// Neither the last digits of a number nor the stairs of a reading without noise, which climb 1.7
// and 2.4 of their steps a second.
TEST(SlipSwing, IsNoneOfWhatRoundingLeaves) {
  constexpr double kStep_rad_s = 0.05, kHeld_Pa = 3e5, kHeld_Nm = 50.0;
  const auto excess = [](double rise_1_s, double step_rad_s) {
    const auto read = [&](double omega_rad_s) {
      return step_rad_s > 0.0 ? step_rad_s * std::round(omega_rad_s / step_rad_s) : omega_rad_s;
    };
    const SignalTable table = rig_table(12000, 0.01, [&](double t_s) -> RigSample {
      return {read(kPrimary_rad_s + 1.7 * rise_1_s * t_s), read(270.0 + 2.4 * rise_1_s * t_s),
              kHeld_Pa, kHeld_Nm};
    });
    return slip_swing(prepare(table, {}).slip_spectra, {}, {}).excess;
  };
  EXPECT_LT(excess(0.0, 0.0), thresholds::kSlipSwing);
  EXPECT_LT(excess(kStep_rad_s, kStep_rad_s), thresholds::kSlipSwing);
}

// Of a reading of the primary speed that is shaken: nothing of the machine is wrong.
TEST(SlipSwing, DecidesTheVerdict) {
  blind::Trial trial;
  trial.seed = 5;
  blind::Random random(trial.seed);
  trial.plan = blind::draw_plan(random, trial.machine.setting, 8);
  for (blind::PlannedRun& run : trial.plan) run.low = false;
  const auto verdict = [&](double share) {
    Request request = request_of(trial);
    for (SignalTable& table : request.experiments) {
      Channel& speed = table[Role::kPrimarySpeed];
      for (std::size_t i = 0; i < speed.t_s.size(); ++i) {
        speed.value[i] *= 1.0 + share * std::sin(kTurn * kSwing_Hz * speed.t_s[i]);
      }
    }
    return diagnose(request).diagnosis;
  };
  EXPECT_EQ(verdict(0.0).verdict, Verdict::kNothingWrong);
  const Diagnosis shaken = verdict(5e-4);
  EXPECT_EQ(shaken.verdict, Verdict::kUnexplained);
  ASSERT_TRUE(shaken.unexplained);
  EXPECT_EQ(shaken.unexplained->kind, MisfitKind::kLine);
  EXPECT_NEAR(shaken.unexplained->frequency_Hz.value_or(0.0), kSwing_Hz, PooledSpectrum::kStep_Hz);
}

}  // namespace
}  // namespace beltgrip::diagnose
