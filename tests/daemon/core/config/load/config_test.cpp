// The configuration: every key at, below and beyond its range, of the wrong type, unknown, twice;
// roles, units and DBC files that do not fit; what is not there yet; the default file. Every error
// must name file, line and key, and all of them must be listed.
#include "daemon/core/config/options/config.h"
#include "can_dbc/text/number_text.h"
#include "daemon/core/config/load/load_config.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <numbers>

#include "daemon/core/config/options/config_options.h"
#include "tests/daemon/test_vehicle.h"

namespace beltgrip::daemon {
namespace {

using test::TemporaryDirectory;

class ConfigTest : public testing::Test {
 protected:
  ConfigTest() { directory_.write("vehicle.dbc", test::kVehicleDbc); }

  ConfigResult load(const std::string& toml) {
    return load_config(directory_.write("beltgripd.toml", toml));
  }
  // The vehicle's configuration with lines of a section added to it.
  static std::string with(const std::string& section, const std::string& lines) {
    std::string toml = test::kVehicleToml;
    const std::string header = "[" + section + "]\n";
    const std::size_t at = toml.find(header);
    if (at == std::string::npos) return toml + header + lines + "\n";
    return toml.insert(at + header.size(), lines + "\n");
  }
  static std::string replaced(std::string toml, const std::string& what, const std::string& by) {
    const std::size_t at = toml.find(what);
    EXPECT_NE(at, std::string::npos) << what;
    return toml.replace(at, what.size(), by);
  }
  static std::string vehicle(const std::string& what, const std::string& by) {
    return replaced(test::kVehicleToml, what, by);
  }
  // Exactly one error (or the first of so many), with this exit code, that names file, line, key
  // and the words.
  void expect_error(const std::string& toml, const std::string& key,
                    const std::vector<std::string>& words, int line = 0, int exit_code = 78,
                    std::size_t errors = 1) {
    const ConfigResult result = load(toml);
    EXPECT_FALSE(result.config.has_value()) << key;
    ASSERT_EQ(result.errors.size(), errors)
        << key << (result.errors.size() > 1 ? result.errors[1].text : std::string());
    const ConfigError& error = result.errors[0];
    EXPECT_EQ(error.exit_code, exit_code);
    EXPECT_EQ(result.exit_code(), exit_code);
    EXPECT_EQ(error.text.find('\n'), std::string::npos);
    EXPECT_TRUE(error.text.starts_with(directory_.path() + "/beltgripd.toml:")) << error.text;
    EXPECT_NE(error.text.find(": " + key + ": found "), std::string::npos) << error.text;
    EXPECT_NE(error.text.find(", expected "), std::string::npos) << error.text;
    for (const std::string& word : words) {
      EXPECT_NE(error.text.find(word), std::string::npos) << word << " in " << error.text;
    }
    if (line != 0) {
      EXPECT_NE(error.text.find("toml:" + std::to_string(line) + ":"), std::string::npos)
          << error.text;
    }
  }
  void expect_good(const std::string& toml) {
    const ConfigResult result = load(toml);
    for (const ConfigError& error : result.errors) ADD_FAILURE() << error.text;
    EXPECT_TRUE(result.config.has_value());
  }

  TemporaryDirectory directory_;
};

int line_of(const std::string& toml, const std::string& what) {
  const std::size_t at = toml.find(what);
  return 1 + static_cast<int>(std::count(toml.begin(), toml.begin() + static_cast<long>(at), '\n'));
}

TEST_F(ConfigTest, TheVehicleIsBound) {
  const ConfigResult result = load(test::kVehicleToml);
  ASSERT_TRUE(result.config.has_value());
  EXPECT_TRUE(result.warnings.empty());
  const Config& config = *result.config;
  ASSERT_EQ(config.roles.size(), 5U);
  EXPECT_TRUE(std::is_sorted(config.roles.begin(), config.roles.end(),
                             [](const auto& a, const auto& b) { return a.role < b.role; }));
  const RoleBinding& speed = config.roles[0];
  EXPECT_EQ(speed.role, Role::kPrimarySpeed);
  EXPECT_EQ(speed.message_name, "Speeds");
  EXPECT_EQ(speed.id, (can::CanId{0x100, false}));
  EXPECT_EQ(speed.message_length, 8U);
  EXPECT_EQ(speed.maximum, 8000.0);
  EXPECT_NEAR(speed.factor, std::numbers::pi / 30.0, 1e-15);
  EXPECT_EQ(speed.period_ms, 10.0);
  const RoleBinding& pressure = config.roles[2];
  EXPECT_EQ(pressure.factor, 1e5);
  const RoleBinding& torque = config.roles[3];
  EXPECT_EQ(torque.id, (can::CanId{0x12345678, true}));
  EXPECT_EQ(config.trigger, Trigger::kAlways);
  EXPECT_EQ(config.control, Control::kObserve);
  EXPECT_TRUE(config.estimator.torque_is_engine);
  EXPECT_EQ(config.interface, "inproc:test");
}

// Every number: minimum and maximum are taken, the next double beyond is not, nor is text.
TEST_F(ConfigTest, EveryNumberAtAndBeyondItsRange) {
  // The neighbours that the cross-checks look at, moved out of the way.
  const auto neighbours = [](const std::string& key, double value) -> std::string {
    if (key == "ratio_low") return "ratio_overdrive = 10.0\n";
    if (key == "ratio_overdrive") return "ratio_low = 0.1\n";
    if (key == "primary_radius_overdrive_m") return "primary_radius_low_m = 0.005\n";
    if (key == "primary_radius_low_m") return "primary_radius_overdrive_m = 1.0\n";
    if (key == "lowpass_hz" && value > 50) return "sample_rate_hz = 1000\n";
    return "";
  };
  for (const Option& option : option_table()) {
    if (option.kind != Option::Kind::kNumber) continue;
    const std::string section(option.section), key(option.key), name = section + "." + key;
    const auto toml = [&](const std::string& value, double size = 0.0) {
      return with(section, key + " = " + value + "\n" + neighbours(key, size));
    };
    const bool low_ok = key != "ratio_overdrive" && key != "primary_radius_overdrive_m";
    const bool high_ok = key != "ratio_low" && key != "primary_radius_low_m";
    if (low_ok) expect_good(toml(number_text(option.minimum)));
    if (high_ok && key != "stop_slope")
      expect_good(toml(number_text(option.maximum), option.maximum));
    const double below = std::nextafter(option.minimum, -1e9);
    const double above = std::nextafter(option.maximum, 1e9);
    const std::vector<std::string> words{"a number from"};
    const int line = line_of(toml("1"), key + " = ");
    // Beyond its range the default stands for the cross-checks; only the range is reported.
    const auto alone = [&](const std::string& value) { return with(section, key + " = " + value); };
    expect_error(alone(number_text(below)), name, words, line);
    expect_error(alone(number_text(above)), name, words, line);
    expect_error(alone("nan"), name, words, line);
    expect_error(alone("inf"), name, words, line);
    expect_error(alone("\"1.0\""), name, words, line);
    expect_error(alone("true"), name, words, line);
    expect_error(alone("[1.0]"), name, words, line);
    expect_error(alone("2026-01-01"), name, words, line);
    if (option.minimum <= 1.0 && option.maximum >= 1.0 && low_ok && high_ok) {
      expect_good(toml("1"));  // an integer is fine where a number is wanted
    }
  }
}

// The tables within a section: each key with a value beyond its range, or of another type, is an
// error that says what would be right.
TEST_F(ConfigTest, EveryKeyOfATableBeyondItsRange) {
  using Kind = OptionRow::Kind;
  const auto wrong_values = [](const OptionRow& option) {
    std::vector<std::string> values{"2026-01-01"};
    const auto beyond = [&](double value) { values.push_back(number_text(value)); };
    if (option.kind == Kind::kNumber) {
      values.insert(values.end(), {"nan", "inf", "\"1\"", "[1]"});
      if (std::isfinite(option.minimum)) beyond(std::nextafter(option.minimum, -1e9));
      if (std::isfinite(option.maximum)) beyond(std::nextafter(option.maximum, 1e9));
      if (option.is_nonzero) values.emplace_back("0");
    }
    if (option.kind == Kind::kInteger) {
      values.insert(values.end(), {"1.5", "\"1\""});
      values.push_back(std::to_string(static_cast<std::int64_t>(option.minimum) - 1));
      values.push_back(std::to_string(static_cast<std::int64_t>(option.maximum) + 1));
    }
    if (option.kind == Kind::kText || option.kind == Kind::kFlag) values.emplace_back("1");
    if (option.kind == Kind::kChoice) values.emplace_back("\"nonsense\"");
    return values;
  };
  const auto expect_wrong = [&](const std::string& toml, const std::string& key) {
    const ConfigResult result = load(toml);
    const bool named =
        std::any_of(result.errors.begin(), result.errors.end(), [&](const ConfigError& error) {
          return error.text.find(": " + key + ": found ") != std::string::npos &&
                 error.text.find(", expected ") + 11 < error.text.size();
        });
    EXPECT_TRUE(named) << key << "\n" << toml;
  };
  std::size_t tried = 0;
  const auto each_key = [&](const auto& options, const std::string& section,
                            const std::string& where, const std::string& before,
                            const std::string& after) {
    for (const OptionRow& option : options) {
      if (option.kind == Kind::kOther) continue;
      for (const std::string& value : wrong_values(option)) {
        const std::string key(option.key);
        expect_wrong(with(section, before + key + " = " + value + after), where + "." + key);
        ++tried;
      }
    }
  };
  each_key(identifier_options(), "bus", "bus.identifiers", "identifiers = { ", " }");
  each_key(further_bus_options(), "bus", "bus.x", "x = { ", " }");
  each_key(role_options(), "signals", "signals.oil_temperature", "oil_temperature = { ", " }");
  each_key(uds_options(), "signals", "signals.oil_temperature.uds", "oil_temperature = { uds = { ",
           " } }");
  each_key(sensor_options(can::Dimension::kPressure), "sensors", "sensors.primary_pressure",
           "primary_pressure = { ", " }");
  each_key(protection_options(), "protection", "protection.Flags", "Flags = { ", " }");
  EXPECT_GT(tried, 90U);
}

TEST_F(ConfigTest, EveryKeyTwiceIsASyntaxErrorWithItsLine) {
  for (const Option& option : option_table()) {
    if (option.kind != Option::Kind::kNumber) continue;
    const std::string key(option.key);
    const std::string toml = with(std::string(option.section), key + " = 1\n" + key + " = 1");
    const int line = line_of(toml, key + " = 1") + 1;
    expect_error(toml, "syntax", {key}, line);
  }
}

TEST_F(ConfigTest, EveryKeyMisspeltIsNamedWithTheNearest) {
  for (const Option& option : option_table()) {
    std::string key(option.key);
    std::string wrong = key + "x";
    expect_error(with(std::string(option.section), wrong + " = 1"),
                 std::string(option.section) + "." + wrong,
                 {"an unknown key", "nearest is \"" + key + "\""});
  }
  expect_error(std::string(test::kVehicleToml) + "[variatr]\nratio_low = 1\n", "variatr",
               {"unknown section", "nearest is \"variator\""});
  expect_error("interface = \"vcan0\"\n" + std::string(test::kVehicleToml), "interface",
               {"unknown key"}, 1);
}

// A wrong unit in a key with a unit suffix is another key.
TEST_F(ConfigTest, AKeyWithAnotherUnitIsUnknown) {
  expect_error(with("variator", "half_wedge_angle_rad = 0.19"), "variator.half_wedge_angle_rad",
               {"nearest is \"half_wedge_angle_deg\""});
  expect_error(with("sensors", "secondary_pressure = { bias_bar = 0.2 }"),
               "sensors.secondary_pressure.bias_bar", {"bias_Pa or gain"});
}

TEST_F(ConfigTest, EveryChoice) {
  for (const Option& option : option_table()) {
    if (option.kind != Option::Kind::kChoice) continue;
    const std::string key(option.key), section(option.section);
    const std::string name = section + "." + key;
    std::string base = test::kVehicleToml;
    if (key == "trigger") base = replaced(base, "trigger = \"always\"\n", "");
    const auto toml = [&](const std::string& value) {
      std::string text = base;
      const std::string header = "[" + section + "]\n";
      const std::size_t at = text.find(header);
      const std::string line = key + " = " + value + "\n";
      return at == std::string::npos ? text + header + line : text.insert(at + header.size(), line);
    };
    for (const std::string_view choice : option.choices) {
      const ConfigResult result = load(toml('"' + std::string(choice) + '"'));
      // "command" needs roles that this vehicle does not have; CommandNeedsItsRoles says more.
      if (choice == "command") continue;
      ASSERT_TRUE(result.config.has_value()) << name << " " << choice;
      EXPECT_EQ(option.choices[option.get_choice(*result.config)], choice);
    }
    expect_error(toml("\"nonsense\""), name, {"\"nonsense\"", std::string(option.choices[0])});
    expect_error(toml("1"), name, {std::string(option.choices[0])});
  }
}

TEST_F(ConfigTest, AModelFileIsReadWithTheConfiguration) {
  directory_.write("loss.toml",
                   "[variator]\nratio_low = 0.41\n[driveline]\nloss_constant_Nm = 0.5\n"
                   "[effects.torque_loss]\nconstant_Nm = 1.5\n[effects.channel_skew]\n"
                   "role = \"engine_torque\"\ndelay_s = 0.03\n");
  const ConfigResult result = load(with("estimator", "model = \"loss.toml\""));
  ASSERT_TRUE(result.config.has_value()) << result.errors[0].text;
  EXPECT_EQ(result.config->variator.ratio_low, 0.41);
  ASSERT_TRUE(result.config->corrected.has_value());
  EXPECT_EQ(result.config->corrected->loss_constant_Nm, 2.0);
  EXPECT_EQ(result.config->corrected->torque_delay_s, 0.03);
  // One line that names the file, what is wrong there and what would be right.
  const ConfigResult missing = load(with("estimator", "model = \"none.toml\""));
  ASSERT_EQ(missing.errors.size(), 1U);
  EXPECT_EQ(missing.exit_code(), 66);
  EXPECT_NE(missing.errors[0].text.find("none.toml: found no readable file"), std::string::npos);
  directory_.write("bad.toml", "[effects.wera]\nstep = 0.1\n");
  const ConfigResult bad = load(with("estimator", "model = \"bad.toml\""));
  ASSERT_EQ(bad.errors.size(), 1U);
  EXPECT_EQ(bad.exit_code(), 78);
  EXPECT_NE(bad.errors[0].text.find("bad.toml:1: effects.wera: found an unknown effect"),
            std::string::npos)
      << bad.errors[0].text;
}

TEST_F(ConfigTest, ThePapersMethodHasNoConfidence) {
  std::string toml = with("experiment", "stop = \"confidence\"\nconfidence_width = 0.1");
  EXPECT_TRUE(load(toml).config.has_value());
  toml += "[estimator]\nmethod = \"paper\"\n";
  expect_error(toml, "experiment.stop", {"\"peak\"", "paper"});
}

TEST_F(ConfigTest, CommandNeedsItsRolesATriggerAndTheInertia) {
  const ConfigResult result = load(with("experiment", "control = \"command\""));
  std::string all;
  for (const ConfigError& error : result.errors) all += error.text + "\n";
  for (const char* key :
       {"signals.experiment_permitted", "signals.accelerator_pedal", "signals.brake_pressed",
        "signals.lockup_closed", "signals.oil_temperature", "signals.vehicle_speed",
        "experiment.trigger", "variator.primary_inertia_kg_m2"}) {
    EXPECT_NE(all.find(std::string(key) + ": found"), std::string::npos) << key << "\n" << all;
  }
  EXPECT_EQ(result.errors.size(), 8U) << all;
  // With a torque sensor too: the slip of a belt that has been let go grows by the inertia.
  std::string measured = with("experiment", "control = \"command\"");
  const std::string role = "engine_torque";
  measured.replace(measured.find(role), role.size(), "primary_torque");
  all.clear();
  for (const ConfigError& error : load(measured).errors) all += error.text + "\n";
  EXPECT_NE(all.find("variator.primary_inertia_kg_m2: found"), std::string::npos) << all;
}

TEST_F(ConfigTest, CrossChecks) {
  expect_error(with("variator", "ratio_low = 2.5"), "variator.ratio_low",
               {"2.5", "less than ratio_overdrive, 2.25"});
  expect_error(with("variator", "ratio_low = 2.25"), "variator.ratio_low", {"less than"});
  expect_error(with("variator", "primary_radius_low_m = 0.09"), "variator.primary_radius_low_m",
               {"less than primary_radius_overdrive_m, 0.0784"});
  expect_error(with("estimator", "stop_slope = 0\npeak_slope = 0"), "estimator.stop_slope",
               {"less than peak_slope"});
  expect_error(with("estimator", "lowpass_hz = 100"), "estimator.lowpass_hz",
               {"less than half of sample_rate_hz, 100"});
  expect_error(vehicle("inproc:test", "can0123456789abc"), "bus.interface", {"1 to 15 characters"},
               2);
  expect_good(vehicle("inproc:test", "can0123456789ab"));
  for (const char* name : {"", "inproc:", "a b", "a/b", ".", "a:b"}) {
    expect_error(vehicle("inproc:test", name), "bus.interface", {"or inproc:NAME"}, 2);
  }
}

TEST_F(ConfigTest, Identifiers) {
  const ConfigResult result = load(with("bus", "identifiers = { slip = 0x7FF, status = 0 }"));
  ASSERT_TRUE(result.config.has_value());
  EXPECT_EQ(result.config->identifiers.slip, 0x7FFU);
  EXPECT_EQ(result.config->identifiers.status, 0U);
  EXPECT_EQ(result.config->identifiers.estimate, 0x6A0U);
  const std::string key = "bus.identifiers.slip";
  expect_error(with("bus", "identifiers = { slip = 0x800 }"), key, {"2048", "0 to 0x7FF"});
  expect_error(with("bus", "identifiers = { slip = -1 }"), key, {"-1"});
  expect_error(with("bus", "identifiers = { slip = 1.5 }"), key, {"1.5"});
  expect_error(with("bus", "identifiers = { slap = 1 }"), "bus.identifiers.slap",
               {"nearest is \"slip\""});
  expect_error(with("bus", "identifiers = 5"), "bus.identifiers", {"5"});
  expect_error(with("bus", "identifiers = { slip = 0x6A0 }"), "bus.identifiers",
               {"estimate and slip"});
  expect_error(with("bus", "identifiers = { clamp = 0x101 }"), "signals.secondary_pressure",
               {"clamp"});
}

TEST_F(ConfigTest, RequiredRoles) {
  for (const auto& [role, line] :
       {std::pair{"primary_speed", "primary_speed = \"Speeds.PrimarySpeed\"\n"},
        std::pair{"secondary_speed", "secondary_speed = \"Speeds.SecondarySpeed\"\n"},
        std::pair{"secondary_pressure", "secondary_pressure = \"Pressure.SecondaryPressure\"\n"},
        std::pair{"engine_torque", "engine_torque = \"0x12345678x.EngineTorque\"\n"}}) {
    expect_error(vehicle(line, ""), "signals." + std::string(role), {"no such key"}, 4);
  }
  const std::string primary = vehicle("engine_torque", "primary_torque");
  const ConfigResult result = load(primary);
  ASSERT_TRUE(result.config.has_value());
  EXPECT_FALSE(result.config->estimator.torque_is_engine);
  expect_error(replaced(vehicle("experiment_active = \"Flags.ExperimentActive\"\n", ""),
                        "\"always\"", "\"signal\""),
               "signals.experiment_active", {"trigger is \"signal\""});
}

TEST_F(ConfigTest, RolesThatNameNothing) {
  const std::string key = "signals.primary_speed";
  const auto role = [&](const std::string& text) {
    return vehicle("\"Speeds.PrimarySpeed\"", text);
  };
  expect_error(role("\"Speeds.PrimarySped\""), key,
               {"PrimarySped", "vehicle.dbc", "nearest is \"PrimarySpeed\""}, 5);
  expect_error(role("\"Speds.PrimarySpeed\""), key, {"Speds", "nearest is \"Speeds\""}, 5);
  expect_error(role("\"PrimarySpeed\""), key, {"\"Message.Signal\""}, 5);
  expect_error(role("\"\""), key, {"\"Message.Signal\""}, 5);
  expect_error(role("\".x\""), key, {"\"Message.Signal\""}, 5);
  expect_error(role("\"x.\""), key, {"\"Message.Signal\""}, 5);
  expect_error(role("\"0x101.PrimarySpeed\""), key, {"Pressure does not have"}, 5);
  expect_error(role("\"0x100x.PrimarySpeed\""), key, {"no DBC names"}, 5);  // 29 bit, not 11
  expect_error(role("\"0x800.PrimarySpeed\""), key, {"0x123 (11 bit)"}, 5);
  expect_error(role("\"0x20000000x.PrimarySpeed\""), key, {"(29 bit)"}, 5);
  expect_error(role("\"0x.PrimarySpeed\""), key, {"(29 bit)"}, 5);
  expect_error(role("\"0x1G.PrimarySpeed\""), key, {"(29 bit)"}, 5);
  expect_error(role("5"), key, {"5"}, 5);
  expect_error(role("[\"Speeds.PrimarySpeed\"]"), key, {"an array"}, 5);
  expect_good(role("\"0x100.PrimarySpeed\""));
  expect_error(with("signals", "primry_speed = \"Speeds.PrimarySpeed\""), "signals.primry_speed",
               {"nearest is \"primary_speed\""});
}

TEST_F(ConfigTest, RolesAsTables) {
  const std::string key = "signals.primary_speed";
  const auto role = [&](const std::string& text) {
    return vehicle("\"Speeds.PrimarySpeed\"", "{ signal = \"Speeds.PrimarySpeed\", " + text + " }");
  };
  const ConfigResult result =
      load(role("unit = \"rad/s\", scale = 2, offset = -1.5, period_ms = 40"));
  ASSERT_TRUE(result.config.has_value());
  EXPECT_EQ(result.config->roles[0].factor, 2.0);
  EXPECT_EQ(result.config->roles[0].shift, -1.5);
  EXPECT_EQ(result.config->roles[0].period_ms, 40.0);
  const ConfigResult rpm = load(role("offset = 30"));
  ASSERT_TRUE(rpm.config.has_value());
  EXPECT_NEAR(rpm.config->roles[0].shift, std::numbers::pi, 1e-12);

  expect_error(role("unit = \"bar\""), key, {"\"bar\" (pressure)", "angular speed"}, 5);
  expect_error(role("unit = \"furlong\""), key, {"furlong", "rad/s"}, 5);
  expect_error(role("unit = \"\""), key, {"no unit"}, 5);
  expect_error(role("unit = 5"), key + ".unit", {"5"}, 5);
  expect_error(role("scale = 0"), key + ".scale", {"0"}, 5);
  expect_error(role("scale = nan"), key + ".scale", {"nan"}, 5);
  expect_error(role("offset = \"1\""), key + ".offset", {"finite number"}, 5);
  expect_error(role("period_ms = 0"), key + ".period_ms", {"0.5 to 10000"}, 5);
  EXPECT_EQ(result.config->roles[0].delay_ms, 0.0);
  const ConfigResult late = load(role("delay_ms = -3.5"));
  ASSERT_TRUE(late.config.has_value());
  EXPECT_EQ(late.config->roles[0].delay_ms, -3.5);
  expect_error(role("delay_ms = 201"), key + ".delay_ms", {"-50 to 200"}, 5);
  expect_error(role("delay_ms = \"3\""), key + ".delay_ms", {"-50 to 200"}, 5);
  expect_error(role("period = 10"), key + ".period", {"nearest is \"period_ms\""}, 5);
  expect_error(vehicle("\"Speeds.PrimarySpeed\"", "{ unit = \"rpm\" }"), key, {"without signal"},
               5);
}

TEST_F(ConfigTest, UnitsOfTheDbc) {
  const auto dbc = [&](const std::string& what, const std::string& by) {
    directory_.write("vehicle.dbc", replaced(test::kVehicleDbc, what, by));
  };
  dbc("[0|60] \"bar\"", "[0|60] \"Nm\"");
  expect_error(test::kVehicleToml, "signals.secondary_pressure",
               {"\"Nm\" in vehicle.dbc (torque)", "pressure", "set unit"}, 7);
  dbc("[0|60] \"bar\"", "[0|60] \"\"");
  expect_error(test::kVehicleToml, "signals.secondary_pressure",
               {"no unit in vehicle.dbc", "set unit"}, 7);
  dbc("[0|60] \"bar\"", "[0|60] \"counts\"");
  expect_error(test::kVehicleToml, "signals.secondary_pressure", {"\"counts\""}, 7);
  dbc("[0|3] \"\"", "[0|3] \"rpm\"");
  expect_error(test::kVehicleToml, "signals.experiment_active", {"angular speed", "0 or 1"}, 9);
}

TEST_F(ConfigTest, SignalsThatCannotBeDecoded) {
  const auto dbc = [&](const std::string& what, const std::string& by) {
    directory_.write("vehicle.dbc", replaced(test::kVehicleDbc, what, by));
  };
  dbc("PrimarySpeed : 0|16@1+", "PrimarySpeed : 56|16@1+");
  ConfigResult result = load(test::kVehicleToml);
  ASSERT_EQ(result.errors.size(), 1U);
  EXPECT_NE(result.errors[0].text.find("outside the 8 bytes of Speeds"), std::string::npos);
  dbc("(0.125,0) [0|8000] \"rpm\"", "(0,0) [0|8000] \"rpm\"");
  result = load(test::kVehicleToml);
  ASSERT_FALSE(result.errors.empty());
  EXPECT_NE(result.errors[0].text.find("factor"), std::string::npos) << result.errors[0].text;
}

TEST_F(ConfigTest, MessagesOfSeveralFramesAreNoInput) {
  for (const char* length : {"9", "264", "1785"}) {
    directory_.write("vehicle.dbc", replaced(test::kVehicleDbc, "BO_ 256 Speeds: 8",
                                             "BO_ 256 Speeds: " + std::string(length)));
    const ConfigResult result = load(test::kVehicleToml);
    ASSERT_FALSE(result.errors.empty()) << length;
    EXPECT_EQ(result.exit_code(), 78);
    EXPECT_NE(result.errors[0].text.find("of " + std::string(length) + " bytes"),
              std::string::npos);
  }
}

TEST_F(ConfigTest, AMultiplexedRoleKnowsItsSelectors) {
  directory_.write("vehicle.dbc",
                   replaced(replaced(test::kVehicleDbc, "PrimarySpeed :", "PrimarySpeed m3 :"),
                            " SG_ SecondarySpeed",
                            " SG_ Page M : 32|8@1+ (1,0) [0|0] \"\" ECU\n"
                            " SG_ SecondarySpeed"));
  const ConfigResult result = load(test::kVehicleToml);
  ASSERT_TRUE(result.config.has_value()) << result.errors[0].text;
  ASSERT_EQ(result.config->roles[0].mux.size(), 1U);
  EXPECT_EQ(result.config->roles[0].mux[0].ranges.front(),
            (std::pair<std::uint64_t, std::uint64_t>{3, 3}));
  EXPECT_TRUE(result.config->roles[1].mux.empty());
}

TEST_F(ConfigTest, J1939MessagesAreBoundWithTheirSources) {
  // Two sources of one group in the DBC; and what the null address says.
  const std::string j1939 =
      "BA_DEF_ \"ProtocolType\" STRING ;\nBA_DEF_DEF_ \"ProtocolType\" \"J1939\";\n";
  const std::string other =
      "BO_ 2565865521 Other: 8 TCU\n SG_ X : 0|8@1+ (1,0) [0|0] \"\" ECU\n\n";  // 0x18F00431
  const auto bound = [&](const char* id) {
    std::string dbc = replaced(test::kVehicleDbc, "BO_ 256 ", "BO_ " + std::string(id) + " ");
    dbc = replaced(dbc, "BO_ 256 10", "BO_ " + std::string(id) + " 10");
    dbc = replaced(dbc, "BO_ 257 Pressure", other + "BO_ 257 Pressure");
    directory_.write("vehicle.dbc", dbc + j1939);
    const ConfigResult result = load(test::kVehicleToml);
    EXPECT_TRUE(result.config.has_value());
    return result.config ? result.config->roles[0].sources : std::bitset<256>();
  };
  const auto own = bound("2565865472");  // 0x18F00400
  EXPECT_EQ(own.count(), 255U);
  EXPECT_FALSE(own[0x31]);
  const auto any = bound("2565865726");  // 0x18F004FE
  EXPECT_EQ(any.count(), 255U);
  EXPECT_FALSE(any[0x31]);
  directory_.write("vehicle.dbc", test::kVehicleDbc);
  const ConfigResult plain = load(test::kVehicleToml);
  for (const RoleBinding& role : plain.config->roles) {
    EXPECT_TRUE(role.sources.none());
  }
}

TEST_F(ConfigTest, DbcFiles) {
  expect_error(vehicle("[\"vehicle.dbc\"]", "[]"), "bus.dbc", {"at least one DBC"}, 3);
  expect_error(vehicle("dbc = [\"vehicle.dbc\"]\n", ""), "bus.dbc", {"at least one DBC"}, 1);
  expect_error(vehicle("[\"vehicle.dbc\"]", "\"vehicle.dbc\""), "bus.dbc", {"an array"}, 3);
  expect_error(vehicle("[\"vehicle.dbc\"]", "[1]"), "bus.dbc", {"1"}, 3);
  expect_error(vehicle("[\"vehicle.dbc\"]", "[\"none.dbc\"]"), "bus.dbc",
               {"none.dbc", "No such file", directory_.path()}, 3, 66);
  expect_error(vehicle("[\"vehicle.dbc\"]", "[\".\"]"), "bus.dbc", {"directory"}, 3, 66);
  directory_.write("empty.dbc", "");
  expect_error(vehicle("[\"vehicle.dbc\"]", "[\"empty.dbc\"]"), "bus.dbc",
               {"empty.dbc", "without a readable message"}, 3, 65);
  directory_.write("text.dbc", "This is no DBC.\n");
  expect_error(vehicle("[\"vehicle.dbc\"]", "[\"text.dbc\"]"), "bus.dbc", {"text.dbc"}, 3, 65);
  // An identifier in two files, whether or not a role uses it.
  directory_.write("other.dbc",
                   "VERSION \"\"\nBS_:\nBU_: X\nBO_ 259 Other: 8 X\n SG_ S : 0|8@1+ (1,0) [0|0] "
                   "\"\" X\n");
  expect_error(vehicle("[\"vehicle.dbc\"]", "[\"vehicle.dbc\", \"other.dbc\"]"), "bus.dbc",
               {"0x103", "\"vehicle.dbc\" (Flags)", "\"other.dbc\" (Other)"}, 3);
  expect_error(vehicle("[\"vehicle.dbc\"]", "[\"vehicle.dbc\", \"vehicle.dbc\"]"), "bus.dbc",
               {"and 3 more such"}, 3);
  // One name in two files.
  directory_.write("other.dbc",
                   "VERSION \"\"\nBS_:\nBU_: X\nBO_ 1 Speeds: 8 X\n SG_ PrimarySpeed : 0|16@1+ "
                   "(1,0) [0|0] \"rpm\" X\n");
  ConfigResult result = load(vehicle("[\"vehicle.dbc\"]", "[\"vehicle.dbc\", \"other.dbc\"]"));
  ASSERT_EQ(result.errors.size(), 2U);
  EXPECT_NE(result.errors[0].text.find("0x100 or 0x1"), std::string::npos);
  expect_good(replaced(replaced(vehicle("[\"vehicle.dbc\"]", "[\"vehicle.dbc\", \"other.dbc\"]"),
                                "Speeds.PrimarySpeed", "0x1.PrimarySpeed"),
                       "Speeds.SecondarySpeed", "0x100.SecondarySpeed"));
}

TEST_F(ConfigTest, PathsAreRelativeToTheFile) {
  TemporaryDirectory elsewhere;
  const std::string toml = vehicle("vehicle.dbc", directory_.path() + "/vehicle.dbc");
  EXPECT_TRUE(load_config(elsewhere.write("c.toml", toml)).config.has_value());
  EXPECT_FALSE(load_config(elsewhere.write("d.toml", test::kVehicleToml)).config.has_value());
}

TEST_F(ConfigTest, Sensors) {
  const ConfigResult result = load(with("sensors",
                                        "engine_torque = { bias_Nm = 2.5, gain = 0.05 }\n"
                                        "primary_torque = { bias_Nm = 9 }\n"
                                        "secondary_pressure = { bias_Pa = 20e3 }\n"
                                        "primary_speed = { gain = 0.0005 }"));
  ASSERT_TRUE(result.config.has_value());
  EXPECT_EQ(result.config->sensors.torque.bias, 2.5);
  EXPECT_EQ(result.config->sensors.torque.gain, 0.05);
  EXPECT_EQ(result.config->sensors.secondary_pressure.bias, 20e3);
  EXPECT_NEAR(result.config->estimator.pressure_step_Pa, 100.0, 1e-9);  // 0.001 bar per bit
  EXPECT_EQ(result.config->sensors.omega_p.gain, 0.0005);
  EXPECT_EQ(result.config->sensors.omega_s.gain, 0.0005);  // left out: as in other cars
  for (std::size_t i = 0; i < kRoleCount; ++i) {
    const Role role = static_cast<Role>(i);
    const std::string name(role_name(role)), key = "sensors." + name;
    const std::string bias(bias_key(role_dimension(role)));
    if (bias.empty()) {
      expect_error(with("sensors", name + " = { gain = 0 }"), key, {"an unknown key"});
      continue;
    }
    const double maximum = sensor_options(role_dimension(role)).front().maximum;
    expect_good(
        with("sensors", name + " = { gain = 1, " + bias + " = " + number_text(maximum) + " }"));
    expect_good(with("sensors", name + " = { gain = 0, " + bias + " = 0 }"));
    expect_error(with("sensors", name + " = { gain = 1.01 }"), key + ".gain", {"1.01"});
    expect_error(with("sensors", name + " = { gain = -0.01 }"), key + ".gain", {"-0.01"});
    expect_error(with("sensors", name + " = { " + bias + " = -1 }"), key + "." + bias, {"-1"});
    expect_error(
        with("sensors", name + " = { " + bias + " = " + number_text(maximum * 1.01) + " }"),
        key + "." + bias, {"a number from 0 to"});
    expect_error(with("sensors", name + " = { " + bias + " = \"1\" }"), key + "." + bias,
                 {"\"1\""});
    expect_error(with("sensors", name + " = 1"), key, {"1"});
  }
}

TEST_F(ConfigTest, AllErrorsAreListed) {
  const ConfigResult result = load(R"([bus]
interface = ""
dbc = ["vehicle.dbc"]
[signals]
primary_speed = "Speeds.Nothing"
secondary_speed = "Speeds.SecondarySpeed"
secondary_pressure = { signal = "Pressure.SecondaryPressure", unit = "rpm" }
[variator]
ratio_low = 3
safety_factor = 0.5
unknown = 1
[experiment]
control = "command"
)");
  // unknown, safety_factor, primary_speed, secondary_pressure, engine_torque missing, interface,
  // ratio_low, and what control = "command" needs
  EXPECT_EQ(result.errors.size(), 14U);
  for (const ConfigError& error : result.errors) EXPECT_EQ(error.exit_code, 78) << error.text;
}

TEST_F(ConfigTest, FilesThatAreNoConfiguration) {
  EXPECT_EQ(load_config(directory_.path() + "/none.toml").exit_code(), 66);
  EXPECT_EQ(load_config(directory_.path()).exit_code(), 66);
  EXPECT_NE(load_config("/dev/zero").errors.at(0).text.find("/dev/zero:1: size: found more than"),
            std::string::npos);
  const auto text_of = [&](const std::string& content) {
    const ConfigResult result = load(content);
    EXPECT_FALSE(result.config.has_value());
    EXPECT_EQ(result.exit_code(), 78);
    EXPECT_EQ(result.errors.at(0).text.find('\n'), std::string::npos);
    return result.errors.at(0).text;
  };
  text_of("");
  EXPECT_NE(text_of("[bus\n").find("toml:1: syntax"), std::string::npos);
  EXPECT_NE(text_of("\n\na = \n").find("toml:3: syntax"), std::string::npos);
  text_of(std::string("a = 1\n\0b = 2\n", 13));
  text_of("a = \"\xff\xfe\"\n");
  text_of("a = '''never closed");
  text_of(std::string(5000, '['));
  text_of("bus = 5\n");
  text_of("[[bus]]\n");
  EXPECT_NE(text_of("a" + std::string(1 << 18, 'x') + " = 1\n").find("an unknown key"),
            std::string::npos);
  EXPECT_NE(text_of("# " + std::string(1 << 20, 'x')).find("toml:1: size: found more than 1 MiB"),
            std::string::npos);
  expect_good(std::string(test::kVehicleToml) + "# " + std::string(1'000'000, 'x') + "\n");
  // A byte order mark and carriage returns are fine.
  std::string windows = "\xEF\xBB\xBF";
  for (const char c : std::string(test::kVehicleToml))
    windows += c == '\n' ? "\r\n" : std::string(1, c);
  expect_good(windows);
}

// Every default in the generated file is the one in the code: with all of them uncommented nothing
// changes but what the vehicle needs.
TEST_F(ConfigTest, TheDefaultFileSaysTheDefaults) {
  std::string active;
  std::size_t keys = 0;
  std::string text = default_config_text();
  std::string section;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = text.find('\n', at);
    std::string line = text.substr(at, end - at);
    at = end + 1;
    if (line.starts_with("[")) {
      section = line.substr(1, line.size() - 2);
      active += line + "\n";
    }
    for (const Option& option : option_table()) {
      if (option.section == section && line.starts_with("# " + std::string(option.key) + " = ")) {
        active += line.substr(2) + "\n";
        ++keys;
      }
    }
  }
  EXPECT_EQ(keys, option_table().size());
  active = replaced(active, "dbc = []", "dbc = [\"vehicle.dbc\"]");
  active = replaced(active, "trigger = \"coast_down\"", "trigger = \"always\"");
  const std::string vehicle_text = test::kVehicleToml;
  const std::size_t from = vehicle_text.find("[signals]\n") + 10;
  active =
      replaced(active, "[signals]\n",
               "[signals]\n" + vehicle_text.substr(from, vehicle_text.find("[experiment]") - from));
  const ConfigResult result = load(active);
  ASSERT_TRUE(result.config.has_value()) << result.errors.at(0).text;
  Config defaults;
  for (const Option& option : option_table()) {
    if (option.kind == Option::Kind::kNumber) {
      Config loaded = *result.config;
      EXPECT_NEAR(option.number(loaded), option.number(defaults),
                  1e-12 * std::abs(option.number(defaults)))
          << option.key;
    } else if (option.kind == Option::Kind::kChoice && option.key != "trigger") {
      EXPECT_EQ(option.get_choice(*result.config), option.get_choice(defaults)) << option.key;
    }
  }
  EXPECT_EQ(result.config->interface, defaults.interface);
}

TEST_F(ConfigTest, TheDefaultFileHasTheKeysOfEveryTable) {
  const std::string text = default_config_text();
  const auto expect_keys = [&](const auto& options) {
    for (const OptionRow& option : options) {
      EXPECT_NE(text.find("\n#   " + std::string(option.key) + " = "), std::string::npos)
          << option.section << "." << option.key;
      EXPECT_FALSE(option.help.empty()) << option.key;
    }
  };
  expect_keys(identifier_options());
  expect_keys(further_bus_options());
  expect_keys(role_options());
  expect_keys(uds_options());
  expect_keys(protection_options());
  EXPECT_EQ(text.find(" \n"), std::string::npos);
}

// The values that the interface promises as defaults.
TEST_F(ConfigTest, DefaultsOfTheInterface) {
  Config config;
  EXPECT_NEAR(config.variator.half_wedge_angle_rad, 11.0 * std::numbers::pi / 180.0, 1e-15);
  EXPECT_EQ(config.variator.ratio_low, 0.405);
  EXPECT_EQ(config.variator.ratio_overdrive, 2.25);
  EXPECT_EQ(config.variator.primary_radius_overdrive_m, 0.0784);
  EXPECT_EQ(config.variator.primary_radius_low_m, 0.0324);
  EXPECT_EQ(config.variator.secondary_piston_area_m2, 0.0113);
  EXPECT_EQ(config.variator.secondary_spring_force_N, 500.0);
  EXPECT_EQ(config.variator.safety_factor, 1.3);
  EXPECT_EQ(config.estimator.sample_rate_hz, 200.0);
  EXPECT_EQ(config.estimator.lowpass_hz, 5.0);
  EXPECT_EQ(config.estimator.window_s, 1.0);
  EXPECT_EQ(config.estimator.slope_variance, 5e-3);
  EXPECT_EQ(config.estimator.offset_variance, 0.5);
  EXPECT_EQ(config.estimator.excitation_threshold, 0.05);
  EXPECT_EQ(config.estimator.stop_slope, -1e-3);
  EXPECT_EQ(config.estimator.peak_slope, 1e-3);
  EXPECT_EQ(config.estimator.value_width, 0.05);
  EXPECT_EQ(config.estimator.ramp_rate_max_N_per_s, 600.0);
  EXPECT_EQ(config.experiment.fall_max_per_percent, 8e-3);
  EXPECT_EQ(config.estimator.method, estimator::Method::kRobust);
  EXPECT_EQ(config.trigger, Trigger::kCoastDown);
  EXPECT_EQ(config.control, Control::kObserve);
}

// The pressure from diagnostics instead of a message.
std::string with_uds(const std::string& uds, const std::string& rest = ", unit = \"kPa\"") {
  std::string toml = test::kVehicleToml;
  const std::string what = "\"Pressure.SecondaryPressure\"";
  return toml.replace(toml.find(what), what.size(), "{ uds = " + uds + rest + " }");
}
constexpr const char* kUds =
    "{ request = 0x7E1, response = 0x7E9, did = 0x1101, start = 7, length = 16, "
    "byte_order = \"big\", scale = 0.5, offset = -1.0 }";
constexpr const char* kPoll = "diagnostics = \"poll\"\n";

TEST_F(ConfigTest, ASignalFromDiagnostics) {
  const ConfigResult result = load(with_uds(kUds, ", unit = \"kPa\", period_ms = 50"));
  ASSERT_TRUE(result.config.has_value()) << result.errors.at(0).text;
  EXPECT_EQ(result.config->diagnostics, Diagnostics::kListen);
  const RoleBinding& pressure = result.config->roles[2];
  ASSERT_TRUE(pressure.uds.has_value());
  EXPECT_EQ(pressure.uds->request, (can::CanId{0x7E1, false}));
  EXPECT_EQ(pressure.uds->response, (can::CanId{0x7E9, false}));
  EXPECT_EQ(pressure.uds->identifier, 0x1101);
  EXPECT_EQ(pressure.period_ms, 50.0);
  EXPECT_EQ(pressure.factor, 1000.0);
  const std::array<std::uint8_t, 2> data{0x01, 0x02};  // 258
  EXPECT_EQ(pressure.codec.decode(data), 128.0);
  // 29 bit; without the keys that have a default.
  const ConfigResult extended = load(
      with_uds("{ request = 0x18DA10F1, response = 0x18DAF110, did = 1, start = 0, length = 8, "
               "byte_order = \"little\", signed = true }"));
  ASSERT_TRUE(extended.config.has_value()) << extended.errors.at(0).text;
  EXPECT_TRUE(extended.config->roles[2].uds->request.extended);
  const std::array<std::uint8_t, 1> negative{0xFE};
  EXPECT_EQ(extended.config->roles[2].codec.decode(negative), -2.0);
}

TEST_F(ConfigTest, SignalsFromDiagnosticsThatAreWrong) {
  const auto uds = [](const std::string& what, const std::string& by) {
    return with_uds(replaced(kUds, what, by));
  };
  const int line = line_of(test::kVehicleToml, "secondary_pressure");
  const std::string key = "signals.secondary_pressure";
  expect_error(uds("0x7E1", "0x20000000"), key + ".uds.request", {"29 bit"}, line);
  expect_error(uds("0x7E1", "-1"), key + ".uds.request", {"-1"}, line);
  expect_error(uds("0x7E1", "\"0x7E1\""), key + ".uds.request", {"identifier"}, line);
  expect_error(uds("0x7E9", "0x7E1"), key + ".uds.response", {"request"}, line);
  expect_error(uds("0x1101", "0x10000"), key + ".uds.did", {"0xFFFF"}, line);
  expect_error(uds("length = 16", "length = 65"), key + ".uds.length", {"64"}, line);
  expect_error(uds("length = 16", "length = 0"), key + ".uds.length", {"1"}, line);
  expect_error(uds("start = 7", "start = -1"), key + ".uds.start", {"DBC"}, line);
  expect_error(uds("start = 7", "start = 32735"), key + ".uds", {"fit"}, line);
  expect_error(uds("\"big\"", "\"motorola\""), key + ".uds.byte_order", {"little"}, line);
  expect_error(uds("scale = 0.5", "scale = 0"), key + ".uds.scale", {"0"}, line);
  expect_error(uds("offset = -1.0", "offset = nan"), key + ".uds.offset", {"finite"}, line);
  expect_error(uds("offset = -1.0", "signed = 1"), key + ".uds.signed", {"true"}, line);
  expect_error(uds("did = ", "dit = "), key + ".uds.dit", {"did"}, line, 78, 2);
  expect_error(uds("did = 0x1101, ", ""), key + ".uds", {"did"}, line);
  expect_error(with_uds("0x1101"), key + ".uds", {"request"}, line);
  expect_error(with_uds(kUds, ""), key, {"no unit", "pressure"}, line);
  expect_error(with_uds(kUds, ", unit = \"Nm\""), key, {"torque"}, line);
  expect_error(with_uds(kUds, ", unit = \"kPa\", scale = 2"), key + ".scale", {"inside"}, line);
  expect_error(with_uds(kUds, ", unit = \"kPa\", signal = \"Pressure.SecondaryPressure\""), key,
               {"both"}, line);
  // Identifiers that mean something else.
  expect_error(uds("0x7E9", "0x6A1"), key + ".uds.response", {"BeltGrip"}, line);
  expect_error(uds("0x7E1", "0x100"), key + ".uds.request", {"Speeds"}, line, 78, 2);
  expect_error(with("signals",
                    "oil_temperature = { uds = { request = 0x7E2, response = 0x7E9, "
                    "did = 2, start = 7, length = 8 }, unit = \"degC\" }\n"
                    "primary_pressure = { uds = " +
                        std::string(kUds) + ", unit = \"kPa\" }"),
               "signals.oil_temperature.uds", {"primary_pressure"});
}

TEST_F(ConfigTest, PollingNeedsAPeriodAndAnEcu) {
  const auto polled = [](std::string toml) { return toml.insert(toml.find("[signals]"), kPoll); };
  expect_good(polled(with_uds(kUds, ", unit = \"kPa\", period_ms = 10")));
  const std::string key = "signals.secondary_pressure";
  expect_error(polled(with_uds(kUds)), key + ".period_ms", {"poll"});
  expect_error(polled(with_uds(kUds, ", unit = \"kPa\", period_ms = 9")), key + ".period_ms",
               {"10"});
  for (const char* everyone : {"0x7DF", "0x18DB33F1"}) {
    expect_error(
        polled(with_uds(replaced(kUds, "0x7E1", everyone), ", unit = \"kPa\", period_ms = 50")),
        key + ".uds.request", {"all ECUs"});
  }
  expect_error(vehicle("[signals]", "diagnostics = true\n[signals]"), "bus.diagnostics",
               {"listen", "poll"});
}

TEST_F(ConfigTest, AFurtherBus) {
  directory_.write("further.dbc",
                   "VERSION \"\"\nBU_: X\nBO_ 256 Other: 8 X\n SG_ Torque : 0|16@1- (0.5,0) [0|0] "
                   "\"Nm\" X\n");
  const auto further = [](const std::string& bus, const std::string& role) {
    const std::string toml = replaced(test::kVehicleToml, "\"0x12345678x.EngineTorque\"", role);
    return replaced(replaced(toml, "inproc:test", "can0"), "[signals]", bus + "[signals]");
  };
  const std::string bus = "[bus.diag]\ninterface = \"can1\"\n";
  const std::string dbc = "dbc = [\"further.dbc\"]\n";
  // 0x100 of the one bus is not 0x100 of the other.
  const ConfigResult result =
      load(further(bus + dbc, "{ signal = \"Other.Torque\", bus = \"diag\" }"));
  ASSERT_TRUE(result.config.has_value()) << result.errors.at(0).text;
  ASSERT_TRUE(result.config->further_bus.has_value());
  EXPECT_EQ(result.config->further_bus->interface, "can1");
  EXPECT_EQ(result.config->roles[3].bus, 1);
  EXPECT_EQ(result.config->roles[3].id, (can::CanId{0x100, false}));
  EXPECT_EQ(result.config->roles[0].bus, 0);
  // Without DBC files of its own it has those of [bus].
  expect_good(further(bus, "{ signal = \"0x12345678x.EngineTorque\", bus = \"diag\" }"));

  const std::string role = "{ signal = \"0x12345678x.EngineTorque\", bus = \"diag\" }";
  expect_error(further(bus, "\"0x12345678x.EngineTorque\""), "bus.diag", {"no role"});
  expect_error(further("", role), "signals.engine_torque.bus", {"[bus.NAME]"});
  expect_error(further(bus, replaced(role, "\"diag\"", "\"dia\"")), "signals.engine_torque.bus",
               {"diag"}, 0, 78, 1);
  expect_error(further(bus, replaced(role, "\"diag\"", "1")), "signals.engine_torque.bus",
               {"quotes"});
  expect_error(further(bus + dbc, role), "signals.engine_torque", {"0x12345678x"});
  expect_error(further("[bus.diag]\n", role), "bus.diag", {"interface"});
  expect_error(further(replaced(bus, "can1", "can0"), role), "bus.diag.interface", {"can0"});
  expect_error(further(replaced(bus, "can1", "a/b"), role), "bus.diag.interface", {"a/b"});
  expect_error(further(replaced(bus, "can1", "inproc:x"), role), "bus.diag.interface",
               {"SocketCAN"});
  expect_error(further(bus + "dbs = []\n", role), "bus.diag.dbs", {"dbc"});
  expect_error(further(bus + "[bus.more]\ninterface = \"can2\"\n", role), "bus.more", {"third"});
  expect_error(further(bus + "dbc = [\"gone.dbc\"]\n", role), "bus.diag.dbc", {"gone.dbc"}, 0, 66);
}

// What a diagnosis counts with: of a sensor that nobody speaks of beside others, what is met in
// cars.
TEST_F(ConfigTest, ASensorLeftOutBesideOthersIsAsInOtherCars) {
  const ConfigResult result =
      load(with("sensors", "primary_torque = { bias_Nm = 0.4 }\nprimary_speed = { gain = 1e-4 }"));
  ASSERT_TRUE(result.config.has_value());
  const auto stated = [&](Role role) { return result.stated[static_cast<std::size_t>(role)]; };
  EXPECT_EQ(stated(Role::kPrimaryTorque).bias, 0.4);
  EXPECT_EQ(stated(Role::kPrimaryTorque).gain, 0.01);
  EXPECT_EQ(stated(Role::kPrimarySpeed).gain, 1e-4);
  EXPECT_EQ(stated(Role::kSecondaryPressure).bias, 30e3);
  EXPECT_EQ(stated(Role::kSecondaryPressure).gain, 0.0125);
  const auto assumed = [&](const std::string& key) {
    return std::count_if(result.assumed.begin(), result.assumed.end(),
                         [&](const AssumedAccuracy& each) { return each.key == key; });
  };
  EXPECT_EQ(assumed("sensors.secondary_pressure.bias_Pa"), 1);
  EXPECT_EQ(assumed("sensors.primary_torque.gain"), 1);
  EXPECT_EQ(assumed("sensors.primary_torque.bias_Nm"), 0);
}

TEST_F(ConfigTest, WhereNoSensorIsSpokenOfNothingIsAssumedOfThem) {
  const ConfigResult result = load(test::kVehicleToml);
  ASSERT_TRUE(result.config.has_value());
  EXPECT_TRUE(result.assumed.empty());
  for (const estimator::ChannelAccuracy& each : result.stated) {
    EXPECT_EQ(each.bias, 0.0);
    EXPECT_EQ(each.gain, 0.0);
  }
}

TEST_F(ConfigTest, ProtectionOfAMessage) {
  const ConfigResult result =
      load(with("protection", "Flags = { counter = \"ExperimentActive\", counter_max = 2 }\n"));
  ASSERT_TRUE(result.config.has_value()) << result.errors.at(0).text;
  ASSERT_EQ(result.config->protections.size(), 1U);
  EXPECT_EQ(result.config->protections[0].counter->maximum, 2U);
  EXPECT_FALSE(result.config->protections[0].crc.has_value());
}

TEST_F(ConfigTest, MistakesInAProtection) {
  const auto expect = [&](const std::string& line, const std::string& key,
                          const std::vector<std::string>& words) {
    expect_error(with("protection", line), "protection." + key, words);
  };
  expect("Fags = { counter = \"Permitted\" }", "Fags", {"that no DBC names", "\"Flags\""});
  expect("Flags = 3", "Flags", {"found 3"});
  expect("Flags = {}", "Flags", {"neither counter nor crc"});
  expect("Flags = { counter = \"Nothing\" }", "Flags.counter", {"\"Nothing\"", "up to 8 bits"});
  expect("Speeds = { counter = \"PrimarySpeed\" }", "Speeds.counter", {"up to 8 bits"});
  expect("Flags = { counter = \"ExperimentActive\", counter_max = 4 }", "Flags.counter_max",
         {"found 4", "from 1 to 3"});
  expect("Flags = { counter = \"ExperimentActive\", data_id = 1 }", "Flags", {"no crc"});
  expect("Flags = { counter = \"ExperimentActive\", max = 3 }", "Flags.max", {"an unknown key"});
  expect("Flags = { crc = \"ExperimentActive\", data_id = 1 }", "Flags.crc", {"one byte"});
}

TEST_F(ConfigTest, TheShippedDefaultFileIsTheGeneratedOne) {
  std::ifstream in(std::string(BELTGRIP_SOURCE_DIR) + "/systemd/beltgripd.toml");
  const std::string shipped{std::istreambuf_iterator<char>(in), {}};
  EXPECT_EQ(shipped, default_config_text()) << "write it with beltgripd --print-default-config";
}

}  // namespace
}  // namespace beltgrip::daemon
