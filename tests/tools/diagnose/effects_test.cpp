// The table of effects is the only list of them: each row is taken by model files and by both kinds
// of scenario, moves both simulated machines, and is fitted by diagnose.
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "daemon/core/config/options/config_model.h"
#include "estimator/physics/machine_effects.h"
#include "tools/diagnose/model/effects/effect.h"
#include "tools/sim/bus.h"
#include "tools/sim/configuration.h"
#include "tools/sim/rig_scenario.h"
#include "tools/sim/rig_simulation.h"
#include "tools/sim/vehicle_scenario.h"
#include "tools/sim/vehicle_simulation.h"

namespace beltgrip::test {
namespace {

using estimator::EffectRow;

std::string name_of(const EffectRow& row) {
  return std::string(row.id) + "." + std::string(row.parameter);
}

// Each role that moves something, or none.
std::vector<std::string> roles_of(const EffectRow& row) {
  if (row.value != nullptr) return {""};
  std::vector<std::string> out;
  for (const estimator::EffectRole& each : row.roles) out.emplace_back(each.role);
  return out;
}

std::string section_of(const EffectRow& row, const std::string& role, double value) {
  return "[effects." + std::string(row.id) + "]\n" + std::string(row.parameter) + " = " +
         std::to_string(value) + "\n" + (role.empty() ? "" : "role = \"" + role + "\"\n");
}

// Large enough to be seen within seconds; of wear, the step that begins with experiment 1.
double large(const EffectRow& row) {
  return name_of(row) == "friction_shape.peak_slip_percent" ? 2.5 : 4.0 * row.typical;
}

std::vector<can::StampedFrame> frames(sim::Simulation& simulation, sim::Bus bus) {
  std::vector<can::StampedFrame> out;
  while (!simulation.finished() && simulation.now_ns() < 6'000'000'000) {
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

// From just above slip to beyond the peak, cold, at one end stop.
std::vector<can::StampedFrame> rig(const std::string& effect, bool low) {
  std::vector<sim::ScenarioLayer> layers{
      {"machine",
       "[run]\noil_degC = 60\n[driveline]\nprimary_speed_rad_s = 150\nprimary_torque_Nm = 20\n"
       "[clamp]\nstart_force_N = 4000\nramp_N_per_s = 1000\n"}};
  if (low) layers.push_back(sim::setting_layer("variator.ratio=0.5"));
  layers.push_back({"effect", effect});
  sim::RigScenarioResult read = sim::parse_rig_scenario(layers);
  EXPECT_TRUE(read.errors.empty()) << read.errors.front();
  read.scenario.experiment = 1;
  sim::RigSimulation simulation(read.scenario);
  return frames(simulation, {sim::rig_database(), sim::kRigBus, read.scenario, 1});
}

std::vector<can::StampedFrame> car(const std::string& effect, bool low) {
  std::vector<sim::ScenarioLayer> layers{{"effect", effect}};
  sim::VehicleScenarioResult read =
      sim::shipped_vehicle_scenario(low ? "coast-low" : "coast-overdrive", layers);
  EXPECT_TRUE(read.errors.empty()) << read.errors.front();
  read.scenario.experiment = 1;
  read.scenario.hydraulics.oil_start_degC = read.scenario.hydraulics.oil_end_degC = 60.0;
  sim::VehicleSimulation simulation(read.scenario, 1);
  return frames(simulation, {sim::vehicle_database(), sim::kVehicleBus, read.scenario, 1});
}

// Parameters that tell when, not how much, or that only a belt beyond its peak shows: a car that
// nobody asks for less force stays below.
const std::set<std::string> kNoSize{"wear.at"};
const std::set<std::string> kBeyondThePeak{"friction_shape.fall_per_percent"};

TEST(EffectTable, NamesEachParameterOnce) {
  std::set<std::string> names;
  for (const EffectRow& row : estimator::effect_rows()) {
    EXPECT_TRUE(names.insert(name_of(row)).second) << name_of(row);
    EXPECT_EQ(row.typical == 0.0, kNoSize.contains(name_of(row))) << name_of(row);
    EXPECT_FALSE(row.equation.empty() || row.acts_on.empty() || row.depends_on.empty());
    EXPECT_LE(row.low, row.high);
  }
}

TEST(EffectTable, IsWhatModelFilesTake) {
  for (const EffectRow& row : estimator::effect_rows()) {
    for (const std::string& role : roles_of(row)) {
      const daemon::ModelFile model =
          daemon::parse_model(section_of(row, role, 0.25), "model.toml", {});
      const estimator::MachineEffects machine = daemon::machine_effects(model);
      EXPECT_EQ(machine.*value_of(row, role), 0.25) << name_of(row) << " " << role;
    }
  }
}

TEST(EffectTable, IsWhatDiagnoseFits) {
  const auto rows = diagnose::effect_rows();
  auto fitted = rows.begin();
  for (const EffectRow& row : estimator::effect_rows()) {
    if (row.typical == 0.0) continue;
    ASSERT_NE(fitted, rows.end());
    EXPECT_EQ(name_of(*fitted), name_of(row));
    // The ripple is found in the order spectrum instead.
    EXPECT_EQ(fitted->apply == nullptr, row.id == "speed_ripple") << name_of(row);
    ++fitted;
  }
  EXPECT_EQ(fitted, rows.end());
}

TEST(EffectTable, MovesBothSimulatedMachines) {
  for (const bool low : {false, true}) {
    const auto rig_without = rig("", low);
    const auto car_without = car("", low);
    EXPECT_TRUE(same(rig_without, rig("", low)));
    for (const EffectRow& row : estimator::effect_rows()) {
      const std::string name = name_of(row);
      const bool at_low_only = name == "end_stop_ratio.low" || row.id == "friction_ratio";
      const bool at_overdrive_only =
          name == "end_stop_ratio.overdrive" || name == "friction_shape.peak_slip_percent";
      if (kNoSize.contains(name) || (low ? at_overdrive_only : at_low_only)) continue;
      for (const std::string& role : roles_of(row)) {
        const std::string effect = section_of(row, role, large(row));
        // The clamping force falls on a rig, and with it what would press the belt off overdrive.
        if (low || row.id != "ratio_creep") {
          EXPECT_FALSE(same(rig_without, rig(effect, low))) << "rig: " << effect;
        }
        if (kBeyondThePeak.contains(name)) continue;
        EXPECT_FALSE(same(car_without, car(effect, low))) << "car: " << effect;
      }
    }
  }
}

TEST(EffectTable, ARoleThatIsMissingIsNamed) {
  const auto result = sim::parse_rig_scenario(
      {{"mine.toml", "[effects.channel_skew]\ndelay_s = 0.02\nrole = \"oil\"\n"}});
  ASSERT_EQ(result.errors.size(), 1u);
  EXPECT_EQ(result.errors[0],
            "mine.toml:2: effects.channel_skew.delay_s: found role = \"oil\", expected one of "
            "primary_speed, secondary_speed, secondary_pressure, primary_torque, engine_torque");
}

}  // namespace
}  // namespace beltgrip::test
