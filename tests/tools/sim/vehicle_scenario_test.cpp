// Scenario files of the vehicle: shipped ones are right, every mistake is named.
#include "tools/sim/vehicle_scenario.h"

#include <gtest/gtest.h>

#include "tools/sim/resources.h"

namespace beltgrip::sim {
namespace {

TEST(VehicleScenario, ShippedOnesAreRight) {
  int scenarios = 0;
  for (const std::string_view name : resource_names()) {
    if (!name.ends_with(".toml") || !is_vehicle_scenario(*resource(name))) continue;
    ++scenarios;
    const auto result = shipped_vehicle_scenario(name.substr(0, name.size() - 5));
    EXPECT_TRUE(result.errors.empty()) << result.errors.front();
    EXPECT_EQ(result.scenario.name + ".toml", name);
  }
  EXPECT_EQ(scenarios, 11);  // those of tools/COMMANDS.md and the demo's
}

TEST(VehicleScenario, LaterLayersWinAndRowsAreReplaced) {
  const auto result = parse_vehicle_scenario(
      {{"mine.toml", "[[driver.step]]\nat_s = 1\nbrake_m_s2 = 2\n[belt]\nmu_max = 0.09\n"},
       setting_layer("belt.mu_max=0.08"),
       setting_layer("controller.lockup_above_km_h=36")});
  ASSERT_TRUE(result.errors.empty()) << result.errors.front();
  ASSERT_EQ(result.scenario.driver.steps.size(), 1u);
  EXPECT_EQ(result.scenario.driver.steps[0].brake_m_s2, 2.0);
  EXPECT_EQ(result.scenario.belt.overdrive.mu_max, 0.08);
  EXPECT_NEAR(result.scenario.tcu.lockup_above_m_s, 10.0, 1e-12);
}

struct VehicleMistake {
  const char* text;
  const char* place;   // start of the message
  const char* reason;  // part of it
};

class VehicleScenarioMistake : public testing::TestWithParam<VehicleMistake> {};

TEST_P(VehicleScenarioMistake, IsNamed) {
  const auto result = parse_vehicle_scenario({{"mine.toml", GetParam().text}});
  ASSERT_FALSE(result.errors.empty());
  EXPECT_TRUE(result.errors[0].starts_with(GetParam().place)) << result.errors[0];
  EXPECT_NE(result.errors[0].find(GetParam().reason), std::string::npos) << result.errors[0];
}

INSTANTIATE_TEST_SUITE_P(
    All, VehicleScenarioMistake,
    testing::Values(
        VehicleMistake{"[engine]\ninertia = 3\n", "mine.toml:2: engine.inertia: ", "not a key"},
        VehicleMistake{"[motor]\nx = 3\n", "mine.toml:1: motor: ", "not a key"},
        VehicleMistake{"engine = 3\n", "mine.toml:1: engine: ", "section"},
        VehicleMistake{"plant = \"boat\"\n", "mine.toml:1: plant: found", "vehicle"},
        VehicleMistake{"[engine]\ninertia_kg_m2 = -0.1\n",
                       "mine.toml:2: engine.inertia_kg_m2: found -0.1", "positive inertia"},
        VehicleMistake{"[variator]\nprimary_inertia_kg_m2 = 0\n",
                       "mine.toml:2: variator.primary_inertia_kg_m2: found 0", "positive inertia"},
        VehicleMistake{"[variator]\nbelt_length_m = 0.3\n",
                       "mine.toml:2: variator.belt_length_m: found 0.3", "too short"},
        VehicleMistake{"[variator]\ncentre_distance_m = 0.1\n",
                       "coast-overdrive.toml:", "variator.ratio_low: found 0.405: out of reach"},
        VehicleMistake{"[belt]\nmu_max = nan\n", "mine.toml:2: belt.mu_max: found nan", "friction"},
        VehicleMistake{"[belt]\ncurve = \"sine\"\n", "mine.toml:2: belt.curve: ", "tanh_fall"},
        VehicleMistake{"name = 3\n", "mine.toml:1: name: found 3", "text"},
        VehicleMistake{"[engine]\nstall_rad_s = 90\n", "mine.toml:2: engine.stall_rad_s: found 90",
                       "never idle"},
        VehicleMistake{"[hydraulics]\npressure_max_Pa = 1e5\npressure_floor_Pa = 2e5\n",
                       "mine.toml:3: hydraulics.pressure_floor_Pa: ", "less than"},
        VehicleMistake{"[[driver.step]]\nat_s = 5\n[[driver.step]]\nat_s = 4\n",
                       "mine.toml:3: driver.step: found at_s = 4 after 5", "order"},
        VehicleMistake{"[[fault]]\nkind = \"brake\"\n[[fault]]\nkind = \"signal_bias\"\n"
                       "channel = \"PrimarySped\"\n",
                       "mine.toml:3: fault: found channel = \"PrimarySped\"", "PrimarySpeed, "},
        VehicleMistake{"[[fault]]\nkind = \"frame_loss\"\nchannel = \"PrimarySpeed\"\n",
                       "mine.toml:1: fault: found channel", "TCU_Speed"},
        VehicleMistake{"[[fault]]\nkind = \"brake\"\nchannel = \"TCU_Speed\"\n",
                       "mine.toml:1: fault: found channel", "brake has none"},
        VehicleMistake{"[[driver.step]]\nat = 5\n", "mine.toml:2: driver.step.at: ", "not a key"},
        VehicleMistake{"[driver]\nstep = 3\n", "mine.toml:2: driver.step: found 3",
                       "[[driver.step]]"},
        VehicleMistake{"[[fault]]\nkind = \"meteor\"\n", "mine.toml:2: fault.kind: ", "abs"},
        VehicleMistake{"[[fault]]\nafter_request = 1\n",
                       "mine.toml:2: fault.after_request: found 1", "true or false"},
        VehicleMistake{"[run]\nstep_s = 0.01\n", "mine.toml:2: run.step_s: found 0.01", "1 kHz"},
        VehicleMistake{"x = [1,\n", "mine.toml:", "not TOML"}));

}  // namespace
}  // namespace beltgrip::sim
