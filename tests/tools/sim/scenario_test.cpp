// Scenario files: every mistake is named with file, line, key and reason; settings go on top.
#include "tools/sim/rig_scenario.h"

#include <gtest/gtest.h>

#include "tools/sim/resources.h"
#include "tools/sim/vehicle_scenario.h"

namespace beltgrip::sim {
namespace {

TEST(Scenario, ShippedOnesAreRight) {
  int scenarios = 0;
  for (const std::string_view name : resource_names()) {
    if (!name.ends_with(".toml") || is_vehicle_scenario(*resource(name))) continue;
    ++scenarios;
    const auto result = parse_rig_scenario({{std::string(name), std::string(*resource(name))}});
    EXPECT_TRUE(result.errors.empty()) << name << ": " << result.errors.front();
    EXPECT_EQ(result.scenario.name + ".toml", name);
  }
  EXPECT_GE(scenarios, 1);
}

TEST(Scenario, LaterLayersWin) {
  const auto result =
      parse_rig_scenario({{"mine.toml", "belt = \"worn\"\n[clamp]\nramp_N_per_s = 100\n"},
                          setting_layer("clamp.ramp_N_per_s=50"),
                          setting_layer("belts.worn.mu_max=0.09"),
                          setting_layer("operator.action=hold"),
                          setting_layer("variator.half_wedge_angle_deg=12")});
  ASSERT_TRUE(result.errors.empty()) << result.errors.front();
  EXPECT_EQ(result.scenario.belt, "worn");
  EXPECT_EQ(result.scenario.ramp_N_per_s, 50.0);
  EXPECT_EQ(result.scenario.friction().mu_max, 0.09);
  EXPECT_EQ(result.scenario.action, OperatorAction::kHold);
  EXPECT_NEAR(result.scenario.variator.half_wedge_angle_rad, 0.20943951, 1e-8);
}

struct Mistake {
  const char* text;
  const char* place;   // start of the message
  const char* reason;  // part of it
};

class ScenarioMistake : public testing::TestWithParam<Mistake> {};

TEST_P(ScenarioMistake, IsNamed) {
  const auto result = parse_rig_scenario({{"mine.toml", GetParam().text}});
  ASSERT_EQ(result.errors.size(), 1u);
  EXPECT_TRUE(result.errors[0].starts_with(GetParam().place)) << result.errors[0];
  EXPECT_NE(result.errors[0].find(GetParam().reason), std::string::npos) << result.errors[0];
}

INSTANTIATE_TEST_SUITE_P(
    All, ScenarioMistake,
    testing::Values(
        Mistake{"[clamp]\nramp = 3\n", "mine.toml:2: clamp.ramp: ", "not a key"},
        Mistake{"[klamp]\nramp = 3\n", "mine.toml:1: klamp: ", "not a key"},
        Mistake{"seed = 3\n", "mine.toml:1: seed: ", "not a key"},
        Mistake{"clamp = 3\n", "mine.toml:1: clamp: ", "section"},
        Mistake{"belts = 3\n", "mine.toml:1: belts: ", "section"},
        Mistake{"[belts]\nold = 3\n", "mine.toml:2: belts.old: ", "section"},
        Mistake{"[belts.new]\nmu = 0.1\n", "mine.toml:2: belts.new.mu: ", "not a key"},
        Mistake{"[belts.new]\nmu_max = 0\n", "mine.toml:2: belts.new.mu_max: found 0", "friction"},
        Mistake{"[belts.new]\ncurve = \"sine\"\n", "mine.toml:2: belts.new.curve: ", "tanh_fall"},
        Mistake{"[belts.new]\ncurve = \"broad_top\"\nrise_per_percent = 0.06\n",
                "mine.toml:1: belts.new: found rise_per_percent = 0.06", "more than mu_max"},
        Mistake{"belt = \"gold\"\n", "mine.toml:1: belt: found \"gold\"", "new, worn"},
        Mistake{"name = 3\n", "mine.toml:1: name: found 3", "text"},
        Mistake{"\n[driveline]\nsecondary_inertia_kg_m2 = -0.5\n",
                "mine.toml:3: driveline.secondary_inertia_kg_m2: found -0.5", "positive inertia"},
        Mistake{"[driveline]\nprimary_speed_rad_s = nan\n",
                "mine.toml:2: driveline.primary_speed_rad_s: found nan", "number from 10 to 1000"},
        Mistake{"[driveline]\nprimary_speed_rad_s = \"fast\"\n",
                "mine.toml:2: driveline.primary_speed_rad_s: ", "number"},
        Mistake{"[driveline]\nprimary_speed_rad_s = true\n",
                "mine.toml:2: driveline.primary_speed_rad_s: found true", "number"},
        Mistake{"[variator]\nbelt_length_m = 0.3\n",
                "mine.toml:2: variator.belt_length_m: found 0.3", "too short"},
        Mistake{"[variator]\ncentre_distance_m = 0.1\n", "paper-rig.toml:", "out of reach"},
        Mistake{"[clamp]\nstart_force_N = 2900\n", "mine.toml:2: clamp.start_force_N: found 2900",
                "slips from the start"},
        Mistake{"[variator]\nsecondary_spring_force_N = 6000\n", "paper-rig.toml:", "spring force"},
        Mistake{"[sensors]\nframe_jitter_s = 0.002\n",
                "mine.toml:2: sensors.frame_jitter_s: found 0.002", "overtake"},
        Mistake{"[run]\nstep_s = 0.01\n", "mine.toml:2: run.step_s: found 0.01", "1 kHz"},
        Mistake{"[belt]\nmu_max = 0.1\n", "mine.toml:1: belt: ", "plant = \"vehicle\""},
        Mistake{"[variator]\nratio_low = 0.4\n", "mine.toml:2: variator.ratio_low: ", "not a key"},
        Mistake{"[[fault]]\nkind = \"brake\"\n", "mine.toml:1: fault: found kind = \"brake\"",
                "a rig has no driver"},
        Mistake{"[[fault]]\nkind = \"signal_bias\"\nafter_request = true\n",
                "mine.toml:1: fault: found after_request", "nobody asks a rig"},
        Mistake{"[[fault]]\nkind = \"signal_bias\"\nchannel = \"EngineSpeed\"\n",
                "mine.toml:1: fault: found channel = \"EngineSpeed\"", "PrimarySpeed, "},
        Mistake{"x = [1,\n", "mine.toml:", "not TOML"}));

TEST(Scenario, AllMistakesAreListed) {
  const auto result = parse_rig_scenario(
      {{"mine.toml", "x = 1\ny = 2\n[run]\nstep_s = 0\n"}, setting_layer("z.z=3")});
  EXPECT_EQ(result.errors.size(), 4u);
  EXPECT_EQ(result.errors.back().substr(0, 14), "--set z.z=3: z");
}

}  // namespace
}  // namespace beltgrip::sim
