// The inner products of a function's values at its knots with everything else that is fitted.
#pragma once

#include <vector>

#include "tools/diagnose/infer/cells.h"

namespace beltgrip::diagnose {

// What a unit of the row changes at each sample, times a size there.
QuantityChange unit_change(const ModelState& state, const Residuals& at, const InjectionRow& row,
                           const Eigen::ArrayXd& size);

// What no function changes: the columns of all experiments, and what the scatter between them may
// be.
struct CellBase {
  std::vector<int> runs;        // those with valid samples
  std::vector<RawColumns> raw;  // parameters
  std::vector<ResidualColumns> residual;
  std::vector<Residuals> at;
  std::vector<int> parameters;
  Prior prior;
  std::vector<Scatter> scatter;  // from the fitted to the usual
};
CellBase cell_base(const Engine& engine);

struct CellColumns {
  std::vector<Summary> summaries;  // per run of the base: parameters, knots, residual
};
// The base is used on the way and left as it was.
CellColumns cell_columns(const Engine& engine, CellBase& base, const Abscissa& abscissa,
                         const InjectionRow& row);

// By scatter. present: what of the function the engine's state has already; the scores are of the
// whole function. left_out: runs that do not count.
std::vector<CellScore> scores_of(const CellColumns& columns, const CellBase& base,
                                 const KnotVector& present, const std::vector<int>& left_out = {});

// Takes out of the scores the directions of the function that the machine's constants could as well
// be, whatever their usual values: what they say of those rests on priors alone. For judging
// whether there is anything; in a fit, where both are free, priors share such a direction out, and
// scores without it would move it a little further with every step.
void keep_own(const CellColumns& columns, const CellBase& base, std::vector<CellScore>& scores);

// Where the machine and the accepted effects go, scaled, when the function changes by so much.
Eigen::VectorXd step_beside(const CellColumns& columns, const CellBase& base,
                            const KnotVector& change, const std::vector<int>& left_out);

}  // namespace beltgrip::diagnose
