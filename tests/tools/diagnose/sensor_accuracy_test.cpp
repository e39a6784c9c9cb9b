// Sensors are off by what somebody stated of them: that is no finding, and part of what mu_max is
// known to. The recordings are the blind generator's.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/tools/diagnose/recorded_runs.h"
#include "tools/diagnose/decide/namer.h"
#include "tools/diagnose/infer/peak.h"
#include "tools/diagnose/infer/uncertainty.h"
#include "tools/diagnose/run/diagnose.h"

namespace beltgrip::diagnose {
namespace {

struct Diagnosed {
  std::vector<std::string> names;
  double gain = 0.0;  // named, and the sensors' own
};

Diagnosed diagnosed(double torque_gain, double accuracy) {
  blind::Trial trial;
  trial.seed = 7;
  blind::Random random(trial.seed);
  trial.plan = blind::draw_plan(random, trial.machine.setting, 10);
  trial.planted.push_back({"torque_gain", {{"gain", torque_gain}}, {}});
  Accuracies accuracies{};
  accuracies[static_cast<std::size_t>(Role::kPrimaryTorque)].gain = 0.6 * accuracy;
  accuracies[static_cast<std::size_t>(Role::kSecondaryTorque)].gain = 0.8 * accuracy;
  Engine engine(campaign_of(trial, accuracies));
  const Naming naming = name_effects(engine, [] { return false; });
  Diagnosed out;
  out.gain = -naming.hypothesis.state.nuisance[kSecondaryTorqueGain];
  for (const Accepted& each : naming.accepted) {
    const Slot& slot = engine.campaign().slots[static_cast<std::size_t>(each.slot)];
    out.names.emplace_back(slot.row->id);
    if (slot.row->id == "torque_gain") out.gain += naming.hypothesis.state.effects[each.slot];
  }
  return out;
}

TEST(SensorAccuracy, OfBothTorquesIsNoGain) {
  const Diagnosed d = diagnosed(0.02, 0.02);
  EXPECT_TRUE(d.names.empty());
  EXPECT_NEAR(d.gain, 0.02, 0.005);
}

TEST(SensorAccuracy, ThatNobodyStatedExcusesNothing) {
  const Diagnosed d = diagnosed(0.02, 0.0);
  ASSERT_EQ(d.names.size(), 1U);
  EXPECT_EQ(d.names.front(), "torque_gain");
}

TEST(SensorAccuracy, ExcusesNoGainFarBeyondIt) {
  const Diagnosed d = diagnosed(0.08, 0.01);
  ASSERT_EQ(d.names.size(), 1U);
  EXPECT_EQ(d.names.front(), "torque_gain");
  EXPECT_NEAR(d.gain, 0.08, 0.005);
}

// A car, whose only torque reads too much: the acceleration takes less of it than it should.
std::vector<std::string> names_of_a_car(double torque_gain, double stated) {
  blind::Trial trial;
  trial.seed = 7;
  blind::Random random(trial.seed);
  trial.machine.setting = blind::Setting::kCar;
  trial.plan = blind::draw_plan(random, trial.machine.setting, 10);
  for (blind::PlannedRun& run : trial.plan) run.profile = blind::Profile::kSpeedSweep;
  trial.planted.push_back({"torque_gain", {{"gain", torque_gain}}, {}});
  Accuracies accuracies{};
  accuracies[static_cast<std::size_t>(Role::kEngineTorque)].gain = stated;
  Engine engine(campaign_of(trial, accuracies));
  std::vector<std::string> out;
  for (const Accepted& each : name_effects(engine, [] { return false; }).accepted) {
    out.emplace_back(engine.campaign().slots[static_cast<std::size_t>(each.slot)].row->id);
  }
  return out;
}

TEST(SensorAccuracy, OfTheOnlyTorqueIsNoGain) {
  constexpr double kGain = 0.15;
  EXPECT_EQ(names_of_a_car(kGain, 0.0), std::vector<std::string>{"inertia_torque"});
  EXPECT_EQ(names_of_a_car(kGain, 0.2 * kGain), std::vector<std::string>{"inertia_torque"});
  EXPECT_TRUE(names_of_a_car(kGain, 0.5 * kGain).empty());
}

// Far beyond what sensors are off by it is no force of the turning oil, with another friction.
TEST(SensorAccuracy, OfThePressureMayBeFarBeyondWhatWasStated) {
  constexpr double kGain = -0.18;
  for (const std::uint64_t seed : {7U, 8U}) {
    SCOPED_TRACE(seed);
    blind::Trial trial;
    trial.seed = seed;
    blind::Random random(trial.seed);
    trial.machine = blind::draw_machine(random);
    trial.machine.setting = blind::Setting::kRig;
    trial.plan = blind::draw_plan(random, trial.machine.setting, 12);
    trial.planted.push_back({"pressure_gain", {{"gain", kGain}}, {}});
    Accuracies accuracies{};
    accuracies[static_cast<std::size_t>(Role::kSecondaryPressure)].gain = 0.005;
    Engine engine(campaign_of(trial, accuracies));
    const Naming naming = name_effects(engine, [] { return false; });
    ASSERT_EQ(naming.accepted.size(), 1U);
    const int slot = naming.accepted.front().slot;
    EXPECT_EQ(engine.campaign().slots[static_cast<std::size_t>(slot)].row->id, "pressure_gain");
    EXPECT_NEAR(naming.hypothesis.state.effects[slot], kGain, 0.2 * std::abs(kGain));
    EXPECT_NEAR(std::exp(naming.hypothesis.state.nuisance[kLnMuMax]), trial.machine.mu_max,
                0.03 * trial.machine.mu_max);
  }
}

struct Offset {
  std::vector<std::string> names;
  double as_machine_Pa = 0.0;
};

Engine with_offset(double offset_Pa, double stated_Pa) {
  blind::Trial trial;
  trial.seed = 7;
  blind::Random random(trial.seed);
  trial.plan = blind::draw_plan(random, trial.machine.setting, 10);
  trial.planted.push_back({"pressure_offset", {{"offset_Pa", offset_Pa}}, {}});
  Accuracies accuracies{};
  accuracies[static_cast<std::size_t>(Role::kSecondaryPressure)].bias = stated_Pa;
  return Engine(campaign_of(trial, accuracies));
}

Offset offset(double offset_Pa, double stated_Pa) {
  Engine engine = with_offset(offset_Pa, stated_Pa);
  const Naming naming = name_effects(engine, [] { return false; });
  Offset out;
  out.as_machine_Pa = naming.hypothesis.state.nuisance[kPressureBias_Pa];
  for (const Accepted& each : naming.accepted) {
    out.names.emplace_back(engine.campaign().slots[static_cast<std::size_t>(each.slot)].row->id);
  }
  return out;
}

TEST(SensorAccuracy, ThatWasStatedOfThePressureIsNoOffset) {
  constexpr double kOffset_Pa = 40e3;
  EXPECT_EQ(offset(kOffset_Pa, 0.0).names.size(), 1U);
  EXPECT_EQ(offset(kOffset_Pa, 0.1 * kOffset_Pa).names.size(), 1U);
  EXPECT_TRUE(offset(kOffset_Pa, kOffset_Pa).names.empty());
}

TEST(SensorAccuracy, OfThePressureIsAConstantOfTheMachine) {
  constexpr double kOffset_Pa = 40e3;
  EXPECT_NEAR(offset(kOffset_Pa, kOffset_Pa).as_machine_Pa, kOffset_Pa, 0.3 * kOffset_Pa);
  EXPECT_EQ(offset(kOffset_Pa, 0.0).as_machine_Pa, 0.0);
}

constexpr double kTold_N_s2 = 8e-3;

// A machine whose oil has that share of the force that its maker states.
Diagnosis with_turning_oil(double share) {
  blind::Trial trial;
  trial.seed = 7;
  blind::Random random(trial.seed);
  trial.plan = blind::draw_plan(random, trial.machine.setting, 10);
  trial.planted.push_back({"centrifugal_force", {{"coefficient_N_s2", share * kTold_N_s2}}, {}});
  Request request = request_of(trial);
  request.model.variator.secondary_centrifugal_N_s2 = kTold_N_s2;
  return diagnose(std::move(request)).diagnosis;
}

// A few hundredths are what makers' values are off by; a half is a cause.
TEST(MakersValue, OfTheTurningOilIsNoGainOfThePressure) {
  const Diagnosis nearly = with_turning_oil(0.94);
  EXPECT_EQ(nearly.verdict, Verdict::kNothingWrong);
  EXPECT_NEAR(nearly.machine.at("secondary_centrifugal_off_N_s2").value, -0.06 * kTold_N_s2,
              0.03 * kTold_N_s2);
  EXPECT_TRUE(std::any_of(nearly.notes.begin(), nearly.notes.end(), [](const std::string& note) {
    return note.starts_with("secondary_centrifugal_N_s2: 0.008 as told, 0.007");
  }));
  const Diagnosis half = with_turning_oil(0.5);
  ASSERT_FALSE(half.findings.empty());
  EXPECT_EQ(half.findings.front().effect, "centrifugal_force");
}

// What one usual scatter of the torque's zero comes to in the first experiment, in sigmas.
double usual_zero(double stated_bias_Nm) {
  blind::Trial trial;
  trial.seed = 7;
  blind::Random random(trial.seed);
  trial.plan = blind::draw_plan(random, trial.machine.setting, 10);
  Accuracies accuracies{};
  accuracies[static_cast<std::size_t>(Role::kPrimaryTorque)].bias = stated_bias_Nm;
  Engine engine(campaign_of(trial, accuracies));
  engine.fit_machine();
  engine.update_noise();
  constexpr int kZero = 2;
  return std::sqrt(engine.summaries().front().uu(kZero, kZero));
}

// A fifth of what was stated: hypot(0.1 Nm, 0.2 x 1 Nm) over 0.1 Nm.
TEST(SensorAccuracy, OfATorqueLetsItsZeroScatter) {
  const double usual = usual_zero(0.0);
  EXPECT_NEAR(usual_zero(1.0), std::sqrt(5.0) * usual, 0.1 * usual);
}

// An error that is hardly what was stated may as well make up for something else: mu_max is not
// known to what it would be with it.
TEST(SensorAccuracy, ThatIsHardlyEnoughLeavesMuMaxOpen) {
  constexpr double kStated_Pa = 20e3;
  const auto pushed = [&](double offset_Pa) {
    Engine engine = with_offset(offset_Pa, kStated_Pa);
    const Naming naming = name_effects(engine, [] { return false; });
    const FittedPeak peak = fitted_peak(engine, naming.hypothesis, kOverdriveStop);
    return variance_of_pushed(engine, naming.hypothesis, peak.height);
  };
  EXPECT_EQ(pushed(kStated_Pa), 0.0);
  EXPECT_GT(pushed(2.7 * kStated_Pa), std::pow(0.02, 2.0));
}

}  // namespace
}  // namespace beltgrip::diagnose
