// What nobody stated: keys of [variator] and [sensors] that are left out are assumed, listed, and
// inside the interval of mu_max, which holds the truth of cars drawn from what is assumed.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <optional>
#include <random>
#include <set>

#include "daemon/core/config/load/config_fingerprint.h"
#include "daemon/core/config/load/load_config.h"
#include "daemon/core/loop/pipeline.h"
#include "daemon/core/publish/own_frames.h"
#include "tests/daemon/frame_player.h"
#include "tests/daemon/test_vehicle.h"

namespace beltgrip::daemon {
namespace {

using estimator::PeakKind;
using test::Drive;

// Loaded as it is: nothing is stated beyond it.
Config load(const std::string& toml, const std::string& model = "") {
  test::TemporaryDirectory directory;
  directory.write("vehicle.dbc", test::kVehicleDbc);
  if (!model.empty()) directory.write("model.toml", model);
  const ConfigResult result = load_config(directory.write("beltgripd.toml", toml));
  for (const auto& error : result.errors) ADD_FAILURE() << error.text;
  return result.config.value();
}

std::string without(std::string toml, const std::string& key) {
  const std::size_t at = toml.find("\n" + key + " =");
  EXPECT_NE(at, std::string::npos) << key;
  return toml.erase(at, toml.find('\n', at + 1) - at);
}

struct Played {
  std::vector<ExperimentResult> results;
  std::vector<SampleReport> reports;
  std::vector<test::SentFrame> sent;
};

Played play(const Config& config, const Drive& drive) {
  test::FramePlayer port(test::drive_frames(drive));
  test::ReportKeeper keeper;
  Pipeline pipeline(config);
  run_loop(port, pipeline, config.estimator.sample_rate_hz, estimator::StopReason::kTraceEnd,
           &keeper);
  return {keeper.results, keeper.reports, port.sent};
}

const std::vector<std::string> kConstants{"primary_radius_overdrive_m", "secondary_piston_area_m2",
                                          "secondary_spring_force_N", "secondary_centrifugal_N_s2",
                                          "primary_inertia_kg_m2"};

using Keys = std::set<std::string>;
Keys assumed_of(const Config& config) { return {config.assumed.begin(), config.assumed.end()}; }

TEST(Assumed, WhatIsLeftOutIsListedAndWhatIsStatedIsNot) {
  const std::string stated = test::stated(test::kVehicleToml);
  const Config exact = load(stated);
  EXPECT_TRUE(exact.assumed.empty());
  EXPECT_FALSE(exact.friction_is_assumed);
  EXPECT_TRUE(assumed_text(exact).empty());
  for (const std::string& key : kConstants) {
    const Config config = load(without(stated, key));
    EXPECT_EQ(assumed_of(config), Keys{"variator." + key});
    EXPECT_TRUE(config.friction_is_assumed);
    EXPECT_NE(assumed_text(config).find(key), std::string::npos);
  }
}

TEST(Assumed, AnAccuracyThatIsLeftOutIsThatOfOtherCarsAndZeroIsExact) {
  std::string toml = test::stated(test::kVehicleToml);
  const std::string pressure = "secondary_pressure = { bias_Pa = 0, gain = 0 }";
  toml.replace(toml.find(pressure), pressure.size(), "secondary_pressure = { bias_Pa = 0 }");
  const Config config = load(toml);
  EXPECT_EQ(assumed_of(config), Keys{"sensors.secondary_pressure.gain"});
  EXPECT_EQ(config.sensors.secondary_pressure.bias, 0.0);
  EXPECT_GE(config.sensors.secondary_pressure.gain, 0.01);
  EXPECT_LE(config.sensors.secondary_pressure.gain, 0.015);

  const Config bare = load(test::kVehicleToml);
  EXPECT_EQ(bare.assumed.size(), kConstants.size() + 8);
  EXPECT_EQ(bare.sensors.torque.bias, 2.5);  // 5 Nm are two deviations
  EXPECT_EQ(bare.sensors.torque.gain, 0.05);
  EXPECT_GE(bare.sensors.secondary_pressure.bias, 15e3);
  EXPECT_LE(bare.sensors.secondary_pressure.bias, 90e3);
}

TEST(Assumed, TheModelFilesKeysAreStated) {
  std::string toml = test::stated(test::kVehicleToml);
  toml = without(without(toml, "secondary_piston_area_m2"), "secondary_spring_force_N");
  toml += "[estimator]\nmodel = \"model.toml\"\n";
  const Config config = load(toml, "[variator]\nsecondary_piston_area_m2 = 0.0111\n");
  EXPECT_EQ(assumed_of(config), Keys{"variator.secondary_spring_force_N"});
  EXPECT_EQ(config.variator.secondary_piston_area_m2, 0.0111);
}

// --- coverage -------------------------------------------------------------------------------

// Cars as variators are: the ranges of public data, not of the code.
struct Draw {
  // share: of the one constant that is drawn, so that the cars lie evenly; else by chance.
  Draw(std::uint64_t seed, std::optional<double> share) : random(seed), one(share) {}
  double even(double least, double most) {
    const double by_chance = std::uniform_real_distribution<double>(0.0, 1.0)(random);
    return least + (most - least) * one.value_or(by_chance);
  }
  double normal(double deviation) { return deviation * std::normal_distribution<double>()(random); }
  std::mt19937_64 random;
  std::optional<double> one;
};

using Make = std::function<void(Drive&, Draw&)>;

void draw_radius(Drive& drive, Draw& draw) { drive.primary_radius_m = draw.even(0.075, 0.082); }
void draw_area(Drive& drive, Draw& draw) { drive.piston_area_m2 = draw.even(0.009, 0.013); }
void draw_spring(Drive& drive, Draw& draw) {
  drive.spring_force_N = 300.0 * std::pow(2000.0 / 300.0, draw.even(0.0, 1.0));
}
void draw_oil(Drive& drive, Draw& draw) { drive.centrifugal_N_s2 = draw.even(0.0, 0.012); }
void draw_sensors(Drive& drive, Draw& draw) {
  drive.torque_bias_Nm = draw.normal(2.5);
  drive.torque_gain = draw.normal(0.05);
  drive.pressure_bias_Pa = draw.normal(30e3);
  drive.pressure_gain = draw.normal(0.0125);
}

struct Coverage {
  int completed = 0, held = 0, impossible = 0, cars = 0;
  double share() const { return static_cast<double>(held) / static_cast<double>(completed); }
};

Coverage cover(const Config& config, int cars, const std::vector<Make>& makes) {
  Coverage found;
  for (int i = 0; i < cars; ++i) {
    std::optional<double> share;
    if (makes.size() == 1) share = (0.5 + i) / cars;
    Draw draw(static_cast<std::uint64_t>(1000 + i), share);
    Drive drive{.seed = static_cast<std::uint64_t>(i)};
    for (const Make& make : makes) make(drive, draw);
    ++found.cars;
    const Played run = play(config, drive);
    if (run.results.empty()) continue;
    const estimator::PeakEstimate& peak = run.results[0].peak;
    found.impossible += peak.impossible;
    if (run.results[0].outcome != Outcome::kCompleted) continue;
    ++found.completed;
    found.held += peak.ci95_low <= test::kTrueMuMax && test::kTrueMuMax <= peak.ci95_high;
  }
  return found;
}

TEST(Assumed, TheIntervalHoldsTheTruthWhicheverKeyIsLeftOut) {
  const std::string stated = test::stated(test::kVehicleToml);
  const std::vector<std::pair<std::string, Make>> rows{{"primary_radius_overdrive_m", draw_radius},
                                                       {"secondary_piston_area_m2", draw_area},
                                                       {"secondary_spring_force_N", draw_spring},
                                                       {"secondary_centrifugal_N_s2", draw_oil}};
  constexpr int kCars = 250;
  for (const auto& [key, make] : rows) {
    const Coverage found = cover(load(without(stated, key)), kCars, {make});
    std::printf("%s: %d of %d completed, %d no belt's, truth inside %.1f %%\n", key.c_str(),
                found.completed, found.cars, found.impossible, 100.0 * found.share());
    EXPECT_GE(found.completed + found.impossible, kCars * 9 / 10) << key;
    // The cars lie evenly: chance moves one or two of them across an end.
    EXPECT_GE(found.share(), 0.935) << key;
    EXPECT_LE(found.share(), 0.99) << key;
  }
  const Coverage all = cover(load(test::kVehicleToml), 2 * kCars,
                             {draw_radius, draw_area, draw_spring, draw_oil, draw_sensors});
  std::printf("all: %d of %d completed, %d no belt's, truth inside %.1f %%\n", all.completed,
              all.cars, all.impossible, 100.0 * all.share());
  EXPECT_GE(all.completed + all.impossible, 2 * kCars * 9 / 10);
  EXPECT_GE(all.share(), 0.93);
  EXPECT_LE(all.share(), 0.98);
}

// The clamp force that this torque needs with that friction and the margin of 1.3.
double needed_N(double mu, double torque_Nm) {
  return 1.3 * torque_Nm * std::cos(11.0 * 3.14159265358979 / 180.0) / (2.0 * 0.0784 * mu);
}

double min_clamp_N(const can::CanFrame& frame) {
  const can::MessageDef* message = own_database().find_message(frame.id);
  return can::SignalCodec(*message->find_signal("MinClampForce")).decode(frame.payload());
}

TEST(Assumed, MinClampForceRestsOnTheLowerEnd) {
  const std::string stated = test::stated(test::kVehicleToml);
  for (const bool assumes : {false, true}) {
    const Config config = load(assumes ? without(stated, "secondary_spring_force_N") : stated);
    Drive drive;
    drive.ramp_N_per_s = 250.0;
    const Played run = play(config, drive);
    ASSERT_EQ(run.results.size(), 1U);
    const estimator::PeakEstimate& peak = run.results[0].peak;
    ASSERT_EQ(run.results[0].outcome, Outcome::kCompleted);
    EXPECT_EQ(assumes, peak.ci95_low < 0.9 * peak.mu_max);
    EXPECT_LT(peak.noise_high - peak.noise_low, 0.1 * peak.mu_max);
    double last_N = 0.0;
    for (const test::SentFrame& each : run.sent) {
      if (each.frame.id.value == 0x6A0 && each.t > run.results[0].end) {
        last_N = min_clamp_N(each.frame);
      }
    }
    const double torque_Nm = std::abs(run.reports.back().curve.torque_p_Nm);
    ASSERT_GT(torque_Nm, 5.0);
    EXPECT_NEAR(last_N / needed_N(assumes ? peak.ci95_low : peak.mu_max, torque_Nm), 1.0, 0.05);
  }
}

TEST(Assumed, FrictionThatNoBeltHasIsNoResult) {
  for (const auto& [key, value] :
       std::vector<std::pair<std::string, std::string>>{{"secondary_piston_area_m2", "0.113"},
                                                        {"secondary_piston_area_m2", "0.00565"},
                                                        {"secondary_piston_area_m2", "0.00113"},
                                                        {"primary_radius_overdrive_m", "0.18"}}) {
    const std::string toml = without(test::stated(test::kVehicleToml), key);
    const std::string header = "[variator]\n";
    std::string wrong = toml;
    wrong.insert(toml.find(header) + header.size(), key + " = " + value + "\n");
    const Played run = play(load(wrong), {});
    ASSERT_EQ(run.results.size(), 1U) << key << value;
    EXPECT_EQ(run.results[0].outcome, Outcome::kInconclusive) << key << value;
    EXPECT_EQ(run.results[0].peak.kind, PeakKind::kNone) << key << value;
    EXPECT_TRUE(run.results[0].peak.impossible) << key << value;
    EXPECT_NE(run.reports.back().faults & fault_bit(Fault::kResultDoubtful), 0U) << key << value;
  }
}

// A request is made, and read, at the defaults of what is assumed, an observer reads in its middle:
// values of one are not the other's history.
TEST(Assumed, ObserverAndRequesterShareAHistoryOnlyWhereAllIsStated) {
  Config exact = load(test::stated(test::kVehicleToml));
  Config open = load(without(test::stated(test::kVehicleToml), "secondary_centrifugal_N_s2"));
  for (Config* config : {&exact, &open}) {
    const std::string observing = config_fingerprint(*config);
    config->control = Control::kCommand;
    EXPECT_EQ(config_fingerprint(*config) == observing, config == &exact);
  }
}

}  // namespace
}  // namespace beltgrip::daemon
