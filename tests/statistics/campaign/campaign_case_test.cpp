// The campaign's drawing against what is asked of it: belts of all peaks and falls, plateaus, slow
// pressures, several requests in a run, hydraulics on both sides of the configuration; each found
// here in the scenario as it is driven.
#include "tests/statistics/campaign/campaign_case.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "tools/sim/vehicle_scenario.h"

namespace beltgrip::test {
namespace {

constexpr std::uint64_t kSeeds = 1500;

std::vector<CampaignCase> drawn() {
  std::vector<CampaignCase> out;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) out.push_back(draw_case(seed));
  return out;
}

TEST(CampaignDrawing, PeaksLieEvenlyFallsLogEvenlyAndSomeAreLevel) {
  std::array<int, 4> peaks{}, falls{};
  int belts = 0, plateaus = 0;
  for (const CampaignCase& each : drawn()) {
    const sim::FrictionCurve& curve = each.scenario.belt.overdrive;
    const double fall = std::log(curve.fall_per_percent / 2e-4) / std::log(60.0);
    ASSERT_TRUE(fall >= 0.0 && fall < 1.0) << each.seed;
    if (curve.shape == sim::CurveShape::kTwoPeaks || curve.fall_at_once > 0.0) {
      EXPECT_LE(curve.peak_slip_percent, 3.0) << each.seed;
      continue;
    }
    const double place = (curve.peak_slip_percent - 0.8) / 7.2;
    ASSERT_TRUE(place >= 0.0 && place < 1.0) << each.seed;
    ++belts;
    ++peaks[static_cast<std::size_t>(4.0 * place)];
    ++falls[static_cast<std::size_t>(4.0 * fall)];
    ASSERT_LE(curve.plateau_percent, 3.0);
    plateaus += curve.plateau_percent > 0.0 ? 1 : 0;
  }
  // Four standard deviations.
  const double apart = 4.0 * std::sqrt(belts * 0.25 * 0.75);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR(peaks[i], 0.25 * belts, apart) << i;
    EXPECT_NEAR(falls[i], 0.25 * belts, apart) << i;
  }
  EXPECT_NEAR(plateaus, 0.2 * belts, apart);
}

TEST(CampaignDrawing, HydraulicsAndPressureAreOnBothSidesOfWhatIsKnown) {
  // What a user of the shipped vehicle configures: 1.2 of its lag and dead time.
  const sim::VehicleScenario nominal = sim::shipped_vehicle_scenario("coast-overdrive").scenario;
  const double lag_s = 1.2 * nominal.hydraulics.lag_s;
  const double dead_time_s = 1.2 * nominal.hydraulics.dead_time_s;
  int slower = 0, later = 0, slow_pressure = 0;
  for (const CampaignCase& each : drawn()) {
    slower += each.scenario.hydraulics.lag_s > lag_s ? 1 : 0;
    later += each.scenario.hydraulics.dead_time_s > dead_time_s ? 1 : 0;
    slow_pressure += each.scenario.sensors.pressure_period_s > 0.0 ? 1 : 0;
  }
  for (const int count : {slower, later, slow_pressure}) {
    EXPECT_GT(count, static_cast<int>(kSeeds) / 6);
    EXPECT_LT(count, static_cast<int>(kSeeds) / 2);
  }
}

TEST(CampaignDrawing, SomeRunsCoastSeveralTimes) {
  std::array<int, 4> coasts{};
  for (const CampaignCase& each : drawn()) {
    if (each.base != "coast-overdrive") continue;
    const auto& steps = each.scenario.driver.steps;
    const auto lifts = std::count_if(steps.begin(), steps.end(), [](const sim::DriverStep& step) {
      return step.accelerator == 0.0 && step.hold_speed_m_s == 0.0;
    });
    ASSERT_TRUE(lifts >= 1 && lifts <= 3) << each.seed;
    ++coasts[static_cast<std::size_t>(lifts)];
    EXPECT_GT(each.scenario.duration_s, steps.back().at_s + 10.0) << each.seed;
  }
  EXPECT_GT(coasts[2], 50);
  EXPECT_GT(coasts[3], 50);
}

// Read off the scenario by the equation of the noise of a ratio of two speeds.
TEST(CampaignDrawing, AClassOfNoiseIsThatOfItsName) {
  constexpr std::array percent{0.023, 0.058, 0.142};
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    for (std::size_t i = 0; i < percent.size(); ++i) {
      const CampaignCase each = draw_case(seed, static_cast<NoiseBand>(i));
      const sim::SensorParameters& s = each.scenario.sensors;
      const double primary = s.primary_speed.noise / 105.0,
                   secondary = s.secondary_speed.noise / 236.0;
      const double square =
          primary * primary + secondary * secondary +
          0.5 * (s.primary_ripple * s.primary_ripple + s.secondary_ripple * s.secondary_ripple);
      EXPECT_NEAR(100.0 * std::sqrt(square), percent[i], 1e-9) << seed;
      EXPECT_EQ(each.faults, draw_case(seed).faults) << seed << ": the same case but for that";
    }
  }
}

TEST(CampaignDrawing, AFallBeyondWhatIsReckonedWithIsShownAndNotPromised) {
  int promised = 0;
  for (const CampaignCase& each : drawn()) {
    const double fall = each.scenario.belt.overdrive.fall_per_percent;
    if (fall > (each.faults.empty() ? 8e-3 : 4e-3)) {
      EXPECT_FALSE(each.guaranteed) << each.seed;
    }
    promised += fall > 4e-3 && each.guaranteed ? 1 : 0;
  }
  EXPECT_GT(promised, 10) << "steep falls without a fault";
}

}  // namespace
}  // namespace beltgrip::test
