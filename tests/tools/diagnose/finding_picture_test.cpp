// The picture of a finding shows what the generator planted, in its unit, and nothing once it is in
// the model.
#include "tools/diagnose/report/finding_picture.h"

#include <gtest/gtest.h>

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

// About the peak of friction and behind it a residual says nothing of the size of what is not in
// the model: the law is the equation there as well.
TEST(FindingPicture, IsTheEquationWhereTheCurveIsFlat) {
  blind::Trial trial;
  trial.seed = 12;
  blind::Random random(trial.seed);
  trial.plan = blind::draw_plan(random, trial.machine.setting, 6);
  Engine engine(campaign_of(trial));
  engine.fit_machine();
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

TEST(FindingPicture, IsNoneOfNothing) {
  const Campaign campaign{};
  EXPECT_TRUE(pictures_of(campaign, ModelState{}, {}).empty());
}

}  // namespace
}  // namespace beltgrip::diagnose
