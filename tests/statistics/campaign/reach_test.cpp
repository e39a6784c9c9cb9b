// What is in reach, against the figures of another simulation and cases computed by hand.
#include "tests/statistics/campaign/reach.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tools/sim/vehicle_scenario.h"

namespace beltgrip::test {
namespace {

// 30 Nm, 133 rad/s (60 km/h), J 0.18, dead time and lag 45 and 80 ms.
ReachPoint car() {
  ReachPoint point;
  point.torque_Nm = 30.0;
  point.omega_p_rad_s = 133.0;
  point.primary_radius_m = 0.0785;
  point.wedge_cosine = std::cos(11.0 * 3.14159265358979 / 180.0);
  point.inertia_kg_m2 = 0.18;
  point.mu_max = 0.105;
  point.peak_slip_share = 0.04;
  point.fall = 0.8;
  point.dead_time_s = 0.045;
  point.lag_s = 0.08;
  point.own_force_N = 1.5 * reach_peak_force_N(point);
  point.floor_N = 1580.0;
  return point;
}

TEST(Reach, PeakForceIsThatOfEquationFive) {
  EXPECT_NEAR(reach_peak_force_N(car()), 30.0 * 0.98163 / (2.0 * 0.0785 * 0.105), 0.5);
}

TEST(Reach, TheFloorStandsInTheWayAtHighSpeed) {
  ReachPoint point = car();
  EXPECT_EQ(wall_at(point), Wall::kNone);
  point.floor_N = 2250.0;  // at 80 km/h
  EXPECT_EQ(wall_at(point), Wall::kFloor);
}

TEST(Reach, SlipSpeedAllowsEightTenthsOfAPointLessThanItsLimit) {
  ReachPoint point = car();  // 0.8 m/s are 7.66 % there
  point.torque_Nm = 10.0;    // energy is no wall
  point.floor_N = 100.0;
  point.own_force_N = 3.0 * reach_peak_force_N(point);
  point.peak_slip_share = 0.0684;
  EXPECT_EQ(wall_at(point), Wall::kNone);
  point.peak_slip_share = 0.0688;
  EXPECT_EQ(wall_at(point), Wall::kSlipSpeed);
}

TEST(Reach, EnergyOfACrossingIsPowerByTime) {
  // 30 x 133 x 0.04 W for 0.8 points at 3 %/s and for 50 + 10 + 45 + 80 ms.
  EXPECT_NEAR(crossing_energy_J(car()), 159.6 * (0.26667 + 0.185), 0.1);
  ReachPoint point = car();
  point.peak_slip_share = 0.057;
  EXPECT_EQ(wall_at(point), Wall::kEnergy);
}

// Steepest fall still caught, per percent: 12e-3 at 30 Nm and own force 1.5 times the peak's, 10e-3
// at 40 Nm, 18e-3 at 2.5 times; at 100 + 150 ms 8e-3. A fifth less ends inside the promise.
TEST(Reach, SteepFallsAreCaughtAsInAnotherSimulation) {
  const auto steepest = [](ReachPoint point) {
    point.fall = 0.05;
    while (caught(point)) point.fall += 0.01;
    return point.fall;
  };
  ReachPoint point = car();
  EXPECT_NEAR(steepest(point), 0.8 * 1.2, 0.15);
  point.own_force_N = 2.5 * reach_peak_force_N(point);
  EXPECT_NEAR(steepest(point), 0.8 * 1.8, 0.25);
  point = car();
  point.torque_Nm = 40.0;
  point.own_force_N = 1.5 * reach_peak_force_N(point);
  EXPECT_NEAR(steepest(point), 0.8 * 1.0, 0.15);
  point = car();
  point.dead_time_s = 0.1;
  point.lag_s = 0.15;
  EXPECT_NEAR(steepest(point), 0.8 * 0.8, 0.15);
}

TEST(Reach, TheShippedCarIsInReachAndItsBrotherAtTheFloorIsNot) {
  const RequestKeys keys{2e4, 600.0, 8e-3};
  const auto of = [&keys](const char* name) {
    return reach_of(sim::shipped_vehicle_scenario(name).scenario, keys, 1);
  };
  EXPECT_EQ(of("coast-overdrive").wall, Wall::kNone);
  EXPECT_NEAR(of("coast-overdrive").peak_slip_percent, 2.0, 1e-9);
  EXPECT_EQ(of("coast-overdrive").noise, NoiseBand::kProduction);
  EXPECT_EQ(reach_of(sim::shipped_vehicle_scenario("coast-overdrive-unreachable").scenario,
                     {1e5, 600.0, 8e-3}, 1)
                .wall,
            Wall::kFloor);
}

// From 9.8 kN to the peak in LOW 6 s are too short at 600 N/s.
TEST(Reach, TheLowEndStopIsWalledByTime) {
  const sim::VehicleScenario low = sim::shipped_vehicle_scenario("coast-low").scenario;
  EXPECT_EQ(reach_of(low, {2e4, 600.0, 8e-3}, 1).wall, Wall::kTime);
}

TEST(Reach, ACurveThatRisesForEverHasNoPeak) {
  sim::VehicleScenario scenario = sim::shipped_vehicle_scenario("coast-overdrive").scenario;
  scenario.belt.overdrive.shape = sim::CurveShape::kSaturating;
  EXPECT_EQ(reach_of(scenario, {2e4, 600.0, 8e-3}, 1).wall, Wall::kNoPeak);
}

}  // namespace
}  // namespace beltgrip::test
