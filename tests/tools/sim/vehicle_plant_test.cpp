// The virtual vehicle's parts against closed formulas and published numbers.
#include "tools/sim/vehicle_plant.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tools/sim/hydraulic_actuator.h"
#include "tools/sim/vehicle_engine.h"
#include "tools/sim/vehicle_scenario.h"

namespace beltgrip::sim {
namespace {

VehicleScenario scenario(const std::vector<std::string>& settings = {}) {
  std::vector<ScenarioLayer> layers;
  for (const std::string& setting : settings) layers.push_back(setting_layer(setting));
  VehicleScenarioResult result = parse_vehicle_scenario(layers);
  EXPECT_TRUE(result.errors.empty()) << result.errors.front();
  return result.scenario;
}

// Overdrive, lock-up closed, no losses, no road load that matters, no deformation: what the closed
// formulas assume.
VehicleScenario bare() {
  return scenario({"variator.primary_loss_Nm=0", "variator.primary_loss_Nm_per_kN=0",
                   "variator.secondary_loss_Nm=0", "variator.secondary_loss_Nm_s=0",
                   "variator.deformation_per_N=0", "vehicle.rolling_resistance=0",
                   "vehicle.drag_area_m2=0"});
}

DrivelineInput overrun(double torque_Nm, double force_N) {
  DrivelineInput input;
  input.engine_torque_Nm = -torque_Nm;
  input.lockup_capacity_Nm = 400.0;
  input.secondary_force_N = force_N;
  input.primary_force_N = 3.0 * force_N;
  return input;
}

// Force at which mu_max 0.105 just carries the torque at the primary radius of overdrive.
double peak_force_N(double torque_Nm) {
  return torque_Nm * std::cos(11.0 * std::numbers::pi / 180.0) / (2.0 * 0.07837 * 0.105);
}

TEST(VehiclePlant, CoastsDownAsItsForcesSay) {
  const VehicleScenario s = scenario({"variator.deformation_per_N=0"});
  VehiclePlant plant(s);
  plant.settle(20.0, 2.25, 0.0);
  const DrivelineInput input = overrun(35.0, 6000.0);
  for (int i = 0; i < 400; ++i) plant.step(input, 5e-4);
  const double before = plant.speed_m_s();
  for (int i = 0; i < 2000; ++i) plant.step(input, 5e-4);
  const double deceleration = before - plant.speed_m_s();
  const double mean = 0.5 * (before + plant.speed_m_s());
  // At the wheels: engine and primary loss over the ratio, secondary loss, rolling, air; against
  // mass and all rotating inertia.
  const double per_torque = 5.4 / 0.30;
  const double omega_s = mean * per_torque;
  const double force = (35.0 + 0.3 + 0.6) / 2.25 * per_torque +
                       (1.0 + 2e-3 * omega_s) * per_torque + 1300.0 * 9.81 * 0.010 +
                       0.5 * 1.2 * 0.65 * mean * mean;
  const double mass = 1300.0 + per_torque * per_torque * (0.03 + 0.18 / (2.25 * 2.25));
  EXPECT_NEAR(deceleration, force / mass, 0.01 * deceleration);
}

TEST(VehiclePlant, FromThePeakToTenPercentAsTabulated) {
  // Engine of 0.18 kg m2 at 130 rad/s driven by the belt in overdrive, peak at 2 %, fall
  // 1.5e-3 per percent: seconds from the peak to 10 % without recovery.
  struct Row {
    double torque_Nm, ramp_N_per_s, time_s;
  };
  for (const Row& row : {Row{15, 100, 1.00}, Row{15, 300, 0.61}, Row{30, 100, 0.88},
                         Row{30, 300, 0.57}, Row{50, 300, 0.51}, Row{50, 1000, 0.32}}) {
    VehicleScenario s = bare();
    s.body.mass_kg = 100e3;  // the car's speed does not change meanwhile
    VehiclePlant plant(s);
    plant.settle(130.0 * 2.25 * 0.30 / 5.4, 2.25, 0.0);
    double force_N = 1.15 * peak_force_N(row.torque_Nm);
    double t_s = 0.0, peak_s = 0.0, ten_s = 0.0;
    for (int i = 0; i < 2000; ++i) plant.step(overrun(row.torque_Nm, force_N), 5e-4);
    while (ten_s == 0.0 && t_s < 60.0) {
      force_N -= row.ramp_N_per_s * 5e-4;
      t_s += 5e-4;
      plant.step(overrun(row.torque_Nm, force_N), 5e-4);
      if (peak_s == 0.0 && -plant.output().slip_share >= 0.02) peak_s = t_s;
      if (-plant.output().slip_share >= 0.10) ten_s = t_s;
    }
    EXPECT_NEAR(ten_s - peak_s, row.time_s, 0.06 * row.time_s + 0.01)
        << row.torque_Nm << " Nm, " << row.ramp_N_per_s << " N/s";
  }
}

TEST(VehiclePlant, MacroSlipPullsTheEngineDownInOverrunAndFlaresInDrive) {
  for (const double sign : {-1.0, 1.0}) {
    VehiclePlant plant(bare());
    plant.settle(130.0 * 2.25 * 0.30 / 5.4, 2.25, 0.0);
    DrivelineInput input = overrun(-sign * 30.0, 0.8 * peak_force_N(30.0));
    for (int i = 0; i < 1000; ++i) plant.step(input, 5e-4);
    EXPECT_GT(sign * plant.output().slip_share, 0.10);
    EXPECT_GT(sign * (plant.state().omega_p_rad_s - 130.0), 10.0);
    EXPECT_LT(plant.output().slip_power_W, 2000.0);
    EXPECT_GT(plant.output().slip_power_W, 300.0);
  }
}

TEST(VehiclePlant, HalfTheStepGivesTheSameMotion) {
  double omega[3] = {};
  int i = 0;
  for (const double step_s : {1e-3, 5e-4, 1.25e-4}) {
    VehiclePlant plant(scenario());
    plant.settle(18.0, 2.25, 0.0);
    for (double t = 0.0; t < 2.0 - 1e-9; t += step_s) {
      plant.step(overrun(35.0, 2600.0 - 300.0 * t), step_s);
    }
    omega[i++] = plant.state().omega_p_rad_s;
  }
  EXPECT_NEAR(omega[0], omega[2], 5e-3);
  EXPECT_NEAR(omega[1], omega[2], 2e-3);
}

TEST(VehiclePlant, StandsStillUnderTheBrakeWithoutNoise) {
  VehiclePlant plant(scenario());
  plant.settle(3.0, 0.405, 0.0);
  DrivelineInput input;
  input.secondary_force_N = 15'000.0;
  input.primary_force_N = 5000.0;
  input.brake_Nm = 300.0;
  for (int i = 0; i < 20'000; ++i) {
    plant.step(input, 1e-3);
    ASSERT_TRUE(plant.finite());
  }
  EXPECT_NEAR(plant.state().omega_s_rad_s, 0.0, 0.01);
  EXPECT_NEAR(plant.state().omega_p_rad_s, 0.0, 0.05);
  EXPECT_LT(std::abs(plant.output().slip_share), 0.01);
}

TEST(VehiclePlant, RatioMovesBetweenItsStopsWithForceRatioAndSpeed) {
  const auto seconds_to_overdrive = [](double omega_p) {
    VehicleScenario s = bare();
    s.body.mass_kg = 100e3;
    VehiclePlant plant(s);
    plant.settle(omega_p * 0.405 * 0.30 / 5.4, 0.405, 0.0);
    DrivelineInput input = overrun(0.0, 6000.0);
    input.engine_torque_Nm = 0.0;
    input.primary_force_N = 9000.0;
    double t_s = 0.0;
    while (plant.state().ratio < 1.0 && t_s < 60.0) {
      plant.step(input, 5e-4);
      t_s += 5e-4;
    }
    return t_s;
  };
  const double slow = seconds_to_overdrive(150.0);
  EXPECT_GT(slow, 0.3);
  EXPECT_LT(slow, 4.0);
  VehiclePlant plant(bare());
  plant.settle(20.0, 2.25, 0.0);
  for (int i = 0; i < 2000; ++i) plant.step(overrun(30.0, 6000.0), 5e-4);
  EXPECT_EQ(plant.state().ratio, 2.25);  // pushed against its stop
  DrivelineInput input = overrun(30.0, 6000.0);
  input.primary_force_N = 1000.0;
  for (int i = 0; i < 40'000; ++i) plant.step(input, 5e-4);
  EXPECT_EQ(plant.state().ratio, 0.405);
}

TEST(VehiclePlant, DeformationOfEitherSignShowsAsSlip) {
  for (const double c : {1.8e-6, -1.8e-6}) {
    VehicleScenario s = bare();
    s.variator.deformation_per_N = c;
    VehiclePlant plant(s);
    plant.settle(20.0, 2.25, 0.0);
    DrivelineInput input = overrun(0.0, 5000.0);
    input.engine_torque_Nm = 0.0;
    for (int i = 0; i < 4000; ++i) plant.step(input, 5e-4);
    const double measured = 1.0 - plant.state().omega_s_rad_s / plant.state().omega_p_rad_s / 2.25;
    EXPECT_NEAR(measured, 5000.0 * c, 2e-5);
  }
}

TEST(VehiclePlant, FrictionFollowsTemperatureRatioAndWear) {
  VehicleScenario s = bare();
  VehiclePlant plant(s);
  plant.settle(20.0, 2.25, 0.0);
  DrivelineInput input = overrun(10.0, 3000.0);
  plant.step(input, 5e-4);
  EXPECT_NEAR(plant.output().mu_max, 0.105, 1e-12);
  input.oil_degC = 30.0;
  plant.step(input, 5e-4);
  EXPECT_NEAR(plant.output().mu_max, 0.105 * 1.05, 1e-12);
  input.wear = 0.1;
  plant.step(input, 5e-4);
  EXPECT_NEAR(plant.output().mu_max, 0.105 * 1.05 * 0.9, 1e-12);
  plant.settle(5.0, 0.405, 0.0);
  input = overrun(10.0, 3000.0);
  input.primary_force_N = 100.0;
  plant.step(input, 5e-4);
  EXPECT_NEAR(plant.output().mu_max, 0.105 * 1.03, 1e-12);
  EXPECT_NEAR(plant.output().peak_slip_share, 0.035, 1e-12);
}

TEST(HydraulicActuator, DeadTimeThenLagThenFloor) {
  HydraulicParameters h = scenario().hydraulics;
  h.lag_s = 0.1;
  h.dead_time_s = 0.05;
  HydraulicActuator actuator(h, 5e-4);
  actuator.settle(1e6);
  double t_s = 0.0;
  while (t_s < 0.05 - 1e-9) {
    EXPECT_NEAR(actuator.step(2e6, 1.0), 1e6, 1e-3);
    t_s += 5e-4;
  }
  while (t_s < 0.15 - 1e-9) {
    actuator.step(2e6, 1.0);
    t_s += 5e-4;
  }
  EXPECT_NEAR(actuator.pressure_Pa(), 1e6 + 1e6 * (1.0 - std::exp(-1.0)), 1e4);
  for (int i = 0; i < 10'000; ++i) actuator.step(-5e6, 3.0);
  EXPECT_NEAR(actuator.pressure_Pa(), 2e4, 1.0);
}

TEST(CoulombPlay, LagsBehindInEitherDirection) {
  CoulombPlay play;
  EXPECT_EQ(play.step(1000.0, 30.0), 1000.0);
  EXPECT_EQ(play.step(900.0, 30.0), 930.0);  // falling: the friction holds the force up
  EXPECT_EQ(play.step(940.0, 30.0), 930.0);
  EXPECT_EQ(play.step(1000.0, 30.0), 970.0);
}

TEST(VehicleEngine, CutsFuelInOverrunAndIdlesBelow) {
  VehicleEngine engine(scenario().engine);
  double torque = 0.0;
  for (int i = 0; i < 2000; ++i) torque = engine.step(0.0, 150.0, 0.0, 5e-4);
  EXPECT_TRUE(engine.fuel_cut());
  EXPECT_NEAR(torque, -33.5, 0.01);
  EXPECT_NEAR(engine.reported_torque_Nm(), -33.0, 0.01);
  for (int i = 0; i < 2000; ++i) torque = engine.step(0.0, 104.0, 0.0, 5e-4);
  EXPECT_TRUE(engine.fuel_cut());  // hysteresis
  for (int i = 0; i < 2000; ++i) torque = engine.step(0.0, 70.0, 0.0, 5e-4);
  EXPECT_FALSE(engine.fuel_cut());
  EXPECT_GT(torque, 5.0);  // lifts itself to idle
}

TEST(VehicleEngine, StallsAndStartsAgain) {
  VehicleEngine engine(scenario().engine);
  engine.step(0.0, 80.0, 0.0, 5e-4);
  engine.step(0.0, 40.0, 0.0, 5e-4);
  EXPECT_FALSE(engine.running());
  EXPECT_EQ(engine.stalls(), 1);
  double torque = 0.0;
  for (int i = 0; i < 6000; ++i) torque = engine.step(0.0, 60.0, 0.0, 5e-4);
  EXPECT_TRUE(engine.running());
  EXPECT_GT(torque, 0.0);
}

}  // namespace
}  // namespace beltgrip::sim
