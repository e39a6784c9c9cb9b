// beltgrip calibrate as users call it: a log in, keys out that the configuration takes.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/calibrate/drive.h"
#include "tests/tools/program.h"

namespace beltgrip::test {
namespace {

class Calibrate : public testing::Test {
 protected:
  Calibrate() {
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

TEST_F(Calibrate, WritesKeysThatAreTaken) {
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

TEST_F(Calibrate, RefusesWithAReasonForEachKey) {
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

TEST_F(Calibrate, MissingFilesAreOneLine) {
  const RunResult result = calibrate({});
  EXPECT_EQ(result.status, 66);
  EXPECT_EQ(lines(result.err), 1) << result.err;
}

}  // namespace
}  // namespace beltgrip::test
