// A function of a recorded variable, fitted to its end beside the machine and the accepted effects,
// and what it predicts of experiments that were left out.
#pragma once

#include <vector>

#include "tools/diagnose/infer/cells.h"
#include "tools/diagnose/infer/laws.h"

namespace beltgrip::diagnose {

struct LearnedFit {
  // Of the whole function, in units of the row. What the machine has a constant for is centred: the
  // constant belongs to it.
  Cell cell;
  estimator::LearnedTerm term;
  // Log predictive density of the experiments at levels that were left out of the fit, over that
  // without the function; levels at either end lie outside what the others cover.
  double left_out_gain = 0.0;
  std::vector<LawEvidence> laws;
  std::vector<bool> is_inner;  // per experiment: at such a level
  // Machine and function as the experiments of all other levels say they are; of an outer level, as
  // all other experiments do.
  std::vector<ModelState> folds;
};

// The engine's state has the function afterwards, beside those it had.
LearnedFit fit_learned(Engine& engine, const InjectionRow& row, const Abscissa& abscissa);
// Goes on from a fit whose function is the last of the engine's state.
LearnedFit fit_further(Engine& engine, const LearnedFit& before);

}  // namespace beltgrip::diagnose
