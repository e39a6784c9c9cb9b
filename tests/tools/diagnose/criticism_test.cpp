// What the tests of the residuals come to, from tests and functions given by hand.
#include "tools/diagnose/decide/criticism.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/tools/diagnose/recorded_runs.h"
#include "tools/diagnose/decide/learn.h"
#include "tools/diagnose/decide/namer.h"
#include "tools/diagnose/infer/index_variables.h"
#include "tools/diagnose/report/finding_words.h"

namespace beltgrip::diagnose {
namespace {

const IndexVariable* variable(std::string_view name) {
  const auto all = index_variables();
  return &*std::find_if(all.begin(), all.end(),
                        [&](const IndexVariable& each) { return each.name == name; });
}

// Of two experiments, with these means between 0 and 1.
Cell cell(Injection injection, std::string_view follows, double gain, double mean_first,
          double mean_second) {
  Cell out;
  out.injection =
      &*std::find_if(kInjections.begin(), kInjections.end(),
                     [&](const InjectionRow& row) { return row.injection == injection; });
  out.abscissa.variable = variable(follows);
  out.abscissa.high = 1.0;
  out.abscissa.x = {Eigen::ArrayXd::Constant(2, mean_first),
                    Eigen::ArrayXd::Constant(2, mean_second)};
  out.abscissa.mean = {mean_first, mean_second};
  out.law_gain = gain;
  return out;
}

// All tests pass but those given.
Criticism failing(const std::vector<std::string>& names, std::vector<Cell> cells = {}) {
  Criticism out;
  out.cells = std::move(cells);
  for (const char* name : {"law_cell", "smooth_cell", "held_cell", "own_shape", "line", "slow_line",
                           "channel_line", "torque_swing", "slip_swing", "belt_passage",
                           "whiteness", "scatter_friction", "scatter_ratio", "scatter_torque",
                           "unusual_scatter", "unusual_ratio", "unusual_friction"}) {
    const bool fails = std::find(names.begin(), names.end(), name) != names.end();
    out.tests.push_back({name, fails ? 10.0 : 0.0, 1.0});
  }
  return out;
}

// A campaign whose slots are one of each of these effects.
Campaign with_effects(const std::vector<std::string_view>& ids) {
  Campaign out;
  for (const std::string_view id : ids) {
    const auto rows = effect_rows();
    const auto row = std::find_if(rows.begin(), rows.end(),
                                  [&](const EffectRow& each) { return each.id == id; });
    EXPECT_NE(row, rows.end()) << id;
    out.slots.push_back({&*row, 0, {}});
  }
  return out;
}

TEST(OwnShape, IsTheBestOfWhatANamedEffectFollows) {
  const Campaign campaign = with_effects({"friction_temperature", "torque_gain"});
  const std::vector<Cell> cells{cell(Injection::kFriction, "torque", 20.0, 0.1, 0.1),
                                cell(Injection::kFriction, "oil_temperature", 5.0, 0.1, 0.1),
                                cell(Injection::kTorque, "oil_temperature", 9.0, 0.1, 0.1)};
  ASSERT_EQ(campaign.slots[0].row->depends_on, "oil_temperature");
  EXPECT_EQ(own_shape(campaign, {0}, cells), &cells[2]);
  EXPECT_EQ(own_shape(campaign, {}, cells), nullptr);
  EXPECT_EQ(own_shape(campaign, {0}, {cells[0]}), nullptr);
}

// The friction curve follows the torque as well: what it leaves beside a gain of the torque is no
// other course of that.
TEST(OwnShape, OverTheTorqueIsWhatActsWhereTheEffectDoes) {
  Campaign campaign = with_effects({"torque_gain"});
  campaign.has_balance = true;
  ASSERT_EQ(campaign.slots[0].row->depends_on, "torque");
  const std::vector<Cell> cells{cell(Injection::kFriction, "torque", 20.0, 0.1, 0.1),
                                cell(Injection::kTorque, "torque", 9.0, 0.1, 0.1)};
  EXPECT_EQ(own_shape(campaign, {0}, cells), &cells[1]);
  EXPECT_EQ(own_shape(campaign, {0}, {cells[0]}), nullptr);
}

TEST(OwnShape, AloneIsToldAsWhatItFollows) {
  Criticism left = failing({"own_shape"});
  left.own = cell(Injection::kFriction, "oil_temperature", 9.0, 0.1, 0.1);
  const Unexplained told = what_is_left(left, true);
  EXPECT_EQ(told.acts_on, "friction");
  EXPECT_EQ(told.depends_on, std::vector<std::string>{"oil_temperature"});
  EXPECT_EQ(told.kind, MisfitKind::kFunction);
}

TEST(Swing, IsToldAsALine) {
  Criticism torque = failing({"torque_swing"}), slip = failing({"slip_swing"});
  torque.swing = {"torque", 3.25, 10.0, 0.1};
  slip.slip_swing = {"ratio", 9.75, 10.0, 0.1};
  for (const auto& [left, line] : {std::pair{torque, torque.swing}, {slip, slip.slip_swing}}) {
    const Unexplained told = what_is_left(left, true);
    EXPECT_EQ(told.kind, MisfitKind::kLine);
    EXPECT_EQ(told.acts_on, line.acts_on);
    EXPECT_EQ(told.frequency_Hz, line.frequency_Hz);
  }
}

// Twelve experiments, warmer from one to the next, of which the friction differs by so much.
Criticism scattered(const std::vector<double>& friction) {
  Cell warmer = cell(Injection::kFriction, "oil_temperature", 20.0, 0.0, 1.0);
  warmer.abscissa.x.clear();
  warmer.abscissa.mean.clear();
  Criticism out = failing({"unusual_friction"});
  for (std::size_t e = 0; e < friction.size(); ++e) {
    const double place = static_cast<double>(e) / static_cast<double>(friction.size() - 1);
    warmer.abscissa.x.push_back(Eigen::ArrayXd::Constant(4, place));
    warmer.abscissa.mean.push_back(30.0 + 60.0 * place);
    out.offsets.push_back(RandomVector::Zero());
    out.offsets.back()[0] = friction[e];
  }
  warmer.abscissa.low = 30.0;
  warmer.abscissa.high = 90.0;
  out.cells.push_back(warmer);
  return out;
}

// By von Neumann's own definition: of 1, 2, 3 half the squares of what neighbours differ by are 1,
// the squares about the mean 2.
TEST(ScatterBetween, FollowsWhatNeighboursAlongItAreAlikeBy) {
  const Criticism three = scattered({1.0, 2.0, 3.0});
  EXPECT_NEAR(unlikeness(three.cells.front(), three.offsets, 0), 0.5, 1e-12);
  const Criticism level = scattered({1.0, 1.0, 1.0});
  EXPECT_EQ(unlikeness(level.cells.front(), level.offsets, 0), 1.0);
  const std::vector<double> grows{-5.0, -4.0, -3.0, -2.5, -1.0, 0.0, 0.5, 1.5, 2.0, 3.0, 4.0, 5.0};
  EXPECT_EQ(what_is_left(scattered(grows), true).depends_on,
            std::vector<std::string>{"oil_temperature"});
  const std::vector<double> jumps{-5.0, 3.0, -1.0, 0.5, 4.0, -2.5, 5.0, -4.0, 2.0, -3.0, 1.5, 0.0};
  const Unexplained told = what_is_left(scattered(jumps), true);
  EXPECT_TRUE(told.depends_on.empty());
  EXPECT_EQ(told.kind, MisfitKind::kBetweenRuns);
}

// What moves within an experiment, and the balance of the torques, shows what no model has of the
// machine's dynamics.
TEST(HeldGain, IsOfWhatExperimentsHold) {
  Cell one = cell(Injection::kFriction, "primary_speed", 30.0, 0.1, 0.9);
  one.smooth_gain = 12.0;
  EXPECT_EQ(held_gain(one), 30.0);
  one.smooth_gain = 9.0;  // a step that no smooth function sees
  EXPECT_EQ(held_gain(one), 9.0);
  for (const auto& [point, follows] :
       {std::pair{Injection::kFriction, "time"}, std::pair{Injection::kRatio, "acceleration"},
        std::pair{Injection::kTorque, "primary_speed"},
        std::pair{Injection::kTorqueGain, "oil_temperature"}}) {
    Cell other = cell(point, follows, 30.0, 0.1, 0.9);
    other.smooth_gain = 12.0;
    EXPECT_EQ(held_gain(other), 0.0) << follows;
  }
  one.is_told_by_form = true;
  EXPECT_EQ(held_gain(one), 0.0);
}

TEST(RepeatsWithin, WhatFollowsAVariableThatChangesInEachExperiment) {
  const Cell within = cell(Injection::kRatio, "time", 900.0, 0.5, 0.5);
  const Cell between = cell(Injection::kFriction, "oil_temperature", 900.0, 0.1, 0.9);
  EXPECT_TRUE(repeats_within(failing({"law_cell"}, {within, between})));
  EXPECT_TRUE(repeats_within(failing({"smooth_cell"}, {within})));
  EXPECT_TRUE(repeats_within(failing({"held_cell"}, {within})));
  EXPECT_FALSE(repeats_within(failing({"law_cell"}, {between, within})));
  EXPECT_FALSE(repeats_within(failing({"scatter_friction"}, {within})));  // it does not stand out
  EXPECT_FALSE(repeats_within(failing({"law_cell"})));
  // Experiments of other lengths: the time has another mean in each, and passes all the same.
  Cell time = cell(Injection::kTorque, "time", 900.0, 0.2, 0.9);
  time.abscissa.x.assign(2, Eigen::ArrayXd::LinSpaced(5, 0.0, 0.6));
  EXPECT_TRUE(repeats_within(failing({"law_cell"}, {time})));
  time.abscissa.x.assign(2, Eigen::ArrayXd::LinSpaced(5, 0.2, 0.3));
  EXPECT_FALSE(repeats_within(failing({"law_cell"}, {time})));
}

// The same scatter is left with and without a name. It is what the name was made of where all that
// it explains lies between experiments, and something else where it explains what repeats in each.
TEST(IsShadowed, ByScatterOnlyWhatDoesNotRepeat) {
  const Campaign campaign = with_effects({"clamp_hysteresis"});
  const Criticism left = failing({"scatter_friction"});
  const Cell within = cell(Injection::kRatio, "time", 900.0, 0.5, 0.5);
  const Cell between = cell(Injection::kFriction, "oil_temperature", 900.0, 0.1, 0.9);
  EXPECT_TRUE(
      is_shadowed(campaign, {0}, failing({"law_cell", "scatter_friction"}, {between}), left));
  EXPECT_TRUE(is_shadowed(campaign, {0}, failing({"scatter_friction"}, {within}), left));
  EXPECT_FALSE(
      is_shadowed(campaign, {0}, failing({"law_cell", "scatter_friction"}, {within}), left));
}

TEST(IsShadowed, NotByWhatActsElsewhereNorByWhatIsHealed) {
  Campaign campaign = with_effects({"torque_gain"});
  campaign.has_balance = true;
  const Criticism without = failing({"scatter_friction"});
  EXPECT_FALSE(is_shadowed(campaign, {0}, without, failing({"scatter_friction"})));
  EXPECT_FALSE(is_shadowed(with_effects({"friction_load"}), {0}, without, failing({})));
  EXPECT_FALSE(is_shadowed(campaign, {}, without, without));
}

// One shaft is held and gives way a little, the other one slips: what moves there is no cause.
TEST(Acceleration, IsNoneWhereAShaftIsHeld) {
  ExperimentData run;
  constexpr int kSamples = 50;
  const Eigen::ArrayXd ramp = Eigen::ArrayXd::LinSpaced(kSamples, -1.0, 1.0);
  run.t_s = ramp;
  run.valid.assign(kSamples, true);
  run.valid_count = kSamples;
  const auto moves = [&](GridSignal& speed, double mean_rad_s, double by_share) {
    speed.slow = mean_rad_s * (1.0 + 0.5 * by_share * ramp);
    speed.slow_slope = Eigen::ArrayXd::Constant(kSamples, mean_rad_s * by_share);
  };
  moves(run.omega_p, 150.0, 0.10);
  moves(run.omega_s, 300.0, 0.002);
  EXPECT_TRUE((variable("acceleration")->value(run, 0) == 0.0).all());
  moves(run.omega_s, 300.0, 0.08);
  EXPECT_TRUE((variable("acceleration")->value(run, 0) == run.omega_p.slow_slope).all());
}

// The more experiments tell it, the less it may be. By tables of F: 14.33 is exceeded in one of a
// thousand by 9 over 7 degrees of freedom.
TEST(ScatterLimit, FollowsFromHowWellItIsTold) {
  EXPECT_NEAR(scatter_limit(2.5, 9), 3.75, 1e-12);
  EXPECT_LT(scatter_limit(2.5, 40), scatter_limit(2.5, 6));
  EXPECT_NEAR(replicate_limit(10, 7.0), std::sqrt(14.33), 0.01);
  EXPECT_LT(replicate_limit(10, 12.0), replicate_limit(10, 7.0));
}

// A belt whose friction differs by 0.8 % from one experiment to the next, as healthy ones may, and
// one of 2.5 %; the same draws.
TEST(Scatter, OfTheFrictionThatBeltsHaveIsNoFinding) {
  const auto passes = [](double scatter) {
    blind::Trial trial;
    trial.seed = 5006;
    blind::Random random(trial.seed);
    trial.machine = blind::draw_machine(random);
    trial.machine.scatter_friction = scatter;
    trial.plan = blind::draw_plan(random, trial.machine.setting, 8);
    Engine engine(campaign_of(trial));
    name_effects(engine, [] { return false; });
    const Criticism criticism = criticise(engine);
    for (const JudgedTest& each : criticism.tests) {
      EXPECT_FALSE(words_of_test(each.name).empty()) << each.name;
    }
    return criticism.test("scatter_friction").passed() &&
           criticism.test("unusual_friction").passed();
  };
  EXPECT_TRUE(passes(0.008));
  EXPECT_FALSE(passes(0.025));
}

// A belt that seats anew by more than belts do. Ten times what is usual: a hundredth is usual.
TEST(Scatter, OfTheRatioBeyondWhatSeatsDoIsToldAsThat) {
  const Unexplained told = what_is_left(failing({"unusual_ratio"}), true);
  EXPECT_EQ(told.acts_on, "ratio");
  EXPECT_EQ(told.kind, MisfitKind::kBetweenRuns);
  EXPECT_NEAR(told.share, 0.99, 1e-12);
}

}  // namespace
}  // namespace beltgrip::diagnose
