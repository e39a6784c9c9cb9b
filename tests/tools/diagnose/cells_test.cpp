// Evidence of a function given its information and score, against integrals done by hand.
#include "tools/diagnose/infer/cells.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string_view>

#include "tests/tools/diagnose/recorded_runs.h"

namespace beltgrip::diagnose {
namespace {

// Every knot is measured by itself: `precision`, values as given.
Cell measured(double precision, auto&& value) {
  Cell cell;
  CellScore score;
  score.information = precision * KnotSquare::Identity();
  for (int i = 0; i < kCellKnots; ++i) {
    score.score[i] = precision * value(static_cast<double>(i) / (kCellKnots - 1));
  }
  score.misfit = score.score.squaredNorm() / precision;
  cell.scores = {score};
  return cell;
}

TEST(Cells, NothingIsWorthLessThanNothing) {
  Cell cell = measured(100.0, [](double) { return 0.0; });
  judge_cell(cell);
  EXPECT_LT(cell.law_gain, 0.0);
  EXPECT_LT(cell.smooth_gain, 0.0);
  EXPECT_NEAR(cell.mean.norm(), 0.0, 1e-9);
}

TEST(Cells, AStepIsALawBeforeItIsSmooth) {
  const auto step = [](double x) { return x > 0.52 ? 1.0 : 0.0; };
  Cell cell = measured(100.0, step);
  judge_cell(cell);
  // Ten knots of size one: 1000 without the price of place and size.
  EXPECT_GT(cell.law_gain, 950.0);
  EXPECT_LT(cell.law_gain, 1000.0);
  EXPECT_GT(cell.law_gain, cell.smooth_gain + 10.0);
  for (int i = 0; i < kCellKnots; ++i) {
    const double x = static_cast<double>(i) / (kCellKnots - 1);
    EXPECT_NEAR(cell.mean[i], step(x), 0.05) << x;
  }
  EXPECT_GT(cell.share, 0.95);
}

TEST(Cells, WhatScatterTakesMustNotHideWhatRepeats) {
  // The same data told twice: with much scatter next to nothing is known, with the usual one the
  // function stands out, though without it that scatter is 30 nats less likely.
  const auto bump = [](double x) { return std::exp(-0.5 * (x - 0.5) * (x - 0.5) / 0.01); };
  Cell cell = measured(1.0, bump);
  Cell sharp = measured(400.0, bump);
  sharp.scores.front().log_likelihood = cell.scores.front().log_likelihood - 30.0;
  const double swallowed = [&] {
    Cell alone = cell;
    judge_cell(alone);
    return alone.gain();
  }();
  cell.scores.push_back(sharp.scores.front());
  judge_cell(cell);
  EXPECT_LT(swallowed, 10.0);
  EXPECT_GT(cell.gain(), 100.0);
  EXPECT_EQ(cell.scores.size(), 2U);
}

// The largest gain over the time, on ramps.
double most_over_time(const blind::Planted& planted) {
  blind::Trial trial;
  trial.seed = 9;
  blind::Random random(trial.seed);
  trial.plan = blind::draw_plan(random, trial.machine.setting, 8);
  for (blind::PlannedRun& run : trial.plan) run.profile = blind::Profile::kRamps;
  trial.planted = {planted};
  Engine engine(campaign_of(trial));
  engine.fit_machine();
  engine.update_noise();
  engine.accept(engine.refine({}));
  engine.update_noise();
  double most = 0.0;
  for (const Cell& cell : score_cells(engine)) {
    const bool is_time = std::string_view(cell.abscissa.variable->name) == "time";
    if (is_time) most = std::max(most, cell.gain());
  }
  return most;
}

TEST(CellsOverTime, AreNotWhatAnotherFormOfFrictionDoes) {
  EXPECT_LT(most_over_time({"x_friction_form", {{"size", 0.02}}, ""}), 1.0);
}

TEST(CellsOverTime, AreWhatChangesFromSecondToSecond) {
  EXPECT_GT(most_over_time({"warm_up_drift", {{"per_start", 0.1}}, ""}), 1e3);
}

}  // namespace
}  // namespace beltgrip::diagnose
