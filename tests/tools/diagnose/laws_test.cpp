// Short laws: a function that is told knot by knot, and the family it belongs to.
#include "tools/diagnose/infer/laws.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tools/diagnose/decide/learn.h"

namespace beltgrip::diagnose {
namespace {

// Over 40 to 100; each knot is measured by itself.
LearnedFit measured_fit(double precision, auto&& value) {
  LearnedFit out;
  out.cell.injection = kInjections.data();
  out.cell.abscissa.low = 40.0;
  out.cell.abscissa.high = 100.0;
  CellScore score;
  score.information = precision * KnotSquare::Identity();
  for (int i = 0; i < kCellKnots; ++i) {
    score.score[i] = precision * value(40.0 + 60.0 * i / (kCellKnots - 1));
  }
  out.laws = law_evidences({score}, *out.cell.injection, out.cell.abscissa);
  return out;
}

std::vector<std::string> names(const std::vector<LawEvidence>& laws) {
  std::vector<std::string> out;
  std::transform(laws.begin(), laws.end(), std::back_inserter(out),
                 [](const LawEvidence& each) { return std::string(each.name); });
  return out;
}

TEST(Laws, AStepStandsAlone) {
  const auto fit = measured_fit(400.0, [](double x) { return x > 71.0 ? 1.0 : 0.0; });
  const auto laws = possible_laws(fit);
  ASSERT_EQ(names(laws), std::vector<std::string>{"step"});
  ASSERT_EQ(named_law(fit, laws), &laws.front());
  EXPECT_TRUE(laws.front().text.starts_with("a step of 2")) << laws.front().text;
}

TEST(Laws, ALineIsFoundAndNothingFarFromIt) {
  const auto fit = measured_fit(400.0, [](double x) { return (x - 70.0) / 15.0; });
  const auto found = names(possible_laws(fit));
  ASSERT_FALSE(found.empty());
  EXPECT_EQ(found.front(), "linear");
  EXPECT_EQ(std::count(found.begin(), found.end(), "step"), 0);
  EXPECT_EQ(std::count(found.begin(), found.end(), "Gauss"), 0);
}

// Where hardly anything is known many laws will do, and none is named.
TEST(Laws, FewDataLeaveAClass) {
  const auto fit = measured_fit(2.0, [](double x) { return (x - 70.0) / 30.0; });
  const auto laws = possible_laws(fit);
  EXPECT_GT(laws.size(), 3U);
  EXPECT_EQ(named_law(fit, laws), nullptr);
}

// A law that stands alone but predicts what was left out worse than the free function is no law.
TEST(Laws, OneThatPredictsWorseIsNotNamed) {
  auto fit = measured_fit(400.0, [](double x) { return x > 71.0 ? 1.0 : 0.0; });
  fit.left_out_gain = 1.5;
  EXPECT_EQ(named_law(fit, possible_laws(fit)), nullptr);
}

}  // namespace
}  // namespace beltgrip::diagnose
