// A cause without a name in both simulated machines: each point acts, as large as the function is
// at the machine's oil temperature, and nothing changes where there is none.
#include <gtest/gtest.h>

#include <algorithm>

#include "tools/sim/bus.h"
#include "tools/sim/configuration.h"
#include "tools/sim/rig_scenario.h"
#include "tools/sim/rig_simulation.h"
#include "tools/sim/vehicle_scenario.h"
#include "tools/sim/vehicle_simulation.h"

namespace beltgrip::sim {
namespace {

using estimator::LearnedPoint;
using estimator::LearnedTerm;

// From 0 at 50 degC to `at_90` at 90.
LearnedTerm rising(LearnedPoint point, double at_90) {
  LearnedTerm out;
  out.point = point;
  out.variable = estimator::LearnedVariable::kOilTemperature;
  out.count = 2;
  out.knot = {50.0, 90.0};
  out.value = {0.0, at_90};
  return out;
}

RigScenario rig_scenario(double oil_degC, const std::vector<LearnedTerm>& learned) {
  RigScenarioResult read =
      parse_rig_scenario({{"machine",
                           "[driveline]\nprimary_speed_rad_s = 150\nprimary_torque_Nm = 20\n"
                           "[clamp]\nstart_force_N = 4000\nramp_N_per_s = 1000\n"}});
  EXPECT_TRUE(read.errors.empty());
  read.scenario.oil_degC = oil_degC;
  read.scenario.learned = learned;
  return read.scenario;
}

std::vector<can::StampedFrame> rig_frames(double oil_degC,
                                          const std::vector<LearnedTerm>& learned) {
  const RigScenario scenario = rig_scenario(oil_degC, learned);
  RigSimulation simulation(scenario);
  Bus bus(rig_database(), kRigBus, scenario, 1);
  std::vector<can::StampedFrame> out;
  while (!simulation.finished() && simulation.now_ns() < 5'000'000'000) {
    simulation.step();
    bus.sample(simulation, out);
  }
  return out;
}

std::vector<can::StampedFrame> car_frames(const std::vector<LearnedTerm>& learned) {
  VehicleScenarioResult read = shipped_vehicle_scenario("coast-overdrive", {});
  EXPECT_TRUE(read.errors.empty());
  read.scenario.learned = learned;
  read.scenario.hydraulics.oil_start_degC = read.scenario.hydraulics.oil_end_degC = 80.0;
  VehicleSimulation simulation(read.scenario, 1);
  Bus bus(vehicle_database(), kVehicleBus, read.scenario, 1);
  std::vector<can::StampedFrame> out;
  while (!simulation.finished() && simulation.now_ns() < 4'000'000'000) {
    simulation.step();
    bus.sample(simulation, out);
  }
  return out;
}

bool same(const std::vector<can::StampedFrame>& a, const std::vector<can::StampedFrame>& b) {
  return std::equal(
      a.begin(), a.end(), b.begin(), b.end(),
      [](const can::StampedFrame& x, const can::StampedFrame& y) { return x.frame == y.frame; });
}

constexpr std::array kLarge{
    std::pair{LearnedPoint::kTorque, 4.0}, std::pair{LearnedPoint::kTorqueGain, 0.2},
    std::pair{LearnedPoint::kClampForce, 500.0}, std::pair{LearnedPoint::kRatio, 0.02},
    std::pair{LearnedPoint::kFriction, -0.3}};

TEST(LearnedMachine, EachPointActsWhereItsFunctionIsNotZero) {
  const auto warm = rig_frames(80.0, {}), cold = rig_frames(50.0, {}), car = car_frames({});
  EXPECT_TRUE(same(warm, rig_frames(80.0, {})));
  for (const auto& [point, size] : kLarge) {
    const std::vector<LearnedTerm> learned{rising(point, size)};
    const auto name = estimator::kLearnedPoints[static_cast<std::size_t>(point)];
    EXPECT_FALSE(same(warm, rig_frames(80.0, learned))) << "rig: " << name;
    EXPECT_TRUE(same(cold, rig_frames(50.0, learned))) << "rig, cold: " << name;
    EXPECT_FALSE(same(car, car_frames(learned))) << "car: " << name;
  }
}

TEST(LearnedMachine, FrictionIsAsLargeAsTheFunctionSays) {
  const auto mu_max = [](const std::vector<LearnedTerm>& learned) {
    RigSimulation simulation(rig_scenario(70.0, learned));
    while (!simulation.finished() && simulation.truth().empty()) simulation.step();
    simulation.step();
    return simulation.truth().front().mu_max;
  };
  // Half way: half of it.
  EXPECT_NEAR(mu_max({rising(LearnedPoint::kFriction, -0.3)}), 0.85 * mu_max({}), 1e-12);
}

}  // namespace
}  // namespace beltgrip::sim
