// beltgrip check as users call it: healthy drives without a false alarm, and one mistake after the
// other. What is wrong is known, for the test did it.
#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>

#include "tests/support/program.h"
#include "tests/tools/check/drive_log.h"

namespace beltgrip::test {
namespace {

using nlohmann::json;

bool has(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}
// The findings that contain a part.
int count(const json& findings, const std::string& part) {
  int found = 0;
  for (const auto& each : findings) found += has(each.get<std::string>(), part) ? 1 : 0;
  return found;
}

class Check : public testing::Test {
 protected:
  // A drive is simulated once for all tests.
  struct Drive {
    std::string log, toml, dbc;
  };
  static const Drive& drive(const std::string& scenario, const std::string& duration = "") {
    static std::map<std::string, Drive> drives;
    Drive& drive = drives[scenario + duration];
    if (!drive.log.empty()) return drive;
    const Workplace at;
    std::vector<std::string> command{"simulate", "--scenario", scenario, "--out-dir",
                                     at.path("drive")};
    if (!duration.empty()) {
      command.emplace_back("--duration");
      command.push_back(duration);
    }
    EXPECT_EQ(beltgrip(command).status, 0);
    drive = {at.read("drive/trace.log"), at.read("drive/beltgrip.toml"),
             at.read("drive/vehicle.dbc")};
    return drive;
  }
  static const Drive& city() { return drive("city", "420"); }

  json check(const Drive& drive) const {
    place.write("trace.log", drive.log);
    place.write("beltgrip.toml", drive.toml);
    place.write("vehicle.dbc", drive.dbc);
    const RunResult text =
        beltgrip({"check", place.path("trace.log"), "--config", place.path("beltgrip.toml")});
    EXPECT_EQ(text.status, 0) << text.err;
    for (std::size_t at = 0; at < text.out.size();) {
      const std::size_t end = text.out.find('\n', at);
      const std::string line = text.out.substr(at, end - at);
      if (!has(line, place.path(""))) {
        EXPECT_LE(line.size(), 100u) << line;
      }
      at = end + 1;
    }
    const RunResult result = beltgrip(
        {"check", place.path("trace.log"), "--config", place.path("beltgrip.toml"), "--json", "-"});
    EXPECT_EQ(result.status, 0) << result.err;
    return json::parse(result.out);
  }
  std::string text_of(const Drive& drive) const {
    place.write("trace.log", drive.log);
    place.write("beltgrip.toml", drive.toml);
    place.write("vehicle.dbc", drive.dbc);
    return beltgrip({"check", place.path("trace.log"), "--config", place.path("beltgrip.toml")})
        .out;
  }
  static std::string with_role(const std::string& toml, const std::string& role,
                               const std::string& right) {
    const std::size_t at = toml.find("\n" + role + " ");
    EXPECT_NE(at, std::string::npos);
    const std::size_t end = toml.find('\n', at + 1);
    return toml.substr(0, at + 1) + (right.empty() ? "" : role + " = " + right) + toml.substr(end);
  }

  Workplace place;
};

TEST_F(Check, FindsNothingWrongWithAnyShippedDrive) {
  for (const char* scenario :
       {"coast-low", "coast-overdrive", "coast-overdrive-unreachable", "cold-oil",
        "cruise-drive-torque", "demo", "paper-rig", "worn-belt"}) {
    SCOPED_TRACE(scenario);
    const json found = check(drive(scenario));
    EXPECT_EQ(found["across"].size(), 0u) << found["across"];
    for (const auto& [role, of] : found["roles"].items()) {
      EXPECT_EQ(count(of["findings"], "wrong: ") + count(of["findings"], "may be: "), 0)
          << role << of["findings"];
      EXPECT_TRUE(of["seen"]);
      EXPECT_EQ(of["crc_bad"], 0);
      EXPECT_EQ(of["in_range_share"], 1.0);
    }
    EXPECT_NE(found["ready"], "none");
  }
}

// A car of another make: stops that are each other's inverse, coarse and noisy signals, a small
// converter, much force in LOW, which bends the pulleys.
constexpr const char* kOtherCar = R"(
plant = "vehicle"
name  = "other-car"
[variator]
ratio_low                  = 0.55
ratio_overdrive            = 1.9
belt_length_m              = 0.62
centre_distance_m          = 0.150
secondary_piston_area_m2   = 0.0095
secondary_spring_force_N   = 800.0
[vehicle]
wheel_radius_m = 0.33
final_drive    = 5.9
mass_kg        = 1600.0
[engine]
overrun_torque_Nm = 28.0
inertia_kg_m2     = 0.12
[sensors]
torque_noise_Nm           = 2.0
torque_resolution_Nm      = 1.0
primary_speed_noise_rad_s = 0.4
pressure_noise_Pa         = 8000.0
[driver]
pattern          = "city"
start_speed_km_h = 0.0
)";

TEST_F(Check, AnotherCarWithFewSignals) {
  place.write("other.toml", kOtherCar);
  Drive car = drive(place.path("other.toml"), "420");
  json found = check(car);
  EXPECT_EQ(count(found["across"], "may be: ") + count(found["across"], "wrong: "), 0)
      << found["across"];
  EXPECT_FALSE(has(found["sentence"], "may be")) << found["sentence"];
  car.toml = replaced(car.toml, "control = \"command\"", "control = \"observe\"");
  for (const char* role : {"engine_speed", "vehicle_speed", "accelerator_pedal", "brake_pressed",
                           "lockup_closed", "experiment_permitted", "oil_temperature"}) {
    car.toml = with_role(car.toml, role, "");
  }
  for (const char* message : {"TCU_State", "ESP_Vehicle"}) {  // of no role any more
    const std::size_t at = car.toml.find(message);
    car.toml.erase(at, car.toml.find('\n', at) - at);
  }
  found = check(car);
  EXPECT_EQ(count(found["across"], "may be: ") + count(found["across"], "wrong: "), 0)
      << found["across"];
  EXPECT_EQ(found["ready"], "observe");

  // Speeds that swapped are in the same range: what they carry and how pressure goes tell it.
  Drive wrong = car;
  wrong.toml = with_role(wrong.toml, "primary_speed", "\"TCU_Speed.SecondarySpeed\"");
  wrong.toml = with_role(wrong.toml, "secondary_speed", "\"TCU_Speed.PrimarySpeed\"");
  found = check(wrong);
  EXPECT_GE(count(found["across"], "or the two speeds are swapped"), 1) << found["across"];
  EXPECT_EQ(count(found["roles"]["primary_speed"]["findings"], "by its name"), 1);
  EXPECT_TRUE(has(found["sentence"], "\"may be\" above.")) << found["sentence"];

  wrong.toml = with_role(car.toml, "secondary_pressure",
                         "{ signal = \"TCU_Pressure.SecondaryPressure\", unit = \"kPa\" }");
  found = check(wrong);
  EXPECT_EQ(count(found["roles"]["secondary_pressure"]["findings"], "never above"), 1)
      << found["roles"]["secondary_pressure"];
  EXPECT_EQ(count(found["across"], "kPa for bar?"), 1) << found["across"];
}

TEST_F(Check, PressureAndTorqueOfAnotherScale) {
  Drive wrong = drive("coast-overdrive-unreachable");
  wrong.toml = with_role(wrong.toml, "secondary_pressure",
                         "{ signal = \"TCU_Pressure.SecondaryPressure\", unit = \"MPa\" }");
  EXPECT_EQ(count(check(wrong)["across"], "MPa for bar?"), 1) << check(wrong)["across"];
  // Half the torque: the inertia that goes with it is half as well.
  wrong = city();
  wrong.toml = with_role(wrong.toml, "engine_torque",
                         "{ signal = \"ECU_Engine.EngineTorque\", scale = 0.5 }");
  EXPECT_EQ(count(check(wrong)["across"], "percent of a reference torque?"), 1)
      << check(wrong)["across"];
}

TEST_F(Check, TellsWhatADriveAllows) {
  // The daemon ran two experiments in these 34 s.
  const json demo = check(drive("demo"));
  EXPECT_EQ(demo["ready"], "command");
  EXPECT_GE(demo["experiments"]["in_reach"], 2);
  // Its pressure floor was made so that the peak is out of reach.
  const json far = check(drive("coast-overdrive-unreachable"));
  EXPECT_EQ(far["ready"], "observe");
  EXPECT_EQ(far["experiments"]["in_reach"], 0);
  EXPECT_GE(far["experiments"]["forbidden_by"]["unreachable"], 1);
  const std::string sentence = far["sentence"];
  EXPECT_TRUE(has(sentence, "force floor")) << sentence;
  // By hand: torque = 2 R_p mu F / cos 11 degrees, in overdrive.
  const double floor_N = far["experiments"]["floor_N"], needed = far["experiments"]["needed_Nm"];
  EXPECT_NEAR(needed, 2.0 * 0.07837 * 0.11 * floor_N / 0.981627, 0.01);
  // In the words of every program, with the figure beside its limit.
  EXPECT_TRUE(has(text_of(drive("coast-overdrive-unreachable")),
                  "unreachable (the force floor lies above the peak's force "));
  // The oil's temperature and its limit as the scenario has them.
  EXPECT_TRUE(has(text_of(drive("cold-oil")), " oil (1"));
  EXPECT_TRUE(has(text_of(drive("cold-oil")),
                  "degC, limit 40 degC): the oil is colder than `oil_temperature_min_degC`;"));
  const json rig = check(drive("paper-rig"));
  EXPECT_EQ(rig["experiments"]["opportunities"], 1);
  EXPECT_TRUE(has(rig["sentence"], "lockup_closed")) << rig["sentence"];
}

TEST_F(Check, TheCityDriveIsHealthyToo) {
  const json found = check(city());
  EXPECT_EQ(count(found["across"], "wrong: ") + count(found["across"], "may be: "), 0)
      << found["across"];
  // Of the scenario: the torque is told 30 ms late.
  EXPECT_EQ(count(found["across"], "note: engine_torque tells 3"), 1) << found["across"];
  // Another variator's end stop.
  Drive other = city();
  other.toml = replaced(other.toml, "= 2.25", "= 2.30");
  EXPECT_EQ(count(check(other)["across"], "variator.ratio_overdrive reads as 2.25"), 1);
  EXPECT_EQ(found["ready"], "command") << found["sentence"];
  // Raw steps of the DBC: 0.125 rpm; white noise of the scenario's speed sensors.
  EXPECT_DOUBLE_EQ(found["roles"]["primary_speed"]["step"], 0.125);
  EXPECT_NEAR(found["roles"]["primary_speed"]["rate_Hz"], 100.0, 1.0);
}

TEST_F(Check, LogOfAnotherCar) {
  Drive other = drive("coast-overdrive");
  other.log = changed_log(other.log, [](LogFrame& frame) {
    frame.id += 0x301;
    return true;
  });
  json found = check(other);
  EXPECT_EQ(found["ready"], "none");
  EXPECT_TRUE(has(found["sentence"], "another car")) << found["sentence"];
  EXPECT_FALSE(found["roles"]["primary_speed"]["seen"]);
  // The same with identifiers nearby: they are named.
  other.log = changed_log(drive("coast-overdrive").log, [](LogFrame& frame) {
    frame.id += 1;
    return true;
  });
  found = check(other);
  EXPECT_EQ(count(found["roles"]["primary_speed"]["findings"], "0x121 (8 bytes, 100 Hz)"), 1)
      << found["roles"]["primary_speed"]["findings"];
}

TEST_F(Check, WrongDataId) {
  Drive wrong = drive("coast-overdrive");
  wrong.toml = replaced(wrong.toml, "data_id = 0x120", "data_id = 0x012A");
  const json found = check(wrong);
  const json& role = found["roles"]["primary_speed"];
  EXPECT_EQ(found["ready"], "none");
  EXPECT_EQ(role["crc_bad"], role["frames"]);
  EXPECT_EQ(count(role["findings"], "data id 0x0120 fits"), 1) << role["findings"];
  EXPECT_EQ(count(found["roles"]["engine_torque"]["findings"], "CRC"), 0);
}

TEST_F(Check, SwappedSpeeds) {
  for (const Drive& right : {city(), drive("coast-overdrive")}) {
    SCOPED_TRACE(right.log.size());
    Drive wrong = right;
    wrong.toml = with_role(wrong.toml, "primary_speed", "\"TCU_Speed.SecondarySpeed\"");
    wrong.toml = with_role(wrong.toml, "secondary_speed", "\"TCU_Speed.PrimarySpeed\"");
    json found = check(wrong);
    EXPECT_EQ(found["ready"], "none") << found["sentence"];
    EXPECT_EQ(count(found["across"], "wrong: primary_speed and secondary_speed are swapped"), 1)
        << found["across"];
    // Without a witness it may be so.
    wrong.toml = with_role(with_role(wrong.toml, "engine_speed", ""), "vehicle_speed", "");
    wrong.toml = replaced(wrong.toml, "control = \"command\"", "control = \"observe\"");
    found = check(wrong);
    EXPECT_EQ(count(found["across"], "swapped?"), 1) << found["across"];
  }
}

TEST_F(Check, UnitsOfSpeeds) {
  Drive wrong = city();
  const std::string primary = "{ signal = \"TCU_Speed.PrimarySpeed\", unit = \"rad/s\" }";
  const std::string secondary = "{ signal = \"TCU_Speed.SecondarySpeed\", unit = \"rad/s\" }";
  wrong.toml = with_role(wrong.toml, "primary_speed", primary);
  json found = check(wrong);
  EXPECT_EQ(found["ready"], "none");
  EXPECT_EQ(count(found["roles"]["primary_speed"]["findings"], "1/min read as rad/s?"), 1)
      << found["roles"]["primary_speed"];
  EXPECT_EQ(count(found["across"], "primary 1/min read as rad/s"), 1) << found["across"];
  wrong.toml = with_role(wrong.toml, "secondary_speed", secondary);
  found = check(wrong);
  EXPECT_EQ(found["ready"], "none");
  EXPECT_GE(count(found["across"], "1/min"), 1) << found["across"];
  // A DBC without units: nothing but the values tells.
  wrong.dbc = replaced(replaced(wrong.dbc, "[0|8000] \"rpm\"  ECU", "[0|8000] \"\"  ECU"),
                       "[0|8000] \"rpm\"  ECU", "[0|8000] \"\"  ECU");
  found = check(wrong);
  EXPECT_EQ(found["ready"], "none");
}

TEST_F(Check, SignOfTheTorque) {
  for (const Drive& right : {city(), drive("coast-overdrive")}) {
    Drive wrong = right;
    wrong.toml = with_role(wrong.toml, "engine_torque",
                           "{ signal = \"ECU_Engine.EngineTorque\", scale = -1 }");
    const json found = check(wrong);
    EXPECT_EQ(count(found["across"], "engine_torque: sign?"), 1) << found["across"];
  }
  Drive wrong = city();
  wrong.toml = with_role(wrong.toml, "engine_torque",
                         "{ signal = \"ECU_Engine.EngineTorque\", scale = -1 }");
  EXPECT_EQ(check(wrong)["ready"], "none");
}

TEST_F(Check, AnotherPressure) {
  Drive wrong = city();
  wrong.toml = with_role(wrong.toml, "secondary_pressure", "\"TCU_Pressure.PrimaryPressure\"");
  json found = check(wrong);
  EXPECT_GE(count(found["across"], "pressure"), 1) << found["across"];
  // kPa for bar.
  wrong.toml = with_role(city().toml, "secondary_pressure",
                         "{ signal = \"TCU_Pressure.SecondaryPressure\", unit = \"kPa\" }");
  found = check(wrong);
  EXPECT_GE(count(found["roles"]["secondary_pressure"]["findings"], "kPa"), 1) << found["roles"];
  EXPECT_GE(count(found["across"], "unit of pressure"), 1) << found["across"];
}

TEST_F(Check, BrakeAsLockUp) {
  Drive wrong = city();
  wrong.toml = with_role(wrong.toml, "lockup_closed", "\"ESP_Vehicle.BrakePressed\"");
  json found = check(wrong);
  EXPECT_EQ(found["ready"], "none");
  EXPECT_EQ(count(found["across"], "brake_pressed and lockup_closed are one signal"), 1)
      << found["across"];
  EXPECT_EQ(count(found["across"], "would stall the engine"), 1) << found["across"];
  // The wrong way round: an engine that idles is not one of another unit.
  wrong.toml = with_role(city().toml, "lockup_closed",
                         "{ signal = \"TCU_State.LockupClosed\", scale = -1, offset = 1 }");
  found = check(wrong);
  EXPECT_EQ(count(found["across"], "would stall the engine"), 1) << found["across"];
  EXPECT_EQ(count(found["across"], "mixed up"), 0) << found["across"];
}

TEST_F(Check, AStuckCounter) {
  Drive wrong = drive("coast-overdrive");
  wrong.log = changed_log(wrong.log, [](LogFrame& frame) {
    if (frame.id != 0x130) return true;
    frame.data[7] = static_cast<std::uint8_t>((frame.data[7] & 0x0F) | 0x50);
    frame.data[6] = crc_of(frame, 0x130, 6);
    return true;
  });
  const json found = check(wrong);
  const json& role = found["roles"]["secondary_pressure"];
  EXPECT_EQ(role["crc_bad"], 0);
  EXPECT_EQ(count(role["findings"], "wrong: counter of TCU_Pressure stands still"), 1)
      << role["findings"];
  EXPECT_EQ(found["ready"], "none");
}

TEST_F(Check, AGapEveryMinute) {
  Drive wrong = city();
  wrong.log = changed_log(wrong.log, [](LogFrame& frame) {
    return frame.id != 0x130 || std::fmod(frame.t_s, 60.0) > 1.0;
  });
  const json found = check(wrong);
  const json& role = found["roles"]["secondary_pressure"];
  EXPECT_NEAR(role["longest_gap_s"], 1.01, 0.02);
  EXPECT_EQ(count(role["findings"], "6 gaps"), 1) << role["findings"];
  EXPECT_EQ(count(role["findings"], "one every 60 s"), 1) << role["findings"];
  EXPECT_EQ(count(found["roles"]["primary_speed"]["findings"], "gap"), 0);
}

// A recorder that was stopped for ten seconds of the drive: no message's gap, no lost count.
TEST_F(Check, APauseOfTheWholeBus) {
  Drive paused = drive("coast-overdrive");
  paused.log =
      changed_log(paused.log, [](LogFrame& frame) { return frame.t_s < 5.0 || frame.t_s > 15.0; });
  const json found = check(paused);
  for (const auto& [role, of] : found["roles"].items()) {
    EXPECT_EQ(count(of["findings"], "gap") + count(of["findings"], "counter"), 0)
        << role << of["findings"];
  }
  EXPECT_EQ(count(found["across"], "note: no frame at all came 1 time, for 10 s"), 1)
      << found["across"];
}

// One stamp of a log is garbled: its frame has no part in what is found, and is counted.
TEST_F(Check, AStampThatLiesBack) {
  Drive wrong = drive("coast-overdrive");
  std::size_t at = wrong.log.find(" 130#", wrong.log.size() / 2);
  at = wrong.log.rfind('\n', at) + 1;
  wrong.log.replace(at, wrong.log.find(')', at) - at, "(2.000000");
  const json found = check(wrong);
  for (const auto& [role, of] : found["roles"].items()) {
    EXPECT_EQ(count(of["findings"], "gap"), 0) << role << of["findings"];
  }
  for (const char* command : {"check", "diagnose"}) {
    const RunResult result =
        beltgrip({command, place.path("trace.log"), "--config", place.path("beltgrip.toml")});
    EXPECT_TRUE(has(result.out + result.err,
                    "trace.log: 1 frames left out, their time stamps are far from "
                    "their neighbours'"))
        << command << result.err;
  }
}

TEST_F(Check, AMessageThatEndsBeforeTheLog) {
  Drive wrong = drive("coast-overdrive");
  wrong.log =
      changed_log(wrong.log, [](LogFrame& frame) { return frame.id != 0x130 || frame.t_s < 20.0; });
  const json found = check(wrong);
  EXPECT_EQ(count(found["roles"]["secondary_pressure"]["findings"], "never again after 20.0 s"), 1)
      << found["roles"]["secondary_pressure"];
}

TEST_F(Check, TorqueInPercent) {
  Drive wrong = drive("coast-overdrive");
  wrong.dbc = replaced(wrong.dbc, "[-500|500] \"Nm\"", "[-100|100] \"%\"");
  wrong.toml = with_role(wrong.toml, "engine_torque",
                         "{ signal = \"ECU_Engine.EngineTorque\", unit = \"Nm\" }");
  json found = check(wrong);
  EXPECT_EQ(count(found["roles"]["engine_torque"]["findings"], "the DBC says \"%\""), 1)
      << found["roles"]["engine_torque"];
  // Without a unit there: the range may tell.
  wrong.dbc = replaced(wrong.dbc, "[-100|100] \"%\"", "[-100|100] \"\"");
  found = check(wrong);
  EXPECT_EQ(count(found["roles"]["engine_torque"]["findings"], "percent of a reference torque"), 1)
      << found["roles"]["engine_torque"];
  // Or the name, under whatever unit; not where a scale makes up for it.
  Drive named = drive("coast-overdrive");
  for (std::string* text : {&named.dbc, &named.toml}) {
    while (has(*text, "EngineTorque")) *text = replaced(*text, "EngineTorque", "EngTrqPct");
  }
  found = check(named);
  EXPECT_EQ(count(found["roles"]["engine_torque"]["findings"], "its name is EngTrqPct: percent"), 1)
      << found["roles"]["engine_torque"];
  named.toml =
      with_role(named.toml, "engine_torque", "{ signal = \"ECU_Engine.EngTrqPct\", scale = 1.5 }");
  EXPECT_EQ(count(check(named)["roles"]["engine_torque"]["findings"], "percent"), 0);
}

// Where name, range and unit say Nm, the car's own weight tells: some 1,400 kg here, 0.4 of it by
// the percent of 250 Nm.
TEST_F(Check, TorqueInPercentByTheWeightOfTheCar) {
  Drive wrong = city();
  wrong.toml = with_role(wrong.toml, "engine_torque",
                         "{ signal = \"ECU_Engine.EngineTorque\", scale = 0.4, offset = -0.4 }");
  json found = check(wrong);
  EXPECT_EQ(count(found["across"], "engine_torque would move a car of 5"), 1) << found["across"];
  wrong.toml = with_role(wrong.toml, "engine_torque",
                         "{ signal = \"ECU_Engine.EngineTorque\", scale = 10, offset = -10 }");
  found = check(wrong);
  EXPECT_EQ(count(found["across"], "engine_torque would move 1"), 1) << found["across"];
}

TEST_F(Check, AFrozenSpeed) {
  Drive wrong = drive("coast-overdrive");
  std::vector<std::uint8_t> last;
  wrong.log = changed_log(wrong.log, [&last](LogFrame& frame) {
    if (frame.id != 0x120) return true;
    if (frame.t_s < 6.0 || frame.t_s > 12.0) {
      last = {frame.data[0], frame.data[1]};
    } else {
      std::copy(last.begin(), last.end(), frame.data.begin());
      frame.data[6] = crc_of(frame, 0x120, 6);
    }
    return true;
  });
  const json found = check(wrong);
  const json& role = found["roles"]["primary_speed"];
  EXPECT_NEAR(role["stuck_s"], 6.0, 0.05);
  EXPECT_EQ(count(role["findings"], "wrong: stood at"), 1) << role["findings"];
}

// The whole message comes again and again, as a gateway sends the last that it heard. Nothing is
// configured that would protect it.
TEST_F(Check, AMessageThatRepeatsItself) {
  Drive wrong = drive("coast-overdrive");
  wrong.toml = wrong.toml.substr(0, wrong.toml.find("[protection]")) +
               wrong.toml.substr(wrong.toml.find("[sensors]"));
  std::vector<std::uint8_t> last;
  wrong.log = changed_log(wrong.log, [&last](LogFrame& frame) {
    if (frame.id != 0x120) return true;
    if (frame.t_s < 6.0 || frame.t_s > 8.0) {
      last = frame.data;
    } else {
      frame.data = last;
    }
    return true;
  });
  const json found = check(wrong);
  for (const char* role : {"primary_speed", "secondary_speed"}) {
    EXPECT_EQ(count(found["roles"][role]["findings"], "wrong: repeats"), 1) << found["roles"][role];
  }
}

constexpr const char* kBenchDbc = R"(VERSION ""
BO_ 256 Bench: 8 X
 SG_ Primary : 0|16@1+ (1,0) [0|65535] "rpm" X
 SG_ Secondary : 16|16@1+ (1,0) [0|65535] "rpm" X
 SG_ Pressure : 32|16@1+ (1,0) [0|65535] "kPa" X
 SG_ Torque : 48|16@1- (1,0) [-1000|1000] "Nm" X
)";
constexpr const char* kBenchToml = R"([bus]
interface = "can0"
dbc       = ["vehicle.dbc"]
[signals]
primary_speed      = "Bench.Primary"
secondary_speed    = "Bench.Secondary"
secondary_pressure = "Bench.Pressure"
primary_torque     = "Bench.Torque"
[experiment]
trigger = "always"
)";

// Both speeds climb by 6 rpm a second, as even as a step of 1 rpm lets them; from 8 to 11 s the
// message comes again and again.
std::string smooth_log(bool frozen) {
  std::string log;
  for (int i = 0; i < 2000; ++i) {
    const int k = frozen && i >= 800 && i < 1100 ? 800 : i;
    const int primary = 1000 + 6 * k / 100, secondary = 2250 + 135 * k / 1000;
    char line[80];
    std::snprintf(line, sizeof line, "(%.6f) can0 100#%02X%02X%02X%02X%02X%02X%02X%02X\n", 0.01 * i,
                  static_cast<unsigned>(primary) & 0xFFU, static_cast<unsigned>(primary) >> 8,
                  static_cast<unsigned>(secondary) & 0xFFU, static_cast<unsigned>(secondary) >> 8,
                  0xE8, 0x03, 60, 0);
    log += line;
  }
  return log;
}

// Nothing is noisy, nothing protected: what tells is the leap at its end.
TEST_F(Check, AMessageThatRepeatsItselfWithoutNoise) {
  Drive bench{smooth_log(true), kBenchToml, kBenchDbc};
  json found = check(bench);
  for (const char* role : {"primary_speed", "secondary_speed"}) {
    const json& findings = found["roles"][role]["findings"];
    EXPECT_EQ(count(findings, "wrong: stood at"), 1) << findings;
    EXPECT_EQ(count(findings, "in one frame, where 1 is much: a frozen sender"), 1) << findings;
  }
  bench.log = smooth_log(false);
  found = check(bench);
  EXPECT_EQ(count(found["roles"]["primary_speed"]["findings"], "stood at"), 0)
      << found["roles"]["primary_speed"];
}

// A motor holds the primary at 1000 rpm to within its step; after 15 s the secondary, at overdrive,
// falls back by 6 %.
std::string bench_log(int torque_Nm) {
  std::string log;
  for (int i = 0; i < 2000; ++i) {
    const int primary = i < 20 ? 999 + i % 3 : 1000;
    const int secondary = 2250 - (i < 1500 ? i % 3 : (i - 1500) * 135 / 500);
    const auto word = [](int value) {
      return std::array<unsigned, 2>{static_cast<unsigned>(value) & 0xFFU,
                                     (static_cast<unsigned>(value) >> 8) & 0xFFU};
    };
    const auto p = word(primary), s = word(secondary), q = word(1000 + i % 2), t = word(torque_Nm);
    char line[80];
    std::snprintf(line, sizeof line, "(%.6f) can0 100#%02X%02X%02X%02X%02X%02X%02X%02X\n", 0.01 * i,
                  p[0], p[1], s[0], s[1], q[0], q[1], t[0], t[1]);
    log += line;
  }
  return log;
}

// What slips with the torque is no frozen sensor; against it nothing slips, unless the torque's
// sign is the other one.
TEST_F(Check, AMotorMayHoldAPulleyWhileTheBeltSlips) {
  Drive bench{bench_log(60), kBenchToml, kBenchDbc};
  json found = check(bench);
  EXPECT_EQ(count(found["roles"]["primary_speed"]["findings"], "wrong: "), 0)
      << found["roles"]["primary_speed"];
  bench.log = bench_log(-60);
  found = check(bench);
  EXPECT_EQ(count(found["roles"]["primary_speed"]["findings"], "may be: stood at"), 1)
      << found["roles"]["primary_speed"];
  EXPECT_EQ(count(found["roles"]["primary_speed"]["findings"], "sign of the torque"), 1)
      << found["roles"]["primary_speed"];
}

TEST_F(Check, ABusOnWhichNobodySpeaks) {
  const Drive& car = drive("coast-overdrive");
  place.write("vehicle.dbc", car.dbc);
  place.write("beltgrip.toml", replaced(car.toml, "\"vcan0\"", "\"inproc:quiet\""));
  const RunResult result =
      beltgrip({"check", "--live", "0.2", "--config", place.path("beltgrip.toml"), "--json", "-"});
  ASSERT_EQ(result.status, 0) << result.err;
  const json found = json::parse(result.out);
  EXPECT_EQ(found["ready"], "none");
  EXPECT_TRUE(has(found["sentence"], "no frame came: is the ignition on")) << found["sentence"];
}

TEST_F(Check, TheConfigurationAlone) {
  place.write("beltgrip.toml", drive("coast-overdrive").toml);
  place.write("vehicle.dbc", drive("coast-overdrive").dbc);
  const RunResult result = beltgrip({"check", "--config", place.path("beltgrip.toml")});
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_TRUE(has(result.out, "by the configuration alone")) << result.out;
  place.write("wrong.toml", "[bus]\nspeed = 1\n");
  EXPECT_EQ(beltgrip({"check", "--config", place.path("wrong.toml")}).status, 78);
  EXPECT_EQ(
      beltgrip({"check", place.path("none.log"), "--config", place.path("beltgrip.toml")}).status,
      66);
  EXPECT_EQ(beltgrip({"check", place.path("none.log"), "--live", "1", "--config",
                      place.path("beltgrip.toml")})
                .status,
            64);
}

}  // namespace
}  // namespace beltgrip::test
