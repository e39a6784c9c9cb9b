// Which rivals of a name count against it.
#include "tools/diagnose/decide/rivals.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

namespace beltgrip::diagnose {
namespace {

const double kSure = std::log(kThereOdds) + 0.01, kUnsure = std::log(kThereOdds) - 0.01;

bool beside(const Rival& rival, double ln_odds, bool is_possible = true) {
  return stands_beside(rival, [&] { return Beside{ln_odds, is_possible}; });
}

TEST(StandsBeside, ARivalThatMayBeTheCauseCounts) {
  EXPECT_FALSE(beside({}, kSure));
  EXPECT_FALSE(beside({.repeats_one = true}, kSure));
}

TEST(StandsBeside, WhatIsTooSmallOrImpossibleDoesNotCount) {
  EXPECT_TRUE(beside({.is_no_name = true}, kSure));
  EXPECT_TRUE(beside({.is_possible = false}, kSure));
  EXPECT_TRUE(beside({.is_no_name = true, .is_possible = false}, kSure));
}

TEST(StandsBeside, OnlyWhereTheNameIsThereBesideIt) {
  EXPECT_FALSE(beside({.is_no_name = true}, kUnsure));
  EXPECT_FALSE(beside({.is_possible = false}, kUnsure));
  EXPECT_FALSE(beside({.is_no_name = true}, kSure, false));
  EXPECT_FALSE(beside({.is_possible = false}, kSure, false));
}

// Of one ramp what no machine has is several constants at once; what is small is small there too.
TEST(StandsBeside, WhatIsImpossibleCountsWhereOneRampIsRepeated) {
  EXPECT_FALSE(beside({.is_possible = false, .repeats_one = true}, kSure));
  EXPECT_TRUE(beside({.is_no_name = true, .repeats_one = true}, kSure));
}

TEST(StandsBeside, AsksForTheFitOnlyWhereItDecides) {
  int asked = 0;
  const auto fit = [&] {
    ++asked;
    return Beside{kSure, true};
  };
  stands_beside({}, fit);
  stands_beside({.is_possible = false, .repeats_one = true}, fit);
  EXPECT_EQ(asked, 0);
  stands_beside({.is_no_name = true}, fit);
  EXPECT_EQ(asked, 1);
}

// By the noise that the names leave, then by that of the function.
TEST(AreNoShadows, WhereTheDataAreMoreProbableWithNamesByEitherNoise) {
  const auto are_none = [](Contest by_names_noise, Contest by_functions_noise) {
    const std::array both{by_names_noise, by_functions_noise};
    return are_no_shadows(both);
  };
  EXPECT_TRUE(are_none({-90.0, -100.0}, {-95.0, -100.0}));
  EXPECT_FALSE(are_none({-90.0, -100.0}, {-100.0, -95.0}));
  EXPECT_FALSE(are_none({-100.0, -95.0}, {-90.0, -100.0}));
  EXPECT_FALSE(are_none({-100.0, -90.0}, {-100.0, -95.0}));
}

}  // namespace
}  // namespace beltgrip::diagnose
