// How surely the largest friction is known: where the samples end below the peak of the curve, and
// what effects that the experiments do not show would have it differ by.
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "tests/tools/diagnose/recorded_runs.h"
#include "tools/diagnose/infer/peak.h"
#include "tools/diagnose/infer/uncertainty.h"
#include "tools/diagnose/run/diagnose.h"

namespace beltgrip::diagnose {
namespace {

constexpr double kOfOne = 1e-4;  // variance of the friction in one experiment

CurveShape nominal_curve() {
  static constexpr std::array<double, kShapeKnots> kNone{};
  return CurveShape(kNone, 0.0);
}

TEST(HeightBeyond, LiesAnywhereBetweenWhatWasReachedAndTheFormsPeak) {
  const CurveShape curve = nominal_curve();
  const double ln_end = std::log(curve.evaluate(0.4).value);
  const CurveHeight told = height_beyond(curve, {0.4, {}}, 0.0, kOfOne);
  EXPECT_NEAR(told.ln, 0.5 * ln_end, 1e-9);
  EXPECT_NEAR(told.sigma, -ln_end / std::sqrt(12.0), 1e-9);
}

TEST(HeightBeyond, ABeltThatRunsAwayWhileTheLoadHardlyMovesHasComeToThePeak) {
  const CurveShape curve = nominal_curve();
  const double ln_end = std::log(curve.evaluate(0.4).value);
  const ReachedCurve reached{0.4, {{0.4, 0.01}, {0.4, 0.01}, {0.4, 0.01}}};
  const CurveHeight told = height_beyond(curve, reached, 0.0, kOfOne);
  EXPECT_NEAR(told.ln, ln_end + 0.005, 0.01);
  EXPECT_LT(told.sigma, 0.01);
}

TEST(HeightBeyond, WhatRunsAwayFromAFastLoadTellsLittle) {
  const CurveShape curve = nominal_curve();
  const CurveHeight none = height_beyond(curve, {0.4, {}}, 0.0, kOfOne);
  const CurveHeight told = height_beyond(curve, {0.4, {{0.2, 2.0}}}, 0.0, kOfOne);
  EXPECT_NEAR(told.sigma, none.sigma, 0.1 * none.sigma);
}

TEST(HeightBeyond, NeverLeavesItsBounds) {
  const CurveShape curve = nominal_curve();
  const double ln_end = std::log(curve.evaluate(0.4).value);
  EXPECT_DOUBLE_EQ(height_beyond(curve, {0.4, {{0.1, 0.0}}}, 0.0, 1e-12).ln, ln_end);
  EXPECT_LE(height_beyond(curve, {0.4, {{1.0, 0.1}}}, 0.0, 1e-12).ln, 0.0);
  EXPECT_DOUBLE_EQ(
      height_beyond(curve, {1.2, {}}, std::log(curve.evaluate(1.2).value), kOfOne).sigma, 0.0);
}

blind::Trial trial_of(bool equal, double spring_N) {
  blind::Trial trial;
  trial.seed = 11;
  blind::Random random(trial.seed);
  trial.plan = equal ? blind::paper_plan(6) : blind::draw_plan(random, trial.machine.setting, 10);
  if (spring_N != 0.0) trial.planted.push_back({"spring_force", {{"force_N", spring_N}}, {}});
  return trial;
}

// Ramps that are all the same: an offset of the clamp force and the friction are one thing there.
TEST(MuMax, OfEqualRampsCountsWhatTheyDoNotShow) {
  const blind::Trial trial = trial_of(true, -800.0);
  Request request;
  request.model = nominal_model({});
  request.model.variator.primary_inertia_kg_m2 = trial.machine.primary_inertia_kg_m2;
  for (const std::string& text : blind::record(trial).csv) {
    request.experiments.push_back(parse_csv(text, "run.csv"));
  }
  const Answer answer = diagnose(std::move(request));
  const Interval& told = answer.diagnosis.machine.at("mu_max");
  EXPECT_GT(trial.machine.mu_max, told.low);
  EXPECT_LT(trial.machine.mu_max, told.high);
  const auto& notes = answer.diagnosis.notes;
  EXPECT_TRUE(std::any_of(notes.begin(), notes.end(), [](const std::string& note) {
    return note.starts_with("mu_max: ") && note.find("cannot show") != std::string::npos;
  }));
  ASSERT_TRUE(answer.diagnosis.next_experiment);
  EXPECT_NE(answer.diagnosis.next_experiment->text.find("leaves most of mu_max open"),
            std::string::npos);
}

struct Spring {
  bool is_seen = false;
  double opens = 0.0;  // one sigma of mu_max, relative
};
Spring spring_in(bool equal) {
  Engine engine(campaign_of(trial_of(equal, 0.0)));
  engine.fit_machine();
  engine.update_noise();
  Spring out;
  const Hypothesis none = engine.refine({});
  for (const Score& score : engine.screen()) {
    const Slot& slot = engine.campaign().slots[static_cast<std::size_t>(score.slot)];
    if (slot.row->id != "spring_force") continue;
    out.is_seen = is_seen(score, slot);
    const LeftOpen open =
        left_open(engine, {score}, fitted_peak(engine, none, kOverdriveStop).height);
    out.opens = std::sqrt(open.variance);
    EXPECT_EQ(open.by_effect.size(), 1U);
  }
  return out;
}

TEST(LeftOpen, VariedExperimentsShowTheSpringAndEqualOnesDoNot) {
  const Spring varied = spring_in(false), equal = spring_in(true);
  EXPECT_TRUE(varied.is_seen);
  EXPECT_FALSE(equal.is_seen);
  EXPECT_GT(equal.opens, 3.0 * varied.opens);
}

struct Fitted {
  Fitted() : engine(campaign_of(trial_of(true, 0.0))) {
    engine.fit_machine();
    engine.update_noise();
    none = engine.refine({});
    lever = fitted_peak(engine, none, kOverdriveStop).height;
  }
  Score score_of(std::string_view effect) const {
    for (const Score& score : engine.screen()) {
      if (engine.campaign().slots[static_cast<std::size_t>(score.slot)].row->id == effect) {
        return score;
      }
    }
    return {};
  }
  Engine engine;
  Hypothesis none;
  Eigen::VectorXd lever;
};

// Half of the best gain counts, less does not; and no size beyond what machines have.
TEST(Unexplained, MayBeAnyEffectThatExplainsHalfOfWhatTheBestDoes) {
  const Fitted fitted;
  Score spring = fitted.score_of("spring_force"), speed = fitted.score_of("friction_speed");
  spring.value = 300.0;
  spring.gain = 100.0;
  speed.value = 0.5;
  speed.gain = 40.0;
  const double alone = variance_of_halves(fitted.engine, {spring}, fitted.lever);
  EXPECT_GT(alone, 0.0);
  EXPECT_DOUBLE_EQ(variance_of_halves(fitted.engine, {spring, speed}, fitted.lever), alone);
  spring.value = 3000.0;
  const double largest = variance_of_halves(fitted.engine, {spring}, fitted.lever);
  EXPECT_NEAR(largest, 100.0 * alone, 1e-9 * largest);
  spring.value = 1e6;
  EXPECT_DOUBLE_EQ(variance_of_halves(fitted.engine, {spring}, fitted.lever), largest);
}

// A loss that the fit has bent stands for as much in the friction as it would take back.
TEST(Unexplained, CountsWhatBentConstantsMakeUpFor) {
  Fitted fitted;
  const NuisanceTable& rows = fitted.engine.campaign().nuisances;
  for (const int p : fitted.engine.active_nuisances()) {
    if (p > kEndOfShapes) {
      fitted.none.state.nuisance[p] = rows[static_cast<std::size_t>(p)].nominal;
    }
  }
  EXPECT_NEAR(variance_of_bending(fitted.engine, fitted.none, fitted.lever), 0.0, 1e-12);
  const NuisanceRow& loss = rows[kLossConstant_Nm];
  const auto bent_by = [&](double tolerances) {
    fitted.none.state.nuisance[kLossConstant_Nm] = loss.nominal - tolerances * loss.tolerance;
    return variance_of_bending(fitted.engine, fitted.none, fitted.lever);
  };
  EXPECT_GT(bent_by(1.0), 0.0);
  EXPECT_NEAR(bent_by(10.0), 100.0 * bent_by(1.0), 1e-6 * bent_by(10.0));
}

}  // namespace
}  // namespace beltgrip::diagnose
