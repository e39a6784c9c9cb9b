// beltgrip simulate: the same seed gives the same bytes, a late start the tail, mistakes their exit
// codes. What the files say is read here by hand, not by the code that wrote them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/support/program.h"

namespace beltgrip::test {
namespace {

TEST(Simulate, SameSeedSameBytes) {
  Workplace place;
  for (const char* name : {"a", "b"}) {
    ASSERT_EQ(beltgrip({"simulate", "--seed", "7", "--out-dir", place.path(name)}).status, 0);
  }
  ASSERT_EQ(beltgrip({"simulate", "--seed", "8", "--log-out", place.path("other.log")}).status, 0);
  for (const char* file : {"trace.log", "vehicle.dbc", "beltgrip.toml", "truth.json"}) {
    EXPECT_EQ(place.read(std::string("a/") + file), place.read(std::string("b/") + file)) << file;
  }
  EXPECT_NE(place.read("a/trace.log"), place.read("other.log"));
  EXPECT_EQ(beltgrip({"simulate", "--seed", "7", "--log-out", "-"}).out, place.read("a/trace.log"));
}

TEST(Simulate, ALateStartIsTheTailOfTheWhole) {
  const std::string whole = beltgrip({"simulate", "--log-out", "-"}).out;
  const std::string tail = beltgrip({"simulate", "--start", "80", "--log-out", "-"}).out;
  const std::string middle =
      beltgrip({"simulate", "--start", "80", "--duration", "10", "--log-out", "-"}).out;
  ASSERT_FALSE(middle.empty());
  EXPECT_TRUE(whole.ends_with(tail));
  EXPECT_TRUE(tail.starts_with(middle));
  EXPECT_LT(middle.size(), tail.size());
  double first_s = 0.0;
  ASSERT_EQ(std::sscanf(tail.c_str(), "(%lf)", &first_s), 1);
  EXPECT_NEAR(first_s, 80.0, 0.01);
}

// A frame of the log by the DBC that is written beside it: torque at bytes 0-1, little endian,
// 0.02 Nm; speeds at bytes 0-1 and 2-3, big endian, 1/16 rpm; pressure little endian, 1 mbar.
struct Means {
  double speed_p_rpm = 0, speed_s_rpm = 0, torque_Nm = 0, pressure_bar = 0;
  long speeds = 0, torques = 0, pressures = 0, states = 0;
};
Means means_between(const std::string& log, double from_s, double to_s) {
  Means m;
  std::istringstream stream(log);
  std::string line;
  while (std::getline(stream, line)) {
    double t_s = 0.0;
    unsigned id = 0, a = 0, b = 0, c = 0, d = 0;
    const int fields =
        std::sscanf(line.c_str(), "(%lf) vcan0 %3X#%2X%2X%2X%2X", &t_s, &id, &a, &b, &c, &d);
    EXPECT_EQ(fields, 6) << line;
    if (t_s < from_s || t_s >= to_s) continue;
    if (id == 0x110) {
      m.speed_p_rpm += (a * 256 + b) / 16.0;
      m.speed_s_rpm += (c * 256 + d) / 16.0;
      ++m.speeds;
    } else if (id == 0x120) {
      m.torque_Nm += static_cast<std::int16_t>(b * 256 + a) * 0.02;
      ++m.torques;
    } else if (id == 0x130) {
      m.pressure_bar += (b * 256 + a) * 0.001;
      ++m.pressures;
    } else if (id == 0x300) {
      ++m.states;
    } else {
      ADD_FAILURE() << line;
    }
  }
  m.speed_p_rpm /= static_cast<double>(m.speeds);
  m.speed_s_rpm /= static_cast<double>(m.speeds);
  m.torque_Nm /= static_cast<double>(m.torques);
  m.pressure_bar /= static_cast<double>(m.pressures);
  return m;
}

TEST(Simulate, TheLogSaysWhatThePaperDid) {
  const std::string log = beltgrip({"simulate", "--log-out", "-"}).out;
  const Means m = means_between(log, 10.0, 20.0);
  EXPECT_NEAR(static_cast<double>(m.speeds), 2000, 1);
  EXPECT_NEAR(static_cast<double>(m.torques), 2000, 1);
  EXPECT_NEAR(static_cast<double>(m.pressures), 2000, 1);
  EXPECT_NEAR(static_cast<double>(m.states), 100, 1);
  EXPECT_NEAR(m.speed_p_rpm, 105.0 * 30.0 / M_PI, 0.2);
  EXPECT_NEAR(m.torque_Nm, 50.0, 0.2);
  // 5300 N less 26 N/s for 15 s, less the spring's 500 N, on 113 cm2.
  EXPECT_NEAR(m.pressure_bar, (5300.0 - 26.0 * 15.0 - 500.0) / 0.0113 * 1e-5, 0.01);
  // Overdrive 2.25, less slip and deformation of about 1.5 %.
  EXPECT_NEAR(m.speed_s_rpm / m.speed_p_rpm / 2.25, 0.985, 0.001);
}

TEST(Simulate, WritesTheTruth) {
  Workplace place;
  ASSERT_EQ(beltgrip({"simulate", "--belt", "worn", "--seed", "3", "--out-dir", place.path("x/y")})
                .status,
            0);
  const auto truth = nlohmann::json::parse(place.read("x/y/truth.json"));
  EXPECT_EQ(truth.at("scenario"), "paper-rig");
  EXPECT_EQ(truth.at("belt"), "worn");
  EXPECT_EQ(truth.at("seed"), 3);
  EXPECT_EQ(truth.at("mu_max"), 0.1);
  ASSERT_EQ(truth.at("experiments").size(), 1u);
  const auto& experiment = truth.at("experiments")[0];
  EXPECT_NEAR(experiment.at("peak_s").get<double>(), 83.5, 1.5);
  EXPECT_NEAR(experiment.at("slip_peak_percent").get<double>(), 2.4, 1e-12);
}

// A radius that is larger by a twentieth carries the torque with so much less force.
TEST(Simulate, AModelsRadiusIsTheMachines) {
  Workplace place;
  place.write("radius.toml", "[variator]\nprimary_radius_overdrive_m = 0.08229\n");
  const auto peak_force_N = [&](const std::vector<std::string>& more) {
    std::vector<std::string> arguments{"simulate", "--scenario", "paper-rig", "--json", "-"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const RunResult result = beltgrip(arguments);
    EXPECT_EQ(result.status, 0) << result.err;
    const std::size_t at = result.out.find("\"clamp_force_peak_N\":");
    return at == std::string::npos ? 0.0 : std::stod(result.out.substr(at + 21));
  };
  const double usual_N = peak_force_N({});
  ASSERT_GT(usual_N, 2000.0);
  EXPECT_NEAR(peak_force_N({"--model", place.path("radius.toml")}) / usual_N, 1.0 / 1.05, 2e-3);
}

TEST(Simulate, AMachineBeyondTheBoxOfAFunctionIsToldSo) {
  Workplace place;
  place.write("learned.toml",
              "[learned.drag]\nacts_on = \"torque\"\ndepends_on = [\"oil_temperature\"]\n"
              "knots = [40.0, 60.0]\nvalues = [0.0, 1.0]\ncovariance = [0.0, 0.0, 0.0, 0.0]\n"
              "box = { oil_temperature = [40.0, 60.0] }\n");
  const RunResult beyond = beltgrip({"simulate", "--scenario", "paper-rig", "--duration", "1",
                                     "--model", place.path("learned.toml"), "--json", "-"});
  EXPECT_EQ(beyond.status, 0) << beyond.err;
  EXPECT_NE(beyond.err.find("[learned.drag]: oil_temperature of 80 degC lies outside the box (40 "
                            "to 60)"),
            std::string::npos)
      << beyond.err;
  const RunResult within =
      beltgrip({"simulate", "--scenario", "paper-rig", "--duration", "1", "--set",
                "run.oil_degC=50", "--model", place.path("learned.toml"), "--json", "-"});
  EXPECT_EQ(within.err.find("outside the box"), std::string::npos) << within.err;
}

TEST(Simulate, SettingsAndMistakes) {
  Workplace place;
  place.write("bad.toml", "[driveline]\nsecondary_inertia_kg_m2 = -1\n\n[sensor]\nx = 1\n");
  const RunResult bad =
      beltgrip({"simulate", "--scenario", place.path("bad.toml"), "--log-out", "-"});
  EXPECT_EQ(bad.status, 78);
  EXPECT_EQ(lines(bad.err), 2);
  EXPECT_NE(bad.err.find("bad.toml:2: driveline.secondary_inertia_kg_m2: found -1"),
            std::string::npos);
  EXPECT_NE(bad.err.find("bad.toml:4: sensor: "), std::string::npos);
  EXPECT_EQ(bad.out, "");

  // A car's scenario that does not say so.
  place.write("car.toml", "[belt]\nmu_max = 0.08\n");
  const RunResult car = beltgrip({"simulate", "--scenario", place.path("car.toml")});
  EXPECT_EQ(car.status, 78);
  EXPECT_EQ(lines(car.err), 1);
  EXPECT_NE(car.err.find("car.toml:1: belt: "), std::string::npos) << car.err;
  EXPECT_NE(car.err.find("plant = \"vehicle\""), std::string::npos) << car.err;

  // As diagnose leaves where no experiment is left to ask for: not the usual machine in its place.
  for (const char* const nothing : {"", "# no experiment is left to ask for\n", "\n \n#"}) {
    place.write("none.toml", nothing);
    const RunResult none = beltgrip({"simulate", "--scenario", place.path("none.toml")});
    EXPECT_EQ(none.status, 78) << nothing;
    EXPECT_NE(none.err.find("none.toml:1: found a file that sets nothing"), std::string::npos)
        << none.err;
  }

  const RunResult missing = beltgrip({"simulate", "--scenario", "no-rig", "--log-out", "-"});
  EXPECT_EQ(missing.status, 66);
  EXPECT_NE(missing.err.find("paper-rig"), std::string::npos);
  const RunResult vehicle =
      beltgrip({"simulate", "--scenario", "coast-overdrive", "--belt", "worn", "--log-out", "-"});
  EXPECT_EQ(vehicle.status, 64);
  EXPECT_EQ(lines(vehicle.err), 1) << vehicle.err;
  EXPECT_EQ(beltgrip({"simulate", "--belt", "gold", "--log-out", "-"}).status, 64);
  EXPECT_EQ(beltgrip({"simulate", "--log-out", "/nonexistent/x.log"}).status, 73);
  EXPECT_EQ(beltgrip({"simulate", "--out-dir", "/proc/x"}).status, 73);
  EXPECT_EQ(beltgrip({"simulate", "--log-out", "/dev/full"}).status, 74);
}

std::vector<nlohmann::json> run_drive(const std::string& scenario,
                                      const std::vector<std::string>& more = {}) {
  std::vector<std::string> argv{"simulate", "--scenario", scenario, "--json", "-"};
  argv.insert(argv.end(), more.begin(), more.end());
  const RunResult result = beltgrip(argv);
  EXPECT_EQ(result.status, 0) << result.err;
  std::vector<nlohmann::json> out;
  std::istringstream stream(result.out);
  for (std::string line; std::getline(stream, line);) out.push_back(nlohmann::json::parse(line));
  return out;
}

// What each shipped drive must come to.
struct Drive {
  const char* scenario;
  const char* outcome;  // of the first experiment; empty: none may begin
  const char* direction;
  double mu_max;
  bool requests;
};
class ShippedDrive : public testing::TestWithParam<Drive> {};
TEST_P(ShippedDrive, ComesToItsEnd) {
  const Drive& d = GetParam();
  const std::vector<nlohmann::json> lines = run_drive(d.scenario);
  ASSERT_GE(lines.size(), 2u);
  const nlohmann::json& truth = lines[lines.size() - 2];
  ASSERT_EQ(truth.at("type"), "truth");
  ASSERT_EQ(lines.back().at("type"), "summary");
  EXPECT_GT(lines.back().at("frames_decoded"), 10000);
  EXPECT_EQ(truth.at("requests").empty(), !d.requests);
  EXPECT_EQ(truth.at("requests_outside_limits"), 0);
  EXPECT_EQ(truth.at("stalls"), 0);
  if (std::string(d.outcome).empty()) {
    EXPECT_EQ(lines.size(), 2u);
    return;
  }
  // The first that began, where requests are to begin: one that is refused has no sample.
  const auto experiment = std::find_if(lines.begin(), lines.end() - 2, [&](const auto& line) {
    return !d.requests || line.at("samples") > 0;
  });
  const nlohmann::json& first = *experiment;
  ASSERT_EQ(first.at("type"), "experiment");
  EXPECT_EQ(first.at("outcome"), d.outcome);
  EXPECT_EQ(first.at("direction"), d.direction);
  EXPECT_EQ(first.at("ratio"), "overdrive");
  if (first.at("outcome") != "completed") return;
  // The cylinder's friction of 30 N is 1.6 % of the force at the peak, and nobody told the daemon.
  EXPECT_NEAR(first.at("mu_max").get<double>() / d.mu_max, 1.0, 0.03);
  EXPECT_LE(first.at("mu_max_ci95")[0], d.mu_max);
  EXPECT_GE(first.at("mu_max_ci95")[1], d.mu_max);
  EXPECT_TRUE(truth.at("requests")[0].at("peak_passed"));
}
INSTANTIATE_TEST_SUITE_P(
    , ShippedDrive,
    testing::Values(Drive{"coast-overdrive", "completed", "overrun", 0.105, true},
                    Drive{"worn-belt", "completed", "overrun", 0.090, true},
                    Drive{"cruise-drive-torque", "completed", "drive", 0.105, true},
                    Drive{"coast-overdrive-unreachable", "inconclusive", "overrun", 0.105, false},
                    Drive{"floor-06MPa-coast", "inconclusive", "overrun", 0.105, false},
                    Drive{"floor-06MPa-drive", "inconclusive", "drive", 0.105, false},
                    Drive{"coast-low", "", "", 0.0, false}, Drive{"cold-oil", "", "", 0.0, false}),
    [](const auto& drive) {
      std::string name = drive.param.scenario;
      std::erase(name, '-');
      return name;
    });

TEST(Simulate, ARunThatEndsAsTheRequestBeginsSaysNothingOfFriction) {
  const auto whole = run_drive("coast-overdrive");
  const double begin_s = whole.at(1).at("requests").at(0).at("begin_s").get<double>();
  const RunResult run = beltgrip(
      {"simulate", "--scenario", "coast-overdrive", "--duration", std::to_string(begin_s + 0.3)});
  ASSERT_EQ(run.status, 0) << run.err;
  EXPECT_NE(run.out.find("no value: too short"), std::string::npos) << run.out;
  // Of the experiment; what the drive carried before it is another bound.
  EXPECT_EQ(run.out.find("\n  mu_max is at least"), std::string::npos) << run.out;
}

TEST(Simulate, TheDemoFindsTheWearBetweenTwoCoastDowns) {
  const std::vector<nlohmann::json> lines = run_drive("demo");
  ASSERT_EQ(lines.size(), 4u);
  const nlohmann::json& requests = lines[2].at("requests");
  ASSERT_EQ(requests.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(lines[i].at("outcome"), "completed");
    const auto truth = requests[i].at("mu_max").get<double>();
    EXPECT_NEAR(truth, i == 0 ? 0.105 : 0.105 * 0.88, 1e-3);
    EXPECT_NEAR(lines[i].at("mu_max").get<double>() / truth, 1.0, 0.03);
  }
  EXPECT_EQ(lines[2].at("requests_outside_limits"), 0);
}

TEST(Simulate, HalfAnHourOfTrafficUsesWhatItCanAndHarmsNothing) {
  const std::vector<nlohmann::json> lines = run_drive("city");
  const nlohmann::json& truth = lines.at(lines.size() - 2);
  EXPECT_EQ(truth.at("requests_outside_limits"), 0);
  EXPECT_EQ(truth.at("stalls"), 0);
  const auto coasts = truth.at("coast_downs").get<std::size_t>();
  EXPECT_GT(coasts, 10u);
  EXPECT_LT(truth.at("requests").size(), coasts);
  std::size_t completed = 0;
  for (const nlohmann::json& line : lines) {
    if (line.at("type") != "experiment" || line.at("outcome") != "completed") continue;
    ++completed;
    EXPECT_NEAR(line.at("mu_max").get<double>(), 0.106, 0.004) << line;  // 0.109 cold, 0.105 warm
  }
  EXPECT_GE(completed, 1u);
}

TEST(Simulate, AVehiclesSeedGivesItsBytesAndItsLogItsResults) {
  Workplace place;
  for (const char* name : {"a", "b"}) {
    ASSERT_EQ(beltgrip({"simulate", "--scenario", "worn-belt", "--seed", "3", "--out-dir",
                        place.path(name), "--json", place.path(name) + ".json"})
                  .status,
              0);
  }
  for (const char* file :
       {"/trace.log", "/vehicle.dbc", "/beltgrip.toml", "/truth.json", ".json"}) {
    EXPECT_EQ(place.read(std::string("a") + file), place.read(std::string("b") + file)) << file;
  }
  EXPECT_EQ(beltgrip({"simulate", "--scenario", "worn-belt", "--seed", "3", "--log-out", "-"}).out,
            place.read("a/trace.log"));
  EXPECT_NE(beltgrip({"simulate", "--scenario", "worn-belt", "--seed", "4", "--log-out", "-"}).out,
            place.read("a/trace.log"));
  // A replay samples elsewhere between the frames, and finds the same experiment.
  const RunResult replay = beltgrip({"replay", place.path("a/trace.log"), "--config",
                                     place.path("a/beltgrip.toml"), "--json", "-"});
  ASSERT_EQ(replay.status, 0) << replay.err;
  const auto replayed = nlohmann::json::parse(replay.out.substr(0, replay.out.find('\n')));
  const std::string driven_text = place.read("a.json");
  const auto driven = nlohmann::json::parse(driven_text.substr(0, driven_text.find('\n')));
  EXPECT_EQ(replayed.at("type"), "experiment");
  EXPECT_NEAR(replayed.at("stop_s").get<double>(), driven.at("stop_s").get<double>(), 0.1);
}

TEST(Simulate, AVehiclesMistakesNameFileLineKeyAndReason) {
  Workplace place;
  struct Mistake {
    const char* text;
    std::vector<const char*> said;
  };
  for (const Mistake& mistake :
       {Mistake{"[engine]\ninertia_kg_m2 = -0.1\nwings = 2\n",
                {":3: engine.inertia_kg_m2: found -0.1,", "positive inertia", ":4: engine.wings"}},
        Mistake{"[variator]\nbelt_length_m = 0.3\n",
                {":3: variator.belt_length_m: found 0.3", "too short", "0.336 m"}},
        Mistake{"[variator]\nratio_overdrive = 9.0\n",
                {":3: variator.ratio_overdrive: found 9", "out of reach"}}}) {
    place.write("bad.toml", std::string("plant = \"vehicle\"\n") + mistake.text);
    const RunResult result = beltgrip({"simulate", "--scenario", place.path("bad.toml")});
    EXPECT_EQ(result.status, 78);
    EXPECT_EQ(result.out, "");
    for (const char* part : mistake.said) {
      EXPECT_NE(result.err.find(part), std::string::npos) << part << "\n" << result.err;
    }
  }
  place.write("boom.toml",
              "plant = \"vehicle\"\n[[fault]]\nkind = \"pothole\"\nat_s = 1.0\nfor_s = 5.0\n"
              "size = 1e9\n");
  const RunResult boom =
      beltgrip({"simulate", "--scenario", place.path("boom.toml"), "--seed", "7"});
  EXPECT_EQ(boom.status, 70);
  EXPECT_NE(boom.err.find("no longer finite at 1."), std::string::npos) << boom.err;
  EXPECT_NE(boom.err.find("seed 7"), std::string::npos) << boom.err;
}

}  // namespace
}  // namespace beltgrip::test
