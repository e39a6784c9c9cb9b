// The picture of a finding shows what the generator planted, in its unit, and nothing once it is in
// the model.
#include "tools/diagnose/report/finding_picture.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/tools/diagnose/recorded_runs.h"
#include "tools/diagnose/decide/namer.h"

namespace beltgrip::diagnose {
namespace {

// Of a drag any machine has 0.12 Nm/kN, which is no part of the finding.
constexpr double kLoss_Nm_per_kN = 0.9, kBeyond_Nm_per_kN = kLoss_Nm_per_kN - 0.12;

TEST(FindingPicture, IsTheCauseOverWhatItFollows) {
  blind::Trial trial;
  trial.seed = 11;
  blind::Random random(trial.seed);
  trial.plan = blind::draw_plan(random, trial.machine.setting, 8);
  trial.planted.push_back({"torque_loss", {{"per_kN_Nm", kLoss_Nm_per_kN}}, {}});
  Engine engine(campaign_of(trial));
  const Naming naming = name_effects(engine, [] { return false; });
  ASSERT_EQ(naming.accepted.size(), 1U);
  Finding finding;
  finding.effect = "torque_loss";
  finding.parameters["per_kN_Nm"] = {0.9, 0.8, 1.0};
  const std::vector<report::Chart> charts =
      pictures_of(engine.campaign(), naming.hypothesis.state, {finding});
  ASSERT_EQ(charts.size(), 1U);
  EXPECT_EQ(charts[0].title, "a drag that grows with the clamp force");
  EXPECT_EQ(charts[0].x_label, "secondary pressure, bar");
  ASSERT_EQ(charts[0].series.size(), 5U);
  const report::Series &low = charts[0].series[0], &high = charts[0].series[1],
                       &law = charts[0].series[2], &asked = charts[0].series[3],
                       &left = charts[0].series[4];
  EXPECT_TRUE(low.band && high.band);
  ASSERT_GT(law.x.size(), 20U);
  for (std::size_t i = 0; i < law.x.size(); ++i) {
    const double force_kN = 1e-3 * (0.0113 * 1e5 * law.x[i] + 500.0);
    EXPECT_NEAR(law.y[i], kBeyond_Nm_per_kN * force_kN, 0.1 * kBeyond_Nm_per_kN * force_kN) << i;
    EXPECT_NEAR(low.y[i] / law.y[i], 0.8 / 0.9, 1e-9);
    EXPECT_NEAR(high.y[i] / law.y[i], 1.0 / 0.9, 1e-9);
    EXPECT_NEAR(asked.y[i] - left.y[i], law.y[i], 1e-9);
    EXPECT_LT(std::abs(left.y[i]), 0.5) << i;  // of 1 to 8 Nm
  }
}

Engine healthy_machine();

// A function that is not there: the data ask for none, and what is left with it is its opposite.
TEST(FindingPicture, OfALearnedFunctionHasWhatTheDataAskFor) {
  Engine engine = healthy_machine();
  engine.update_noise();
  ModelState state = engine.state();
  estimator::LearnedTerm term;
  term.point = estimator::LearnedPoint::kTorque;
  term.variable = estimator::LearnedVariable::kTorque;
  term.count = 2;
  term.knot = {-200.0, 200.0};
  term.value = {-8.0, 8.0};
  state.learned = {term};
  LearnedFinding learned;
  learned.acts_on = "torque";
  learned.depends_on = {"primary_torque"};
  const auto points = points_of_learned(engine.campaign(), state, {learned});
  ASSERT_EQ(points.size(), 1U);
  ASSERT_EQ(points[0].size(), 2U);
  const report::Series &asked = points[0][0], &left = points[0][1];
  ASSERT_GT(asked.x.size(), 3U);
  double squares = 0.0, asked_slope = 0.0, left_slope = 0.0;  // each experiment has its own zero
  for (std::size_t i = 0; i < asked.x.size(); ++i) {
    squares += asked.x[i] * asked.x[i];
    asked_slope += asked.x[i] * asked.y[i];
    left_slope += asked.x[i] * left.y[i];
    EXPECT_NEAR(asked.y[i] - left.y[i], 0.04 * asked.x[i], 1e-2);
  }
  EXPECT_NEAR(asked_slope / squares, 0.0, 0.01);
  EXPECT_NEAR(left_slope / squares, -0.04, 0.01);
}

Engine healthy_machine() {
  blind::Trial trial;
  trial.seed = 12;
  blind::Random random(trial.seed);
  trial.plan = blind::draw_plan(random, trial.machine.setting, 6);
  Engine out(campaign_of(trial));
  out.fit_machine();
  return out;
}

// About the peak of friction and behind it a residual says nothing of the size of what is not in
// the model: the law is the equation there as well.
TEST(FindingPicture, IsTheEquationWhereTheCurveIsFlat) {
  const Engine engine = healthy_machine();
  constexpr double kCoefficient_N_s2 = 0.001;  // at most 292 N of 2.5 kN: their logs differ
  ModelState state = engine.state();
  const std::vector<Slot>& slots = engine.campaign().slots;
  for (std::size_t i = 0; i < slots.size(); ++i) {
    if (slots[i].row->id == "centrifugal_force") {
      state.effects[static_cast<Eigen::Index>(i)] = kCoefficient_N_s2;
    }
  }
  const std::vector<report::Chart> charts = pictures_of(engine.campaign(), state, {});
  ASSERT_EQ(charts.size(), 1U);
  const report::Series& law = charts[0].series[0];
  ASSERT_GT(law.x.size(), 10U);
  for (std::size_t i = 0; i < law.x.size(); ++i) {
    const double force_N = kCoefficient_N_s2 * law.x[i] * law.x[i];
    EXPECT_NEAR(law.y[i], force_N, 0.1 * force_N) << law.x[i];
  }
}

// A channel that comes late is off by as much as it changes meanwhile.
TEST(FindingPicture, OfALateChannelIsOverItsRate) {
  const Engine engine = healthy_machine();
  // The last comes early.
  constexpr double kDelay_s = 0.05, kPiston_m2 = 0.0113;
  double slowest_rad_s = 1e9, fastest_rad_s = 0.0;  // of both shafts
  for (const ExperimentData& run : engine.campaign().runs) {
    for (int k = 0; k < run.size(); ++k) {
      if (!run.valid[static_cast<std::size_t>(k)]) continue;
      slowest_rad_s = std::min({slowest_rad_s, run.omega_p.value[k], run.omega_s.value[k]});
      fastest_rad_s = std::max({fastest_rad_s, run.omega_p.value[k], run.omega_s.value[k]});
    }
  }
  struct Late {
    std::string_view role;
    const char *title, *x_label;
    double low, high;  // of what is shown, per unit of the rate
    double delay_s = kDelay_s;
  };
  constexpr double kForce_N = 1e5 * kPiston_m2 * kDelay_s, kRatio = 1e3 * kDelay_s;
  for (const Late& late :
       {Late{"secondary_pressure", "a channel that comes late: secondary_pressure",
             "rate of the secondary pressure, bar/s", 0.9 * kForce_N, 1.1 * kForce_N},
        Late{"secondary_speed", "a channel that comes late: secondary_speed",
             "acceleration of the secondary shaft, rad/s2", -kRatio / slowest_rad_s,
             -kRatio / fastest_rad_s},
        Late{"primary_speed", "a channel that comes early: primary_speed",
             "acceleration of the primary shaft, rad/s2", -kRatio / slowest_rad_s,
             -kRatio / fastest_rad_s, -kDelay_s}}) {
    ModelState state = engine.state();
    const std::vector<Slot>& slots = engine.campaign().slots;
    for (std::size_t i = 0; i < slots.size(); ++i) {
      if (slots[i].row->id == "channel_skew" && slots[i].role == late.role) {
        state.effects[static_cast<Eigen::Index>(i)] = late.delay_s;
      }
    }
    const std::vector<report::Chart> charts = pictures_of(engine.campaign(), state, {});
    ASSERT_EQ(charts.size(), 1U) << late.role;
    EXPECT_EQ(charts[0].title, late.title);
    EXPECT_EQ(charts[0].x_label, late.x_label);
    const report::Series& law = charts[0].series[0];
    ASSERT_GT(law.x.size(), 10U) << late.role;
    double product = 0.0, square = 0.0;
    for (std::size_t i = 0; i < law.x.size(); ++i) {
      product += law.x[i] * law.y[i];
      square += law.x[i] * law.x[i];
    }
    EXPECT_GT(product / square, late.low) << late.role;
    EXPECT_LT(product / square, late.high) << late.role;
  }
}

TEST(FindingPicture, IsNoneOfNothing) {
  const Campaign campaign{};
  EXPECT_TRUE(pictures_of(campaign, ModelState{}, {}).empty());
}

}  // namespace
}  // namespace beltgrip::diagnose
