// Configurations out of several files, and flags that a DBC tells by name: from the files to the
// value that a frame brings.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "daemon/core/config/load/load_config.h"
#include "daemon/core/config/options/config.h"
#include "daemon/core/input/input_monitor.h"
#include "tests/daemon/test_vehicle.h"
#include "tests/support/program.h"

namespace beltgrip::daemon {
namespace {

class Include : public testing::Test {
 protected:
  Include() {
    place.write("vehicle.dbc", std::string(test::kVehicleDbc) +
                                   "VAL_ 259 ExperimentActive 0 \"Open\" 1 \"Slipping\" 2 "
                                   "\"Locked\" 3 \"SNA\" ;\n");
    std::string base = test::kVehicleToml;
    place.write("base.toml", base);
    const std::string line = "experiment_active = \"Flags.ExperimentActive\"\n";
    place.write("alone.toml", base.erase(base.find(line), line.size()));  // the signal has one role
    std::filesystem::create_directories(place.path("more/inner"));
  }
  ConfigResult load(const std::string& toml) {
    place.write("main.toml", toml);
    return load_config(place.path("main.toml"));
  }
  std::string error(const std::string& toml, int exit_code = 78) {
    const ConfigResult result = load(toml);
    EXPECT_FALSE(result.config.has_value());
    EXPECT_EQ(result.exit_code(), exit_code);
    EXPECT_EQ(result.errors.size(), 1U);
    return result.errors.empty() ? "" : result.errors[0].text;
  }
  // The configuration with the flag as given, and what a frame with this raw value brings: 0, 1, or
  // -1 where it is refused.
  int flag(const std::string& value, std::uint8_t raw) {
    const ConfigResult result =
        load("include = [\"alone.toml\"]\n[signals]\nlockup_closed = " + value);
    EXPECT_TRUE(result.config.has_value()) << (result.errors.empty() ? "" : result.errors[0].text);
    if (!result.config) return -2;
    InputMonitor inputs(*result.config);
    FaultSet faults;
    RxFrame frame;
    frame.t = MonoTime::of_ns(1);
    frame.frame.id = {0x103, false};
    frame.frame.length = 2;
    frame.frame.data[0] = raw;
    inputs.on_frame(frame, faults);
    const SignalHistory& history = inputs.history(Role::kLockupClosed);
    EXPECT_EQ(faults.has(Fault::kInputRange), history.empty());
    return history.empty() ? -1 : static_cast<int>(history.newest_value());
  }
  test::Workplace place;
};

TEST_F(Include, AFolderOfConfigurationsByName) {
  std::filesystem::create_directories(place.path("conf.d"));
  const std::string toml = "include = [\"base.toml\", \"conf.d/*.toml\"]\n";
  ASSERT_TRUE(load(toml).config.has_value());  // none is fine
  place.write("conf.d/20-belt.toml", "[variator]\nratio_low = 0.42\n");
  place.write("conf.d/10-belt.toml", "[variator]\nratio_low = 0.41\nsafety_factor = 1.4\n");
  place.write("conf.d/90-belt.toml.bak", "no configuration");
  place.write("conf.d/.90-belt.toml", "no configuration");
  const ConfigResult result = load(toml);
  ASSERT_TRUE(result.config.has_value()) << (result.errors.empty() ? "" : result.errors[0].text);
  EXPECT_EQ(result.config->variator.ratio_low, 0.42);
  const std::vector<std::string>& files = result.config->files;
  for (const char* name : {"conf.d/10-belt.toml", "conf.d/20-belt.toml"}) {
    EXPECT_NE(std::find(files.begin(), files.end(), place.path(name)), files.end()) << name;
  }
  place.write("conf.d/30-belt.toml", "[variator]\nratio_low = \"x\"\n");
  EXPECT_NE(error(toml).find("conf.d/30-belt.toml:2"), std::string::npos) << error(toml);
  EXPECT_NE(error("include = [\"base.toml\", \"missing.d/*.toml\"]\n", 66)
                .find("\"missing.d/*.toml\", whose folder cannot be read"),
            std::string::npos);
  place.write("conf.d/30-belt.toml", "include = [\"*.toml\"]\n");
  EXPECT_NE(error(toml).find("which includes this file"), std::string::npos) << error(toml);
}

TEST_F(Include, LaterKeysWin) {
  place.write("more/belt.toml", "[variator]\nsafety_factor = 1.5\nratio_low = 0.41\n");
  place.write("more/other.toml", "[variator]\nratio_low = 0.42\n[experiment]\nstop = \"peak\"\n");
  const ConfigResult result = load(
      "include = [\"base.toml\", \"more/belt.toml\", \"more/other.toml\"]\n"
      "[variator]\nratio_overdrive = 2.3\nsafety_factor = 1.7\n");
  ASSERT_TRUE(result.config.has_value()) << result.errors[0].text;
  EXPECT_EQ(result.config->variator.ratio_low, 0.42);
  EXPECT_EQ(result.config->variator.ratio_overdrive, 2.3);
  EXPECT_EQ(result.config->variator.safety_factor, 1.7);
  EXPECT_EQ(result.config->trigger, Trigger::kAlways);  // base.toml's stays
  ASSERT_EQ(result.config->roles.size(), 5U);
  // Where each came from.
  ASSERT_EQ(result.warnings.size(), 2U);
  EXPECT_EQ(result.warnings[0], place.path("more/other.toml") +
                                    ":2: variator.ratio_low takes the place of " +
                                    place.path("more/belt.toml") + ":3");
  EXPECT_EQ(result.warnings[1], place.path("main.toml") +
                                    ":4: variator.safety_factor takes the place of " +
                                    place.path("more/belt.toml") + ":2");
  EXPECT_EQ(result.config->files.size(), 5U);  // the DBC too: no tool writes over one
}

// Sections and keys before, between and behind those of the files before.
TEST_F(Include, KeysOfManyFilesInterleave) {
  place.write("a.toml",
              "include = [\"base.toml\"]\n[variator]\nratio_low = 0.41\nsafety_factor = 1.4\n");
  place.write("b.toml",
              "[variator]\nprimary_inertia_kg_m2 = 0.2\nratio_low = 0.42\n"
              "secondary_spring_force_N = 501.0\n");
  place.write("c.toml",
              "[daemon]\nstate_dir = \"kept\"\n[variator]\nprimary_inertia_kg_m2 = 0.3\n"
              "ratio_overdrive = 2.3\n[estimator]\nsample_rate_hz = 250\n");
  const ConfigResult result = load("include = [\"a.toml\", \"b.toml\", \"c.toml\"]\n");
  ASSERT_TRUE(result.config.has_value()) << result.errors[0].text;
  EXPECT_EQ(result.config->variator.ratio_low, 0.42);
  EXPECT_EQ(result.config->variator.safety_factor, 1.4);
  EXPECT_EQ(result.config->variator.primary_inertia_kg_m2, 0.3);
  EXPECT_EQ(result.config->variator.secondary_spring_force_N, 501.0);
  EXPECT_EQ(result.config->variator.ratio_overdrive, 2.3);
  EXPECT_EQ(result.config->estimator.sample_rate_hz, 250.0);
  EXPECT_EQ(result.config->state_dir, "kept");
  EXPECT_EQ(result.config->roles.size(), 5U);
  EXPECT_EQ(result.warnings.size(), 2U);
}

// Time and memory follow what is read, and that is bounded.
TEST_F(Include, AllFilesTogetherAreOfABoundedSize) {
  place.write("large.toml", "#" + std::string(600000, ' ') + "\n");
  EXPECT_TRUE(load("include = [\"base.toml\", \"large.toml\"]\n").config.has_value());
  EXPECT_NE(error("include = [\"base.toml\", \"large.toml\", \"large.toml\"]\n")
                .find("large.toml:1: size: found more than 1 MiB with the files before it"),
            std::string::npos);
}

TEST_F(Include, PathsAreRelativeToTheirOwnFile) {
  place.write("more/inner/vehicle.dbc", test::kVehicleDbc);
  std::string toml = test::kVehicleToml;
  place.write("more/inner/car.toml", toml + "[daemon]\nstate_dir = \"kept\"\n");
  place.write("more/car.toml", "include = [\"inner/car.toml\"]\n");
  std::filesystem::remove(place.path("vehicle.dbc"));
  const ConfigResult result = load("include = [\"more/car.toml\"]\n");
  ASSERT_TRUE(result.config.has_value()) << result.errors[0].text;
  EXPECT_EQ(result.config->state_dir, "more/inner/kept");
  const std::string absolute = place.path("more/car.toml");
  EXPECT_TRUE(load("include = [\"" + absolute + "\"]\n").config.has_value());
}

TEST_F(Include, AnErrorNamesTheFileAndLineItStandsIn) {
  place.write("more/wrong.toml", "[variator]\n\nratio_low = \"x\"\n");
  EXPECT_TRUE(
      error("include = [\"base.toml\", \"more/wrong.toml\"]\n")
          .starts_with(place.path("more/wrong.toml") + ":3: variator.ratio_low: found \"x\""));
  place.write("more/wrong.toml", "[variator]\n\nratio_low = = 1\n");
  EXPECT_TRUE(error("include = [\"base.toml\", \"more/wrong.toml\"]\n")
                  .starts_with(place.path("more/wrong.toml") + ":3: syntax: "));
  EXPECT_TRUE(error("# one\n\ninclude = [\"none.toml\"]\n", 66)
                  .starts_with(place.path("main.toml") + ":3: include: found \"none.toml\" that "
                                                         "cannot be read"));
  EXPECT_NE(error("include = \"base.toml\"\n")
                .find(":1: include: found \"base.toml\", expected an "
                      "array"),
            std::string::npos);
  EXPECT_NE(error("include = [3]\n").find(":1: include: found 3"), std::string::npos);
}

TEST_F(Include, NoCircleAndNoDepthWithoutEnd) {
  EXPECT_NE(error("include = [\"main.toml\"]\n").find("circle"), std::string::npos);
  place.write("more/a.toml", "include = [\"../more/../more/b.toml\"]\n");
  place.write("more/b.toml", "\ninclude = [\"a.toml\"]\n");
  EXPECT_TRUE(error("include = [\"more/a.toml\"]\n").find("b.toml:2: include: found \"a.toml\"") !=
              std::string::npos);
  for (int i = 0; i < 20; ++i) {
    place.write("deep" + std::to_string(i) + ".toml",
                "include = [\"deep" + std::to_string(i + 1) + ".toml\"]\n");
  }
  EXPECT_NE(error("include = [\"deep0.toml\"]\n").find("within each other"), std::string::npos);
  // Many times two of the next: stops at a number, not after 2^8.
  for (int i = 0; i < 8; ++i) {
    const std::string next = "\"wide" + std::to_string(i + 1) + ".toml\"";
    place.write("wide" + std::to_string(i) + ".toml", "include = [" + next + ", " + next + "]\n");
  }
  place.write("wide8.toml", "");
  EXPECT_FALSE(load("include = [\"wide0.toml\"]\n").config.has_value());
  // The same file by two ways is no circle.
  place.write("more/c.toml", "include = [\"../base.toml\"]\n");
  EXPECT_TRUE(load("include = [\"base.toml\", \"more/c.toml\"]\n").config.has_value());
}

TEST_F(Include, AFlagIsWhatItsNameSays) {
  constexpr const char* kSignal = "{ signal = \"Flags.ExperimentActive\", ";
  const auto expect = [&](const std::string& rest, const std::array<int, 4>& wanted) {
    for (std::uint8_t raw = 0; raw < 4; ++raw) {
      EXPECT_EQ(flag(kSignal + rest, raw), wanted[raw]) << rest << " " << int{raw};
    }
  };
  expect("true_when = \"Locked\" }", {0, 0, 1, 0});
  expect("true_when = 2 }", {0, 0, 1, 0});
  expect("true_when = [\"Slipping\", 2] }", {0, 1, 1, 0});
  // role = scale * signal + offset
  expect("scale = 0.5 }", {0, -1, 1, -1});
  expect("scale = -1.0, offset = 1.0 }", {1, 0, -1, -1});
  expect("scale = 1.0, offset = -1.0 }", {-1, 0, 1, -1});
  expect("offset = 0.0 }", {0, 1, -1, -1});
}

TEST_F(Include, ANameThatNoValueHasIsAnError) {
  const auto of = [&](const std::string& role, const std::string& rest) {
    return error("include = [\"base.toml\"]\n[signals]\n" + role + " = { signal = \"" + rest);
  };
  EXPECT_NE(of("lockup_closed", "Flags.ExperimentActive\", true_when = \"Loked\" }")
                .find(":3: signals.lockup_closed.true_when: found \"Loked\", expected a text or a "
                      "number of the signal's value table; nearest is \"Locked\""),
            std::string::npos);
  EXPECT_NE(of("lockup_closed", "Flags.ExperimentActive\", true_when = 9 }").find("found 9"),
            std::string::npos);
  EXPECT_NE(
      of("lockup_closed", "Flags.ExperimentActive\", true_when = [] }").find("found an array"),
      std::string::npos);
  EXPECT_NE(of("lockup_closed", "Flags.Permitted\", true_when = \"Yes\" }").find("no value table"),
            std::string::npos);
  EXPECT_NE(of("lockup_closed", "Flags.Permitted\", true_when = 1, scale = 2.0 }")
                .find("beside true_when"),
            std::string::npos);
  EXPECT_NE(of("engine_speed", "Speeds.PrimarySpeed\", true_when = 1 }").find("is no flag"),
            std::string::npos);
}

// Set up wrongly, and found at the start rather than by a request that never comes.
TEST_F(Include, AFlagThatNeverChangesIsAnError) {
  constexpr const char* kWide =
      "BO_ 260 Wide: 8 ECU\n"
      " SG_ Byte : 0|8@1+ (1,0) [0|0] \"\" ECU\n"
      " SG_ Narrow : 8|8@1+ (1,0) [2|5] \"\" ECU\n"
      " SG_ Signed : 16|4@1- (1,0) [0|0] \"\" ECU\n"
      " SG_ Half : 24|2@1+ (0.5,0) [0|1] \"\" ECU\n"
      " SG_ Named : 32|2@1+ (1,0) [0|3] \"\" ECU\n"
      " SG_ Real : 32|32@1- (1,0) [0|0] \"\" ECU\n"
      "VAL_ 260 Named 0 \"Open\" 9 \"Locked\" ;\nSIG_VALTYPE_ 260 Real : 1;\n";
  place.write("vehicle.dbc", std::string(test::kVehicleDbc) + kWide);
  const auto loads = [&](const std::string& value) {
    return load("include = [\"base.toml\"]\n[signals]\nlockup_closed = " + value + "\n")
        .config.has_value();
  };
  const auto refused = [&](const std::string& value, const std::string& said) {
    const std::string text =
        error("include = [\"base.toml\"]\n[signals]\nlockup_closed = " + value + "\n");
    EXPECT_TRUE(text.starts_with(place.path("main.toml") + ":3: signals.lockup_closed")) << text;
    EXPECT_NE(text.find(said), std::string::npos) << value << ": " << text;
  };
  refused("{ signal = \"Flags.Permitted\", scale = 0.3 }", "found a flag that is never 1");
  refused("{ signal = \"Flags.Permitted\", offset = 1.0 }", "found a flag that is never 0");
  refused("{ signal = \"Wide.Byte\", offset = 0.5 }", "found a flag that is never 0");
  refused("\"Wide.Narrow\"", "found a flag that is never 0");
  refused("{ signal = \"Wide.Byte\", true_when = 256 }",
          "found 256, expected a raw value from 0 to 255");
  refused("{ signal = \"Wide.Signed\", true_when = -9 }",
          "found -9, expected a raw value from -8 to 7");
  refused("{ signal = \"Flags.Permitted\", true_when = [0, 1] }", "found a flag that is never 0");
  refused("{ signal = \"Wide.Narrow\", true_when = [2, 3, 4, 5] }", "found a flag that is never 0");
  refused("{ signal = \"Wide.Named\", true_when = \"Locked\" }", "found \"Locked\"");
  for (const char* good :
       {"\"Flags.Permitted\"", "\"Wide.Byte\"", "\"Wide.Half\"", "\"Wide.Real\"",
        "{ signal = \"Wide.Half\", scale = 2.0 }",
        "{ signal = \"Flags.Permitted\", scale = -1.0, offset = 1.0 }",
        "{ signal = \"Wide.Narrow\", offset = -3.0 }",
        "{ signal = \"Wide.Narrow\", true_when = [5, 3, 4] }",
        "{ signal = \"Wide.Narrow\", true_when = 200 }",  // beyond the range, and said to be good
        "{ signal = \"Wide.Byte\", true_when = [255, 0] }",
        "{ signal = \"Wide.Signed\", true_when = -8 }",
        "{ signal = \"Flags.Permitted\", true_when = 0 }"}) {
    EXPECT_TRUE(loads(good)) << good;
  }
}

}  // namespace
}  // namespace beltgrip::daemon
