#include "tools/diagnose/data/baseline_tests.h"

#include <cmath>

namespace beltgrip::diagnose {

double BaselineTests::by_chance(double p) const {
  return p < 1.0 ? -std::expm1(count * std::log1p(-p)) : 1.0;
}

BaselineTests baseline_tests(const std::map<std::string, BaselineSignal>& baseline) {
  BaselineTests out;
  for (const auto& [signal, of] : baseline) {
    for (const auto& [test, p] : of.tests) {
      ++out.count;
      if (p >= out.least_p) continue;
      out.least_p = p;
      out.signal = signal;
      out.test = test;
    }
  }
  return out;
}

}  // namespace beltgrip::diagnose
