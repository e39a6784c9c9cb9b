// The tests of the residuals of the model as given, all of them at once: of many one has a small p
// by chance alone.
#pragma once

#include <map>
#include <string>

#include "tools/diagnose/data/diagnosis.h"

namespace beltgrip::diagnose {

// What chance gives in fewer campaigns than this is none. Chosen, a share of healthy campaigns: it
// words the page and a note, the verdict does not rest on it. Of the 624 tests of the 24 campaigns
// of tools/DIAGNOSE.md one lies within a fifth of it.
inline constexpr double kNoChance = 1e-3;

struct BaselineTests {
  int count = 0;
  double least_p = 1.0;
  std::string signal, test;  // whose p that is
  // Share of healthy campaigns in which one of so many tests has a p as small.
  double by_chance(double p) const;
  bool fails(double p) const { return by_chance(p) < kNoChance; }
};
BaselineTests baseline_tests(const std::map<std::string, BaselineSignal>& baseline);

}  // namespace beltgrip::diagnose
