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

struct Mistake {
  const char* text;
  const char* place;   // start of the message
  const char* reason;  // part of it
};

class VehicleScenarioMistake : public testing::TestWithParam<Mistake> {};

TEST_P(VehicleScenarioMistake, IsNamed) {
  const auto result = parse_vehicle_scenario({{"mine.toml", GetParam().text}});
  ASSERT_FALSE(result.errors.empty());
  EXPECT_TRUE(result.errors[0].starts_with(GetParam().place)) << result.errors[0];
  EXPECT_NE(result.errors[0].find(GetParam().reason), std::string::npos) << result.errors[0];
}

INSTANTIATE_TEST_SUITE_P(
    All, VehicleScenarioMistake,
    testing::Values(
        Mistake{"[engine]\ninertia = 3\n", "mine.toml:2: engine.inertia: ", "not a key"},
        Mistake{"[motor]\nx = 3\n", "mine.toml:1: motor: ", "not a key"},
        Mistake{"engine = 3\n", "mine.toml:1: engine: ", "section"},
        Mistake{"plant = \"boat\"\n", "mine.toml:1: plant: found", "vehicle"},
        Mistake{"[engine]\ninertia_kg_m2 = -0.1\n", "mine.toml:2: engine.inertia_kg_m2: found -0.1",
                "positive inertia"},
        Mistake{"[variator]\nprimary_inertia_kg_m2 = 0\n",
                "mine.toml:2: variator.primary_inertia_kg_m2: found 0", "positive inertia"},
        Mistake{"[variator]\nbelt_length_m = 0.3\n",
                "mine.toml:2: variator.belt_length_m: found 0.3", "too short"},
        Mistake{"[variator]\ncentre_distance_m = 0.1\n",
                "coast-overdrive.toml:", "variator.ratio_low: found 0.405: out of reach"},
        Mistake{"[belt]\nmu_max = nan\n", "mine.toml:2: belt.mu_max: found nan", "friction"},
        Mistake{"[belt]\ncurve = \"sine\"\n", "mine.toml:2: belt.curve: ", "tanh_fall"},
        Mistake{"name = 3\n", "mine.toml:1: name: found 3", "text"},
        Mistake{"[engine]\nstall_rad_s = 90\n", "mine.toml:2: engine.stall_rad_s: found 90",
                "never idle"},
        Mistake{"[hydraulics]\npressure_max_Pa = 1e5\npressure_floor_Pa = 2e5\n",
                "mine.toml:3: hydraulics.pressure_floor_Pa: ", "less than"},
        Mistake{"[[driver.step]]\nat_s = 5\n[[driver.step]]\nat_s = 4\n",
                "mine.toml:3: driver.step: found at_s = 4 after 5", "order"},
        Mistake{"[[fault]]\nkind = \"brake\"\n[[fault]]\nkind = \"signal_bias\"\n"
                "channel = \"PrimarySped\"\n",
                "mine.toml:3: fault: found channel = \"PrimarySped\"", "PrimarySpeed, "},
        Mistake{"[[fault]]\nkind = \"frame_loss\"\nchannel = \"PrimarySpeed\"\n",
                "mine.toml:1: fault: found channel", "TCU_Speed"},
        Mistake{"[[fault]]\nkind = \"brake\"\nchannel = \"TCU_Speed\"\n",
                "mine.toml:1: fault: found channel", "brake has none"},
        Mistake{"[[driver.step]]\nat = 5\n", "mine.toml:2: driver.step.at: ", "not a key"},
        Mistake{"[driver]\nstep = 3\n", "mine.toml:2: driver.step: found 3", "[[driver.step]]"},
        Mistake{"[[fault]]\nkind = \"meteor\"\n", "mine.toml:2: fault.kind: ", "abs"},
        Mistake{"[[fault]]\nafter_request = 1\n", "mine.toml:2: fault.after_request: found 1",
                "true or false"},
        Mistake{"[run]\nstep_s = 0.01\n", "mine.toml:2: run.step_s: found 0.01", "1 kHz"},
        Mistake{"x = [1,\n", "mine.toml:", "not TOML"}));

}  // namespace
}  // namespace beltgrip::sim
