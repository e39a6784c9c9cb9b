// Tables of signals through check, calibrate and replay: the same drive as frames and as tables
// gives the same answers.
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/support/program.h"

namespace beltgrip::test {
namespace {

using nlohmann::json;

bool has(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

class TableCli : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    place_ = std::make_unique<Workplace>();
    ASSERT_EQ(
        beltgrip({"simulate", "--scenario", "paper-rig", "--start", "70", "--out-dir", path("rig")})
            .status,
        0);
  }
  static void TearDownTestSuite() { place_.reset(); }
  static std::string path(const std::string& name) { return place_->path(name); }

  static json first(const std::string& log, const std::string& toml) {
    const RunResult result = beltgrip({"replay", log, "--config", toml, "--json", "-"});
    EXPECT_EQ(result.status, 0) << result.err;
    return json::parse(result.out.substr(0, result.out.find('\n')));
  }

  static std::unique_ptr<Workplace> place_;
};
std::unique_ptr<Workplace> TableCli::place_;

TEST_F(TableCli, DecodedFramesReplayLikeTheFrames) {
  const std::string toml = path("rig/beltgrip.toml");
  ASSERT_EQ(beltgrip({"dbc", "decode", "--dbc", path("rig/vehicle.dbc"), path("rig/trace.log"),
                      "--csv", path("decoded.csv")})
                .status,
            0);
  const json frames = first(path("rig/trace.log"), toml);
  const json table = first(path("decoded.csv"), toml);
  ASSERT_EQ(frames["outcome"], "completed");
  EXPECT_EQ(table["outcome"], "completed");
  // The same values at the same times; what the DBC rounds, the decimals of the table do.
  EXPECT_NEAR(table["mu_max"].get<double>(), frames["mu_max"].get<double>(), 2e-4);
  EXPECT_NEAR(table["stop_s"].get<double>() - table["start_s"].get<double>(),
              frames["stop_s"].get<double>() - frames["start_s"].get<double>(), 0.02);
}

// A share has the unit 1 there.
TEST_F(TableCli, SignalsOutOfACarAreCheckedAgain) {
  ASSERT_EQ(
      beltgrip({"simulate", "--scenario", "coast-overdrive-unreachable", "--out-dir", path("car")})
          .status,
      0);
  const std::string toml = path("car/beltgrip.toml");
  ASSERT_EQ(beltgrip({"replay", path("car/trace.log"), "--config", toml, "--signals-out",
                      path("car.csv")})
                .status,
            0);
  const RunResult result = beltgrip({"check", path("car.csv"), "--config", toml, "--json", "-"});
  ASSERT_EQ(result.status, 0) << result.err;
  const json found = json::parse(result.out);
  EXPECT_EQ(found["roles"]["accelerator_pedal"]["unit"], "1");
  EXPECT_EQ(found["ready"], "observe");
  EXPECT_TRUE(has(found["sentence"], "force floor 2,2")) << found["sentence"];
}

// Its own columns are called like the roles.
TEST_F(TableCli, SignalsOutAreReadAgain) {
  const std::string toml = path("rig/beltgrip.toml");
  ASSERT_EQ(beltgrip({"replay", path("rig/trace.log"), "--config", toml, "--signals-out",
                      path("wide.csv")})
                .status,
            0);
  const json table = first(path("wide.csv"), toml);
  EXPECT_EQ(table["outcome"], "completed");
  EXPECT_NEAR(table["mu_max"].get<double>(), 0.105, 0.004);  // the scenario's
}

// Its decimal points are commas now, like what parts its cells.
TEST_F(TableCli, ATableThatIsNothingButRowsOfTooManyCellsCannotBeUsed) {
  const std::string toml = path("rig/beltgrip.toml");
  std::string csv =
      "t[s],primary_speed[rad/s],secondary_speed[rad/s],secondary_pressure[Pa],"
      "primary_torque[Nm]\n";
  for (int i = 0; i < 40; ++i) csv += "0," + std::to_string(10 + i) + ",100,5,225,5,1000,20\n";
  place_->write("commas.csv", csv);
  for (const char* command : {"replay", "check", "calibrate"}) {
    const RunResult result = beltgrip({command, path("commas.csv"), "--config", toml});
    EXPECT_EQ(result.status, 65) << command << result.out;
    EXPECT_TRUE(has(result.err,
                    "commas.csv: no readable frame in 41 lines, line 2: more cells "
                    "than the header has; expected decimal points"))
        << result.err;
  }
}

// What is no unit of time was read as seconds.
TEST_F(TableCli, ATimeInAnotherUnitIsRefused) {
  const std::string toml = path("rig/beltgrip.toml");
  const std::string roles =
      "primary_speed[rad/s],secondary_speed[rad/s],secondary_pressure[Pa],primary_torque[Nm]\n";
  const auto rows = [](bool clock) {
    std::string csv;
    for (int i = 10; i < 50; ++i) {
      csv += (clock ? "10:00:" : "") + std::to_string(i) + ",100,225,1000000,20\n";
    }
    return csv;
  };
  const auto check = [&](const std::string& csv) {
    place_->write("unit.csv", csv);
    return beltgrip({"check", path("unit.csv"), "--config", toml});
  };
  for (const char* unit : {"bar", "furlong", "rad/s"}) {
    const RunResult result = check("# a rig\nt[" + std::string(unit) + "]," + roles + rows(false));
    EXPECT_EQ(result.status, 65) << unit << result.out;
    EXPECT_TRUE(has(result.err, "unit.csv:2: time in '" + std::string(unit) +
                                    "', expected s, ms, us, ns, min or h, as in t[s]"))
        << result.err;
  }
  const RunResult row = check("Time," + roles + "bar,,,,\n" + rows(false));
  EXPECT_EQ(row.status, 65) << row.out;
  EXPECT_TRUE(has(row.err, "unit.csv:2: time in 'bar'")) << row.err;
  for (const char* unit : {"t[s],", "t[ms],", "t,", "t[-],", "Time (us),"}) {
    EXPECT_EQ(check(unit + roles + rows(false)).status, 0) << unit;
  }
  EXPECT_EQ(check("Time [hh:mm:ss]," + roles + rows(true)).status, 0) << "they say it themselves";
}

// As scan tools write them: a row of units, comments, texts, columns of no role, no time.
std::string scan_table() {
  std::ostringstream out;
  out << "# Some scan tool\n"
         "Record,Primary Rev Speed,Secondary Rev Speed,Actual Secondary Pressure,ATF Temp.,"
         "Stop Light Switch,Gear\n"
         "Unit,rpm,rpm,MPa,degree C,,\n";
  for (int i = 0; i < 200; ++i) {
    const double primary = 1500.0 + 300.0 * std::sin(0.1 * i);
    const double ratio = i < 100 ? 0.45 + 0.018 * i : 2.25;
    out << i << ',' << std::lround(primary) << ',' << std::lround(ratio * primary) << ','
        << (i % 7 == 0 ? "0.95" : "0.80") << ",27.00," << (i % 20 == 0 ? "ON" : "OFF") << ",D\n";
  }
  return out.str();
}
constexpr const char* kScanToml = R"(
[signals]
primary_speed      = { column = "Primary Rev Speed" }
secondary_speed    = { column = "Secondary Rev Speed", unit = "1/min" }
secondary_pressure = { column = "Actual Secondary Pressure" }
oil_temperature    = { column = "ATF Temp." }
brake_pressed      = { column = "Stop Light Switch" }
lockup_closed      = { column = "Lock-up" }
)";

TEST_F(TableCli, ATableOfAScanTool) {
  place_->write("scan.csv", scan_table());
  place_->write("scan.toml", kScanToml);
  const RunResult untimed = beltgrip({"check", path("scan.csv"), "--config", path("scan.toml")});
  EXPECT_EQ(untimed.status, 65);
  EXPECT_TRUE(has(untimed.err, "table of 7 signals without a time column, expected one"))
      << untimed.err;
  EXPECT_TRUE(has(untimed.err, "--rate HZ")) << untimed.err;

  const RunResult result = beltgrip(
      {"check", path("scan.csv"), "--rate", "2", "--config", path("scan.toml"), "--json", "-"});
  ASSERT_EQ(result.status, 0) << result.err;
  const json found = json::parse(result.out);
  EXPECT_EQ(found["ready"], "none");
  EXPECT_TRUE(has(found["sentence"], "engine_torque")) << found["sentence"];
  const json& roles = found["roles"];
  EXPECT_EQ(roles["primary_speed"]["message"], "Primary Rev Speed");
  EXPECT_NEAR(roles["primary_speed"]["rate_Hz"], 2.0, 1e-6);
  EXPECT_EQ(roles["primary_speed"]["frames"], 200);
  EXPECT_EQ(roles["primary_speed"]["unit"], "rpm");
  EXPECT_EQ(roles["secondary_speed"]["unit"], "1/min");
  EXPECT_EQ(roles["secondary_pressure"]["unit"], "MPa");
  EXPECT_NEAR(roles["secondary_pressure"]["largest"], 0.95, 1e-9);
  EXPECT_NEAR(roles["secondary_pressure"]["step"], 0.15, 1e-9);
  EXPECT_EQ(roles["brake_pressed"]["least"], 0.0);
  EXPECT_EQ(roles["brake_pressed"]["largest"], 1.0);
  EXPECT_FALSE(roles["lockup_closed"]["seen"]);
  EXPECT_TRUE(has(roles["lockup_closed"]["findings"].dump(), "no column")) << roles;

  EXPECT_EQ(beltgrip({"calibrate", path("scan.csv"), "--rate", "2", "--config", path("scan.toml")})
                .status,
            0);
  const RunResult replayed =
      beltgrip({"replay", path("scan.csv"), "--rate", "2", "--config", path("scan.toml")});
  EXPECT_EQ(replayed.status, 65);
  EXPECT_TRUE(has(replayed.err, "no column for engine_torque")) << replayed.err;
}

// Rows that come seldom are no pauses.
TEST_F(TableCli, ASlowTableHasNoPauses) {
  std::string csv =
      "primary_speed[rpm],secondary_speed[rpm],secondary_pressure[bar],primary_torque[Nm]\n";
  for (int i = 0; i < 40; ++i) csv += std::to_string(1000 + i) + ",2000,10,30\n";
  place_->write("slow.csv", csv);
  const RunResult result =
      beltgrip({"check", path("slow.csv"), "--rate", "0.2", "--config", path("rig/beltgrip.toml")});
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_TRUE(has(result.out, "slower than 10 Hz")) << result.out;
  EXPECT_FALSE(has(result.out, "no frame at all came")) << result.out;
}

TEST_F(TableCli, WhatDoesNotGoTogether) {
  place_->write("scan.csv", scan_table());
  place_->write("timed.csv", "t[s],a[rpm],b\n0,1,2\n1,2,3\n");
  place_->write("scan.toml", kScanToml);
  const auto status = [](std::vector<std::string> command) { return beltgrip(command).status; };
  const std::string toml = path("scan.toml");
  EXPECT_EQ(status({"check", path("timed.csv"), "--rate", "2", "--config", toml}), 64);
  EXPECT_EQ(status({"check", path("rig/trace.log"), "--rate", "2", "--config", toml}), 64);
  EXPECT_EQ(
      status({"check", path("scan.csv"), path("rig/trace.log"), "--rate", "2", "--config", toml}),
      64);
  // Columns alone are no signals of a bus.
  const RunResult bus = beltgrip({"check", "--config", toml});
  EXPECT_EQ(bus.status, 78);
  place_->write("wrong.toml", "[signals]\nsecondary_pressure = { column = \"ATF Temp.\" }\n");
  const RunResult unit =
      beltgrip({"check", path("scan.csv"), "--rate", "2", "--config", path("wrong.toml")});
  EXPECT_EQ(unit.status, 78);
  EXPECT_TRUE(has(unit.err,
                  "wrong.toml:2: signals.secondary_pressure: found unit \"degree C\" in the table "
                  "(temperature), expected a unit of pressure such as Pa; set unit in { column = "
                  "\"...\", unit = \"...\" }"))
      << unit.err;
  // A column that is called like the role says its unit itself; the key stands further down.
  place_->write("bar.csv", "t[s],primary_speed[bar]\n0,1\n1,2\n");
  place_->write("role.toml", "[signals]\n# speeds\nprimary_speed = \"TCU_Speed.PrimarySpeed\"\n");
  const RunResult role = beltgrip({"check", path("bar.csv"), "--config", path("role.toml")});
  EXPECT_EQ(role.status, 78);
  EXPECT_TRUE(has(role.err,
                  "role.toml:3: signals.primary_speed: found unit \"bar\" in the table (pressure), "
                  "expected a unit of angular speed such as rad/s; set it in the header, as in "
                  "primary_speed[rad/s]"))
      << role.err;
}

}  // namespace
}  // namespace beltgrip::test
