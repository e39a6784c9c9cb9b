// The tests of the residuals of the model as given, all of them at once: of many one has a small p
// by chance alone.
#pragma once

#include <map>
#include <string>

#include "tools/diagnose/data/diagnosis.h"

namespace beltgrip::diagnose {

// What chance gives in fewer campaigns than this is none; chosen.
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
