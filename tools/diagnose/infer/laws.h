// Short laws for a function of a recorded variable: how much better each family explains it than
// none.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "tools/diagnose/infer/cells.h"

namespace beltgrip::diagnose {

struct LawEvidence {
  std::string_view name;       // of the family: linear, logarithm, step, ...
  double log_evidence = 0.0;   // over none, averaged over the family's shapes and sizes
  double left_out_gain = 0.0;  // of levels that were left out, as of a LearnedFit
  std::string text;            // the law as it fits best, with its figures
};

// scores: of the whole function, by scatter. A family that the range of the variable forbids (the
// logarithm of what may be zero) is left out.
std::vector<LawEvidence> law_evidences(const std::vector<CellScore>& scores,
                                       const InjectionRow& row, const Abscissa& abscissa);

}  // namespace beltgrip::diagnose
