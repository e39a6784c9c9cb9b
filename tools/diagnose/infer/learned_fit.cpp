#include "tools/diagnose/infer/learned_fit.h"

#include <algorithm>
#include <cmath>

#include "tools/diagnose/infer/cell_columns.h"

namespace beltgrip::diagnose {
namespace {

using Eigen::ArrayXd;
using estimator::LearnedTerm;

constexpr int kPassesMax = 6;          // function and machine in turn
constexpr int kSettling = 10;          // steps of the machine beside the function
constexpr double kStill = 0.1;         // of the row's unit: moves no more
constexpr double kLevelStepMax = 0.5;  // in tolerances: what a level may move the fit by

static_assert(kCellKnots <= LearnedTerm::kKnotsMax);

// Share of the samples at each knot.
KnotVector weights(const Campaign& campaign, const Abscissa& abscissa) {
  KnotVector out = KnotVector::Zero();
  for (std::size_t e = 0; e < campaign.runs.size(); ++e) {
    const ArrayXd& x = abscissa.x[e];
    for (Eigen::Index k = 0; k < x.size(); ++k) {
      if (!campaign.runs[e].valid[static_cast<std::size_t>(k)]) continue;
      for (int knot = 0; knot < kCellKnots; ++knot) {
        out[knot] += std::max(0.0, 1.0 - std::abs(x[k] * (kCellKnots - 1) - knot));
      }
    }
  }
  return out / std::max(out.sum(), 1e-300);
}

bool has_constant(Injection injection) {
  return injection == Injection::kFriction || injection == Injection::kTorque ||
         injection == Injection::kRatio;
}

void centre(const KnotVector& weight, Cell& cell) {
  if (!has_constant(cell.injection->injection)) return;
  const KnotSquare off = KnotSquare::Identity() - KnotVector::Ones() * weight.transpose();
  cell.mean = off * cell.mean;
  cell.covariance = off * cell.covariance * off.transpose();
}

LearnedTerm term_of(const InjectionRow& row, const Abscissa& abscissa, const KnotVector& mean) {
  LearnedTerm out;
  out.point = row.injection;
  out.variable = abscissa.variable->learnable.value_or(estimator::LearnedVariable::kTorque);
  out.count = kCellKnots;
  for (std::size_t i = 0; i < out.count; ++i) {
    const double share = static_cast<double>(i) / (kCellKnots - 1);
    out.knot[i] = std::lerp(abscissa.low, abscissa.high, share);
    out.value[i] = mean[static_cast<Eigen::Index>(i)] * row.unit;
  }
  return out;
}

bool is_inner(const Abscissa& abscissa, std::size_t run) {
  return abscissa.level[run] > 0 && abscissa.level[run] + 1 < abscissa.levels;
}

// Fits without each level, or without each experiment of an outer one.
void leave_out(const Engine& engine, const CellColumns& columns, const CellBase& base,
               const KnotVector& weight, LearnedFit& fit) {
  const Abscissa& abscissa = fit.cell.abscissa;
  const std::size_t runs = abscissa.level.size();
  const KnotVector present = fit.cell.mean;
  const InjectionRow& row = *fit.cell.injection;
  fit.laws = law_evidences(fit.cell.scores, row, abscissa);
  fit.folds.assign(runs, engine.state());
  fit.is_inner.assign(runs, false);
  for (std::size_t e = 0; e < runs; ++e) {
    if (abscissa.level[e] < 0 || fit.is_inner[e]) continue;
    std::vector<int> left_out;
    const bool inner = is_inner(abscissa, e);
    for (std::size_t other = e; other < runs; ++other) {
      const bool is_same = inner ? abscissa.level[other] == abscissa.level[e] : other == e;
      if (is_same) left_out.push_back(static_cast<int>(other));
    }
    Cell cell;
    cell.injection = fit.cell.injection;
    cell.scores = scores_of(columns, base, present, left_out);
    judge_cell(cell);
    centre(weight, cell);
    if (inner) {
      fit.left_out_gain += fit.cell.log_evidence - cell.log_evidence;
      const std::vector<LawEvidence> without = law_evidences(cell.scores, row, abscissa);
      for (std::size_t i = 0; i < without.size(); ++i) {
        fit.laws[i].left_out_gain += fit.laws[i].log_evidence - without[i].log_evidence;
      }
    }
    const Eigen::VectorXd step = step_beside(columns, base, cell.mean - present, left_out);
    const double share = std::min(1.0, kLevelStepMax / std::max(step.cwiseAbs().maxCoeff(), 1e-12));
    ModelState state = engine.state();
    state.learned.back() =
        term_of(*cell.injection, abscissa, present + share * (cell.mean - present));
    engine.move(base.parameters, share * step, 1.0, state);
    for (const int run : left_out) {
      fit.folds[static_cast<std::size_t>(run)] = state;
      fit.is_inner[static_cast<std::size_t>(run)] = inner;
    }
  }
}

// The functions take the place of those that the engine has. The machine goes with them, from where
// it is and from where the linear fit of both says; the better way counts.
void take_in(Engine& engine, const std::vector<LearnedTerm>& terms,
             const std::vector<int>& parameters, const Eigen::VectorXd& step) {
  ModelState here = engine.state();
  here.learned = terms;
  ModelState there = here;
  engine.move(parameters, step, 1.0, there);
  const Hypothesis from_here = engine.refine_from(here, engine.accepted(), kSettling);
  const Hypothesis from_there =
      engine.refine_from(there, engine.accepted(), kSettling, from_here.log_likelihood);
  engine.accept(from_there.log_likelihood > from_here.log_likelihood ? from_there : from_here);
  engine.update_noise();
}

// others: the functions beside it.
LearnedFit fit(Engine& engine, const std::vector<LearnedTerm>& others, Cell cell) {
  const Abscissa& abscissa = cell.abscissa;
  const KnotVector weight = weights(engine.campaign(), abscissa);
  LearnedFit out;
  for (int pass = 0;; ++pass) {
    const KnotVector present = cell.mean;
    CellBase base = cell_base(engine);
    const CellColumns columns = cell_columns(engine, base, abscissa, *cell.injection);
    cell.scores = scores_of(columns, base, present);
    judge_cell(cell);
    centre(weight, cell);
    const bool is_still = (cell.mean - present).cwiseAbs().maxCoeff() < kStill;
    if (pass > 0 && (is_still || pass == kPassesMax)) {
      // The state has the function of the last pass; what is left out is compared with that.
      cell.mean = present;
      out.cell = std::move(cell);
      leave_out(engine, columns, base, weight, out);
      break;
    }
    std::vector<LearnedTerm> terms = others;
    terms.push_back(term_of(*cell.injection, abscissa, cell.mean));
    take_in(engine, terms, base.parameters, step_beside(columns, base, cell.mean - present, {}));
  }
  out.term = engine.state().learned.back();
  return out;
}

}  // namespace

LearnedFit fit_learned(Engine& engine, const InjectionRow& row, const Abscissa& abscissa) {
  Cell cell;
  cell.injection = &row;
  cell.abscissa = abscissa;
  const std::vector<LearnedTerm> others = engine.state().learned;  // a copy: the state changes
  return fit(engine, others, std::move(cell));
}

LearnedFit fit_further(Engine& engine, const LearnedFit& before) {
  std::vector<LearnedTerm> others = engine.state().learned;
  others.pop_back();
  return fit(engine, others, before.cell);
}

}  // namespace beltgrip::diagnose
