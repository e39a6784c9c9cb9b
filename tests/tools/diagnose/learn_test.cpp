// What decides whether a learned function is kept, from tests given by hand.
#include "tools/diagnose/decide/learn.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tools/diagnose/infer/gain.h"

namespace beltgrip::diagnose {
namespace {

Criticism tests(std::vector<JudgedTest> all) {
  Criticism out;
  out.tests = std::move(all);
  return out;
}

TEST(ExcessLeft, IsThatOfTheTestThatKeepsMost) {
  const Criticism before =
      tests({{"law_cell", 135.0, 35.0}, {"line", 10.0, 5.0}, {"whiteness", 1.0, 9.0}});
  // 20 of 100 and 3 of 5 are left; what passed before does not count, and no test heals another.
  EXPECT_DOUBLE_EQ(
      excess_left(before,
                  tests({{"law_cell", 55.0, 35.0}, {"line", 8.0, 5.0}, {"whiteness", 99.0, 9.0}})),
      0.6);
  EXPECT_DOUBLE_EQ(
      excess_left(before,
                  tests({{"law_cell", 0.0, 35.0}, {"line", 5.0, 5.0}, {"whiteness", 1.0, 9.0}})),
      0.0);
  EXPECT_DOUBLE_EQ(excess_left(before, before), 1.0);
}

// What failed by a hundredth of its limit and does so still does not stand against the rest.
TEST(ExcessLeft, ATrifleIsNotAll) {
  const Criticism before = tests({{"law_cell", 135.0, 35.0}, {"line", 5.05, 5.0}});
  const Criticism after = tests({{"law_cell", 10.0, 35.0}, {"line", 5.05, 5.0}});
  EXPECT_NEAR(excess_left(before, after), 0.04, 1e-9);
}

// A course that is left is as red as the whole; alone it decides.
TEST(ExcessLeft, OfWhitenessCountsOnlyAlone) {
  const Criticism both = tests({{"law_cell", 135.0, 35.0}, {"whiteness", 309.0, 9.0}});
  EXPECT_DOUBLE_EQ(excess_left(both, tests({{"law_cell", 55.0, 35.0}, {"whiteness", 308.0, 9.0}})),
                   0.2);
  const Criticism alone = tests({{"law_cell", 5.0, 35.0}, {"whiteness", 309.0, 9.0}});
  EXPECT_DOUBLE_EQ(excess_left(alone, tests({{"law_cell", 5.0, 35.0}, {"whiteness", 159.0, 9.0}})),
                   0.5);
}

TEST(ExcessLeft, IsNoneWhereNothingFailed) {
  const Criticism fine = tests({{"law_cell", 3.0, 35.0}});
  EXPECT_EQ(excess_left(fine, tests({{"law_cell", 99.0, 35.0}})), 0.0);
}

// A name that gains much on a machine that is wrong still makes none of what fails without it pass.
TEST(PassesAny, OneThatFailedAndDoesNotAnyMore) {
  const Criticism before =
      tests({{"law_cell", 135.0, 35.0}, {"line", 10.0, 5.0}, {"whiteness", 1.0, 9.0}});
  EXPECT_FALSE(passes_any(before, before));
  EXPECT_FALSE(passes_any(
      before, tests({{"law_cell", 50.0, 35.0}, {"line", 9.0, 5.0}, {"whiteness", 1.0, 9.0}})));
  EXPECT_TRUE(passes_any(
      before, tests({{"law_cell", 135.0, 35.0}, {"line", 5.0, 5.0}, {"whiteness", 1.0, 9.0}})));
  const Criticism fine = tests({{"law_cell", 3.0, 35.0}});
  EXPECT_FALSE(passes_any(fine, tests({{"law_cell", 1.0, 35.0}})));
}

// Zeros of the torque that scatter 2.6 times as much as replicates do, in eleven experiments, are
// worth 43; that of the friction twice as much is where the function acts.
TEST(LesserScatter, ElsewhereDoesNotSpeakAgainstAGreaterFunction) {
  const Criticism before = tests({{"law_cell", 169.0, 35.0},
                                  {"scatter_friction", 3.9, 2.2},
                                  {"scatter_torque", 2.62, 2.2},
                                  {"unusual_scatter", 5.0, 4.0},
                                  {"scatter_ratio", 1.0, 3.3}});
  EXPECT_EQ(lesser_scatter(before, "friction", 169.0, 11),
            std::vector<std::string>{"scatter_torque"});
  EXPECT_EQ(lesser_scatter(before, "friction", 40.0, 11), std::vector<std::string>{});
  EXPECT_EQ(lesser_scatter(before, "torque", 169.0, 11),
            std::vector<std::string>{"scatter_friction"});
  const Criticism after = tests({{"law_cell", 0.0, 35.0},
                                 {"scatter_friction", 0.7, 2.2},
                                 {"scatter_torque", 3.1, 2.2},
                                 {"unusual_scatter", 1.0, 4.0},
                                 {"scatter_ratio", 1.0, 3.3}});
  EXPECT_GT(excess_left(before, after), 1.0);
  EXPECT_LT(excess_left(before, after, {"scatter_torque"}), 0.0 + 1e-12);
}

// The gain of a torque is never off by more than a quarter, whatever stands beside it.
TEST(IsPossible, WithinWhatMachinesAreOffBy) {
  LearnedFit fit;
  fit.cell.injection = &*std::find_if(
      kInjections.begin(), kInjections.end(),
      [](const InjectionRow& row) { return row.injection == Injection::kTorqueGain; });
  fit.term.count = 2;
  fit.term.value[0] = 0.02;
  fit.term.value[1] = -0.24;
  EXPECT_TRUE(is_possible(fit));
  fit.term.value[1] = -0.26;
  EXPECT_FALSE(is_possible(fit));
}

// Beyond chance, by a tenth, and beyond what the sensors' noise is anyway.
TEST(IsClearlyWorse, ByMoreThanATenthBeyondChanceAndNoise) {
  const BeforeAfter worse{.before = 0.08, .after = 3.1, .low = -4.3, .high = -1.7};
  EXPECT_TRUE(is_clearly_worse(worse, 0.12));
  EXPECT_FALSE(is_clearly_worse(worse, 3.0));
  EXPECT_FALSE(is_clearly_worse({.before = 0.08, .after = 3.1, .low = -4.3, .high = 0.1}, 0.12));
  EXPECT_FALSE(is_clearly_worse({.before = 0.4, .after = 0.43, .low = -0.05, .high = -0.01}, 0.12));
  EXPECT_FALSE(is_clearly_worse({.before = 0.4, .after = 0.1, .low = 0.2, .high = 0.4}, 0.12));
}

// Nothing fails: nothing is learned, whatever the cells look like.
TEST(Learn, ANeedlessFunctionIsNotLookedFor) {
  Engine engine{Campaign{}};
  const Criticism fine = tests({{"law_cell", 3.0, 35.0}, {"smooth_cell", 3.0, 35.0}});
  const Learning learning = learn(
      engine, fine, [] { return false; }, [](const Engine&, const LearnedFit&) { return true; });
  EXPECT_TRUE(learning.terms.empty());
  EXPECT_TRUE(learning.needs_levels.empty());
}

}  // namespace
}  // namespace beltgrip::diagnose
