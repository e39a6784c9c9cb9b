// The saving of MinClampForce: its pieces against figures worked out by hand, and a few drives.
#include "tests/statistics/saving/clamp_saving.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/statistics/saving/drives.h"

namespace beltgrip::saving {
namespace {

constexpr double kLow_Pa = 2e4, kHigh_Pa = 4.5e5;

TEST(ClampSaving, TheLawIsTheDaemonsFormula) {
  const sim::VehicleScenario s = drive_scenario(Cycle::kCity, kLow_Pa, 1);
  const double per_Nm = std::cos(11.0 * 3.141592653589793 / 180.0) / (2.0 * 0.05);
  const double own_N = (60.0 + 25.0) * per_Nm / 0.09;  // the own law at 60 Nm
  EXPECT_NEAR(min_clamp_command_N(s, {1.3, 10.0}, own_N, 0.05, 100.0),
              1.3 * (60.0 + 10.0) * per_Nm / 0.105, 0.5);
  // Above 121 Nm the own law clamps less: then it stays.
  const double strong_N = (150.0 + 25.0) * per_Nm / 0.09;
  EXPECT_EQ(min_clamp_command_N(s, {1.3, 10.0}, strong_N, 0.05, 100.0), strong_N);
  // 500 N of spring, 9.5e-3 N s2 of oil, 0.0113 m2.
  const double weak_N = (5.0 + 25.0) * per_Nm / 0.09;
  const sim::VehicleScenario high = drive_scenario(Cycle::kCity, 1.5e5, 1);
  EXPECT_NEAR(min_clamp_command_N(high, {1.3, 10.0}, weak_N, 0.05, 100.0),
              500.0 + 9.5e-3 * 1e4 + 0.0113 * 1.5e5, 0.5);
}

TEST(ClampSaving, SlipIsWhereTheCurveCarriesTheTorque) {
  const sim::FrictionCurve curve;  // tanh, 0.105 at 2 %
  const double u = std::atanh(0.5 * std::tanh(2.2)) / 2.2;
  EXPECT_NEAR(carrying_slip_share(curve, 0.0525), 0.02 * u, 1e-8);
  EXPECT_EQ(carrying_slip_share(curve, 0.106), 0.02);
}

TEST(ClampSaving, PaysAtALowFloorAndNotAtAHighOne) {
  for (const Cycle cycle : {Cycle::kCity, Cycle::kMixed}) {
    sim::VehicleScenario low = drive_scenario(cycle, kLow_Pa, 7);
    sim::VehicleScenario high = drive_scenario(cycle, kHigh_Pa, 7);
    low.duration_s = high.duration_s = 900.0;
    const Paired pays = paired_drive(low, 7, {}), not_so = paired_drive(high, 7, {});
    const auto saved = [](const Paired& pair) {
      return 1.0 - pair.min_clamp.with_pump_W() / pair.own.with_pump_W();
    };
    EXPECT_GT(saved(pays), 0.05) << cycle_name(cycle);
    EXPECT_LT(saved(not_so), 0.5 * saved(pays)) << cycle_name(cycle);
    EXPECT_GE(saved(not_so), 0.0) << cycle_name(cycle);
    EXPECT_LE(pays.min_clamp.force_N, pays.own.force_N);
    EXPECT_GT(pays.min_clamp.slip_W, pays.own.slip_W);
    EXPECT_EQ(pays.own.at_top_s, 0.0);
  }
}

TEST(ClampSaving, WithTheReserveTheBeltHolds) {
  sim::VehicleScenario city = drive_scenario(Cycle::kCity, kLow_Pa, 7);
  city.duration_s = 900.0;
  EXPECT_EQ(gross_slip_s(city, 7, {}), 0.0);
}

}  // namespace
}  // namespace beltgrip::saving
