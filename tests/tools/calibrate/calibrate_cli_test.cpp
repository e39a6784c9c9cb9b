// beltgrip calibrate as users call it: a log in, keys out that the configuration takes.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>

#include "daemon/core/config/load/load_config.h"
#include "daemon/core/config/options/config.h"
#include "tests/support/program.h"
#include "tests/tools/calibrate/drive.h"

namespace beltgrip::test {
namespace {

class CalibrateCommand : public testing::Test {
 protected:
  CalibrateCommand() {
    place.write("drive.dbc", kDriveDbc);
    place.write("beltgrip.toml", kDriveToml);
  }
  RunResult calibrate(std::vector<std::string> more) const {
    more.insert(more.begin(),
                {"calibrate", place.path("drive.log"), "--config", place.path("beltgrip.toml")});
    return beltgrip(more);
  }
  Workplace place;
};

// The shipped traffic, with kick-downs: a ratio that moves quickly passes for no inertia. And with
// brakes, pressed while the torque still falls: a load that comes as fast as the torque goes.
TEST_F(CalibrateCommand, TheShippedCityDriveTellsInertiaAndDelay) {
  for (const auto& [seed, lag_s] : {std::pair{"11", "0.06"}, {"21", "0.15"}, {"31", "0.15"}}) {
    SCOPED_TRACE(std::string(seed) + " " + lag_s);
    const std::string at = place.path(seed) + "/";
    ASSERT_EQ(beltgrip({"simulate", "--scenario", "city", "--seed", seed, "--set",
                        std::string("engine.torque_lag_s=") + lag_s, "--out-dir", at})
                  .status,
              0);
    const RunResult result =
        beltgrip({"calibrate", at + "trace.log", "--config", at + "beltgrip.toml", "--json", "-"});
    ASSERT_EQ(result.status, 0) << result.err;
    const auto json = nlohmann::json::parse(result.out);
    int found = 0;
    for (const auto& each : json["findings"]) {
      const bool is_delay = each["key"] == "delay.engine_torque";
      if (!is_delay && each["key"] != "variator.primary_inertia_kg_m2") continue;
      ASSERT_FALSE(each["value"].is_null()) << each;
      ++found;
      // Of coast-overdrive.toml: torque_delay_s; engine and primary pulley.
      const double truth = is_delay ? 0.03 : 0.14 + 0.04;
      EXPECT_LE(each["ci95"][0].get<double>(), truth) << each;
      EXPECT_GE(each["ci95"][1].get<double>(), truth) << each;
      EXPECT_NEAR(each["value"].get<double>(), truth, is_delay ? 0.01 : 0.005) << each;
    }
    EXPECT_EQ(found, 2);
  }
}

TEST_F(CalibrateCommand, WritesKeysThatAreTaken) {
  DriveTruth truth;
  truth.ratio_overdrive = 2.262;
  place.write("drive.log", drive_log(drive(truth, {}, 3)));
  const RunResult result =
      calibrate({"--out", place.path("out.toml"), "--json", place.path("out.json")});
  ASSERT_EQ(result.status, 0) << result.err;
  EXPECT_NE(result.out.find("variator.ratio_overdrive: 2.2"), std::string::npos) << result.out;
  const auto json = nlohmann::json::parse(place.read("out.json"));
  for (const auto& each : json["findings"]) {
    if (each["key"] != "variator.ratio_overdrive") continue;
    EXPECT_NEAR(each["value"].get<double>(), 2.262, 0.006);
    EXPECT_LE(each["ci95"][0].get<double>(), 2.262);
    EXPECT_GE(each["ci95"][1].get<double>(), 2.262);
  }
  // The keys in a configuration: the same log then reads no pressure at its key-on.
  std::string config = kDriveToml;
  for (const std::string role : {"secondary_pressure", "secondary_speed", "engine_torque"}) {
    const std::size_t line = config.find("\n" + role + " = ") + 1;
    config.erase(line, config.find('\n', line) + 1 - line);
  }
  std::string keys = place.read("out.toml");
  const std::string header = "[signals]\n";
  const std::size_t signals = keys.find(header);
  ASSERT_NE(signals, std::string::npos) << keys;
  const std::size_t end = keys.find("\n[sensors]");
  ASSERT_NE(end, std::string::npos) << keys;
  const std::size_t line = signals + header.size();
  config.insert(config.find("[experiment]"), keys.substr(line, end - line));
  place.write("beltgrip.toml", config + keys.substr(end));
  const RunResult again = calibrate({"--json", "-"});
  ASSERT_EQ(again.status, 0) << again.err << place.read("beltgrip.toml");
  const auto found = nlohmann::json::parse(again.out);
  for (const auto& each : found["findings"]) {
    if (each["key"] == "signals.secondary_pressure") {
      EXPECT_NEAR(each["value"].get<double>(), 0.0, 1.0);
    } else if (each["key"] == "delay.secondary_speed" || each["key"] == "delay.engine_torque") {
      ASSERT_FALSE(each["value"].is_null()) << each;
      // The delays of 4 ms and 30 ms are taken out, as far as they were told.
      EXPECT_LT(std::abs(each["value"].get<double>()), 2.0 * each["std"].get<double>()) << each;
      EXPECT_LT(std::abs(each["value"].get<double>()), 0.01) << each;
    }
  }
}

// As it stands, after the configuration; in the user's units; with what he stated beside it.
TEST_F(CalibrateCommand, WritesAFileToInclude) {
  place.write("drive.log", drive_log(drive({}, {}, 3)));
  std::string config = kDriveToml;
  const auto change = [&](const std::string& what, const std::string& by) {
    config.replace(config.find(what), what.size(), by);
  };
  change("\"Pressure.Secondary\"",
         "{ signal = \"Pressure.Secondary\", unit = \"kPa\", scale = 0.001 }");
  place.write("beltgrip.toml", config + "[sensors]\nsecondary_pressure = { gain = 0.02 }\n");
  ASSERT_EQ(calibrate({"--out", place.path("calibrated.toml")}).status, 0);
  const std::string keys = place.read("calibrated.toml");
  const std::string pressure =
      "secondary_pressure = { signal = \"Pressure.Secondary\", unit = \"kPa\", scale = 0.001, "
      "offset = -";
  EXPECT_NE(keys.find(pressure + "29.9"), std::string::npos) << keys;  // what it reads at none
  EXPECT_NE(keys.find("gain = 0.02 }"), std::string::npos) << keys;
  EXPECT_NE(keys.find("secondary_speed = { signal = \"Speeds.Secondary\", unit = \"rad/s\", "
                      "period_ms = 10.0, delay_ms = "),
            std::string::npos)
      << keys;
  EXPECT_EQ(keys.find("scale = 1.0"), std::string::npos) << keys;
  place.write("both.toml", "include = [\"beltgrip.toml\", \"calibrated.toml\"]\n");
  const auto both = daemon::load_config(place.path("both.toml"));
  ASSERT_TRUE(both.config.has_value()) << both.errors[0].text;
  EXPECT_NEAR(both.config->variator.primary_inertia_kg_m2, 0.18, 0.02);
}

// The same drive as a table: the lines name what the table's reader takes, and where the columns
// are called like message and signal, whoever reads frames as well.
TEST_F(CalibrateCommand, WritesForATableWhatItsReaderTakes) {
  place.write("drive.log", drive_log(drive({}, {}, 3)));
  const std::string table = place.path("table.csv");
  ASSERT_EQ(beltgrip({"dbc", "decode", place.path("drive.log"), "--dbc", place.path("drive.dbc"),
                      "--csv", table})
                .status,
            0);
  const auto calibrated = [&](const char* out) {
    return beltgrip(
        {"calibrate", table, "--config", place.path("beltgrip.toml"), "--out", place.path(out)});
  };
  ASSERT_EQ(calibrated("signals.toml").status, 0);
  const std::string signals = place.read("signals.toml");
  EXPECT_NE(signals.find("secondary_speed = { signal = \"Speeds.Secondary\","), std::string::npos)
      << signals;
  place.write("both.toml", "include = [\"beltgrip.toml\", \"signals.toml\"]\n");
  EXPECT_TRUE(daemon::load_config(place.path("both.toml")).config.has_value());

  std::string named = place.read("table.csv");
  const std::string column = "Speeds.Secondary";
  named.replace(named.find(column), column.size(), "secondary_speed[rad/s]");
  place.write("table.csv", named);
  ASSERT_EQ(calibrated("columns.toml").status, 0);
  const std::string columns = place.read("columns.toml");
  EXPECT_NE(columns.find("secondary_speed = { column = \"secondary_speed\","), std::string::npos)
      << columns;
}

// From quick engines to slow ones, through a log: the steps are found, and what they say is true.
TEST_F(CalibrateCommand, FindsInertiaAndDelayFromQuickAndSlowSteps) {
  // Steps of 20 ms move the speeds so fast that a daemon takes them for spikes.
  for (const auto& [lag_s, seed] :
       {std::pair{0.02, 3U}, {0.02, 5U}, {0.02, 8U}, {0.15, 5U}, {0.15, 8U}}) {
    DriveKind kind;
    kind.engine_lag_s = lag_s;
    kind.torque_rate_Nm_s = 1e9;
    place.write("drive.log", drive_log(drive({}, kind, seed)));
    const RunResult result = calibrate({"--json", "-"});
    ASSERT_EQ(result.status, 0) << result.err;
    const auto found = nlohmann::json::parse(result.out);
    for (const auto& each : found["findings"]) {
      const bool is_delay = each["key"] == "delay.engine_torque";
      if (!is_delay && each["key"] != "variator.primary_inertia_kg_m2") continue;
      ASSERT_FALSE(each["value"].is_null()) << lag_s << each;
      const double truth = is_delay ? 0.03 : 0.18;
      EXPECT_LE(each["ci95"][0].get<double>(), truth) << lag_s << each;
      EXPECT_GE(each["ci95"][1].get<double>(), truth) << lag_s << each;
      EXPECT_NEAR(each["value"].get<double>(), truth, is_delay ? 0.01 : 0.03) << lag_s << each;
    }
  }
}

// Whatever the drive says.
TEST_F(CalibrateCommand, WritesNothingThatItsLoaderRefuses) {
  // A torque that is configured as 190 ms late already: 30 ms more is beyond the loader's range.
  place.write("drive.log", drive_log(drive({}, {}, 3)));
  std::string config = kDriveToml;
  const std::string torque = "engine_torque = \"Torque.Engine\"";
  config.replace(config.find(torque), torque.size(),
                 "engine_torque = { signal = \"Torque.Engine\", delay_ms = 190.0 }");
  place.write("beltgrip.toml", config);
  ASSERT_EQ(calibrate({"--out", place.path("calibrated.toml")}).status, 0);
  const std::string keys = place.read("calibrated.toml");
  place.write("both.toml", "include = [\"beltgrip.toml\", \"calibrated.toml\"]\n");
  const auto both = daemon::load_config(place.path("both.toml"));
  EXPECT_TRUE(both.config.has_value()) << both.errors[0].text << keys;
}

// The pressure in answers to the daemon's requests on a second interface, instead of in the
// broadcast; its four bytes are the same, and come to `kAnswerMore_kPa` more.
constexpr double kAnswerMore_kPa = 12.5;
constexpr const char* kAnswerRole =
    "{ uds = { request = 0x18DA10F1, response = 0x18DAF110, did = 0x1101, start = 0, length = 32, "
    "byte_order = \"little\", signed = true, scale = 1e-5, offset = 12.5 }, unit = \"kPa\", "
    "period_ms = 20.0, delay_ms = 1.5, bus = \"diag\" }";

std::string in_answers(const std::string& broadcast) {
  std::istringstream stream(broadcast);
  std::string log;
  for (std::string line; std::getline(stream, line);) {
    const std::size_t at = line.find("can0 101#");
    if (at != std::string::npos) {
      log += line.substr(0, at) + "can1 18DA10F1#03221101CCCCCCCC\n";
      line.replace(at, 9, "can1 18DAF110#07621101");
    }
    log += line + '\n';
  }
  return log;
}

// `config` with the value of a role replaced.
std::string with_role(std::string config, const std::string& role, const std::string& value) {
  const std::size_t begin = config.find("\n" + role + " = ") + role.size() + 4;
  return config.replace(begin, config.find('\n', begin) - begin, value);
}

const daemon::RoleBinding& pressure_of(const daemon::Config& config) {
  for (const daemon::RoleBinding& each : config.roles) {
    if (each.role == daemon::Role::kSecondaryPressure) return each;
  }
  throw std::runtime_error("no secondary_pressure");
}

TEST_F(CalibrateCommand, PressureFromDiagnosticsIsCalibratedAndWrittenWhole) {
  DriveKind kind;
  kind.duration_s = 60.0;
  const std::string broadcast = drive_log(drive({}, kind, 3));
  place.write("drive.log", broadcast);
  place.write("beltgrip.toml", with_role(kDriveToml, "secondary_pressure",
                                         "{ signal = \"Pressure.Secondary\", delay_ms = 1.5 }"));
  const RunResult truth = calibrate({"--json", "-"});
  ASSERT_EQ(truth.status, 0) << truth.err;

  std::string config = with_role(kDriveToml, "secondary_pressure", kAnswerRole);
  config.insert(config.find("[signals]"),
                "diagnostics = \"poll\"\n[bus.diag]\ninterface = \"can1\"\n");
  place.write("beltgrip.toml", config);
  place.write("drive.log", in_answers(broadcast));
  const RunResult result =
      calibrate({"--out", place.path("out.toml"), "--json", place.path("out.json")});
  ASSERT_EQ(result.status, 0) << result.err;
  const auto expected = nlohmann::json::parse(truth.out)["findings"];
  const auto found = nlohmann::json::parse(place.read("out.json"))["findings"];
  ASSERT_EQ(found.size(), expected.size());
  double zero_Pa = std::numeric_limits<double>::quiet_NaN();
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_EQ(found[i]["key"], expected[i]["key"]);
    ASSERT_EQ(found[i]["value"].is_null(), expected[i]["value"].is_null()) << found[i];
    if (found[i]["value"].is_null()) continue;
    const bool zero = found[i]["key"] == "signals.secondary_pressure";
    const double wanted = expected[i]["value"].get<double>() + (zero ? 1e3 * kAnswerMore_kPa : 0.0);
    const double value = found[i]["value"].get<double>();
    if (zero) zero_Pa = value;
    EXPECT_NEAR(value, wanted, 1e-6 * std::abs(wanted)) << found[i];
  }
  // The drive's sensor reads 30 kPa at none.
  EXPECT_NEAR(zero_Pa, 30e3 + 1e3 * kAnswerMore_kPa, 300.0);

  // The line in the configuration: the daemon takes it, and it is the same source, less the zero.
  const std::string written = place.read("out.toml");
  const std::string name = "\nsecondary_pressure = { uds";
  const std::size_t line = written.find(name);
  ASSERT_NE(line, std::string::npos) << written;
  const std::size_t value = line + name.size() - 5;
  const auto before = daemon::load_config(place.path("beltgrip.toml"));
  place.write("beltgrip.toml", with_role(config, "secondary_pressure",
                                         written.substr(value, written.find('\n', value) - value)));
  const auto after = daemon::load_config(place.path("beltgrip.toml"));
  ASSERT_TRUE(before.config && after.config) << after.errors.at(0).text;
  const daemon::RoleBinding& was = pressure_of(*before.config);
  const daemon::RoleBinding& is = pressure_of(*after.config);
  ASSERT_TRUE(is.uds);
  EXPECT_EQ(is.uds->request, was.uds->request);
  EXPECT_EQ(is.uds->response, was.uds->response);
  EXPECT_EQ(is.uds->identifier, was.uds->identifier);
  EXPECT_EQ(is.uds->signal.start_bit, was.uds->signal.start_bit);
  EXPECT_EQ(is.uds->signal.length, was.uds->signal.length);
  EXPECT_EQ(is.uds->signal.byte_order, was.uds->signal.byte_order);
  EXPECT_EQ(is.uds->signal.type, was.uds->signal.type);
  EXPECT_EQ(is.bus, was.bus);
  EXPECT_EQ(is.period_ms, was.period_ms);
  EXPECT_EQ(is.delay_ms, was.delay_ms);
  for (const double raw : {-30e5, 0.0, 12e7}) {
    const auto si = [&](const daemon::RoleBinding& role) {
      const can::SignalDef& signal = role.uds->signal;
      return role.factor * (signal.scale * raw + signal.offset) + role.shift;
    };
    EXPECT_NEAR(si(is), si(was) - zero_Pa, 1e-6) << raw;
  }
  const RunResult again = calibrate({"--json", "-"});
  ASSERT_EQ(again.status, 0) << again.err;
  const auto settled = nlohmann::json::parse(again.out);
  for (const auto& each : settled["findings"]) {
    if (each["key"] != "signals.secondary_pressure") continue;
    EXPECT_NEAR(each["value"].get<double>(), 0.0, 1.0);
  }
}

TEST_F(CalibrateCommand, RefusesWithAReasonForEachKey) {
  DriveKind kind;
  kind.duration_s = 5.0;
  kind.key_on = false;
  place.write("drive.log", drive_log(drive({}, kind, 3)));
  const RunResult result = calibrate({"--out", "-"});
  EXPECT_EQ(result.status, 0) << result.err;
  for (const char* key : {"variator.ratio_low", "variator.ratio_overdrive",
                          "signals.secondary_pressure", "variator.primary_inertia_kg_m2"}) {
    EXPECT_NE(result.out.find("# " + std::string(key) + " is not written: "), std::string::npos)
        << result.out;
  }
}

TEST_F(CalibrateCommand, MissingFilesAreOneLine) {
  const RunResult result = calibrate({});
  EXPECT_EQ(result.status, 66);
  EXPECT_EQ(lines(result.err), 1) << result.err;
}

}  // namespace
}  // namespace beltgrip::test
