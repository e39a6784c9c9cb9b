// beltgrip simulate: the same seed gives the same bytes, a late start the tail, mistakes their exit
// codes. What the files say is read here by hand, not by the code that wrote them.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/tools/program.h"

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

  const RunResult missing = beltgrip({"simulate", "--scenario", "no-rig", "--log-out", "-"});
  EXPECT_EQ(missing.status, 66);
  EXPECT_NE(missing.err.find("paper-rig"), std::string::npos);
  const RunResult vehicle =
      beltgrip({"simulate", "--scenario", "coast-overdrive", "--log-out", "-"});
  EXPECT_EQ(vehicle.status, 78);
  EXPECT_EQ(lines(vehicle.err), 1) << vehicle.err;
  EXPECT_EQ(beltgrip({"simulate", "--belt", "gold", "--log-out", "-"}).status, 78);
  EXPECT_EQ(beltgrip({"simulate", "--log-out", "/nonexistent/x.log"}).status, 73);
  EXPECT_EQ(beltgrip({"simulate", "--out-dir", "/proc/x"}).status, 73);
  EXPECT_EQ(beltgrip({"simulate", "--log-out", "/dev/full"}).status, 74);
}

}  // namespace
}  // namespace beltgrip::test
