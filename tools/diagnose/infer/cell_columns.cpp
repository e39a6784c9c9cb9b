#include "tools/diagnose/infer/cell_columns.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>

namespace beltgrip::diagnose {
namespace {

using Eigen::ArrayXd;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kAnyConstant = 1e-3;           // precision: of a constant that is not known at all
constexpr double kOwnShareMin = 0.02;           // of a direction: less is the machine's constants
constexpr double kFarMore = 1.5;                // chosen, times the usual variance
constexpr int kScatterSteps = 6;                // from the fitted scatter to the usual
constexpr std::array kLessScatter{0.25, 0.06};  // chosen, of the variance

}  // namespace

QuantityChange unit_change(const ModelState& state, const Residuals& at, const InjectionRow& row,
                           const ArrayXd& size) {
  QuantityChange out;
  const ArrayXd by = size * row.unit;
  switch (row.injection) {
    case Injection::kFriction:
      out.ln_capacity = by;
      break;
    case Injection::kRatio:
      out.slip_share = by * (1.0 - at.there.slip_share);
      if (at.there.balance.size() > 0) out.balance = -at.clean_Nm * by;
      break;
    case Injection::kTorque:
      out.torque = -by;
      out.balance = -by;
      break;
    case Injection::kTorqueGain:
      out.torque = -by * at.clean_reading_Nm;
      out.balance = out.torque;
      break;
    case Injection::kClampForce: {
      const ArrayXd ln_ratio = -1e-3 * state.nuisance[kDeformationPerkN] * by;
      out.ln_capacity = by / at.there.force_N.max(50.0);
      out.slip_share = ln_ratio * (1.0 - at.there.slip_share);
      if (at.there.balance.size() > 0) out.balance = -at.clean_Nm * ln_ratio;
      break;
    }
  }
  return out;
}

CellBase cell_base(const Engine& engine) {
  const Campaign& campaign = engine.campaign();
  CellBase out;
  out.parameters = engine.with_nuisances(engine.accepted());
  VectorXd scales(static_cast<Index>(out.parameters.size()));
  for (Index j = 0; j < scales.size(); ++j) {
    scales[j] = engine.scale(out.parameters[static_cast<std::size_t>(j)]);
  }
  for (std::size_t e = 0; e < campaign.runs.size(); ++e) {
    if (campaign.runs[e].valid_count == 0) continue;
    const auto run = static_cast<int>(e);
    out.runs.push_back(run);
    out.at.push_back(residuals_of(campaign, run, engine.state()));
    prepare_derivatives(campaign, run, engine.state(), out.at.back());
    out.raw.push_back(
        raw_columns(campaign, run, engine.state(), out.at.back(), out.parameters, scales, false));
    out.residual.push_back(std::move(out.raw.back().columns.back()));
    out.raw.back().columns.pop_back();
  }
  out.prior = engine.prior(out.parameters, engine.state());
  // Where experiments seem to scatter far more than usual, that may be what a function explains.
  const Scatter usual = default_scatter();
  out.scatter.push_back(engine.scatter());
  if ((engine.scatter().variance > kFarMore * usual.variance).any()) {
    for (int i = 1; i <= kScatterSteps; ++i) {
      const double share = static_cast<double>(i) / kScatterSteps;
      Scatter between = engine.scatter();
      for (int j = 0; j < kRandomEffects; ++j) {
        const double ratio = usual.variance[j] / between.variance[j];
        if (ratio < 1.0) between.variance[j] *= std::pow(ratio, share);
      }
      out.scatter.push_back(between);
    }
  }
  // What repeats may be all that they scatter by: of level, seat and zero each for itself less.
  for (const int each : {0, 1, 2}) {
    for (const double share : kLessScatter) {
      Scatter less = engine.scatter();
      less.variance[each] *= share;
      out.scatter.push_back(less);
    }
  }
  return out;
}

namespace {

std::vector<Summary> summaries_with(const Engine& engine, CellBase& base, const Abscissa& abscissa,
                                    const InjectionRow& row) {
  const Campaign& campaign = engine.campaign();
  std::vector<Summary> out;
  for (std::size_t i = 0; i < base.runs.size(); ++i) {
    const int run = base.runs[i];
    const ArrayXd& x = abscissa.x[static_cast<std::size_t>(run)];
    const Residuals& at = base.at[i];
    const ResidualColumns whole =
        propagate(campaign, at, unit_change(engine.state(), at, row, ArrayXd::Ones(x.size())));
    std::vector<ResidualColumns>& columns = base.raw[i].columns;
    const std::size_t own = columns.size();
    for (int knot = 0; knot < kCellKnots; ++knot) {
      const ArrayXd hat = (1.0 - (x * (kCellKnots - 1) - knot).abs()).max(0.0);
      ResidualColumns column;
      for (std::size_t kind = 0; kind < kResidualKinds; ++kind) {
        if (whole[kind].size() > 0) column[kind] = whole[kind] * hat;
      }
      columns.push_back(valid_rows(campaign.runs[static_cast<std::size_t>(run)], column));
    }
    columns.push_back(base.residual[i]);
    out.push_back(summary_of(campaign, run, base.raw[i], engine.whitening()));
    columns.resize(own);
  }
  engine.add_curve_bounds(engine.state(), base.parameters, out);
  return out;
}

// A projection on the directions that the machine's constants leave.
KnotSquare own_directions(const std::vector<Summary>& summaries, Index n) {
  MatrixXd total = MatrixXd::Zero(n + kCellKnots, n + kCellKnots);
  for (const Summary& each : summaries) {
    total += each.aa.topLeftCorner(n + kCellKnots, n + kCellKnots);
  }
  total.diagonal().head(n).array() += kAnyConstant;
  const MatrixXd cross = total.topRightCorner(n, kCellKnots);
  KnotSquare energy = total.bottomRightCorner<kCellKnots, kCellKnots>();
  const KnotSquare own = energy - cross.transpose() * total.topLeftCorner(n, n).ldlt().solve(cross);
  energy.diagonal().array() += 1e-9 * std::max(energy.trace(), 1e-12);
  const Eigen::LLT<KnotSquare> llt(energy);
  const KnotSquare half = llt.matrixL().solve(own);
  KnotSquare share = llt.matrixL().solve(half.transpose());
  share = 0.5 * (share + share.transpose()).eval();
  const Eigen::SelfAdjointEigenSolver<KnotSquare> solver(share);
  KnotSquare kept = KnotSquare::Zero();
  for (int i = 0; i < kCellKnots; ++i) {
    if (solver.eigenvalues()[i] < kOwnShareMin) continue;
    kept += solver.eigenvectors().col(i) * solver.eigenvectors().col(i).transpose();
  }
  // From knots to knots: information' = filter * information * filter^T.
  const KnotSquare lower = llt.matrixL();
  return lower * kept * lower.inverse();
}

// Normal equations of the experiments that count, the scatter between them taken out.
struct Total {
  MatrixXd all;
  double ln_det = 0.0;
};
Total total_of(const std::vector<const Summary*>& used, Index size, const Scatter& scatter) {
  Total out{MatrixXd::Zero(size, size)};
  const MatrixXd inverse = (1.0 / scatter.variance).matrix().asDiagonal();
  for (const Summary* each : used) {
    const Eigen::LLT<MatrixXd> llt(each->uu + inverse);
    const MatrixXd root = llt.matrixL().solve(each->ua);
    out.all += each->aa;
    out.all.selfadjointView<Eigen::Lower>().rankUpdate(root.transpose(), -1.0);
    out.ln_det +=
        2.0 * llt.matrixLLT().diagonal().array().log().sum() + scatter.variance.log().sum();
  }
  out.all.triangularView<Eigen::StrictlyUpper>() = out.all.transpose();
  return out;
}

CellScore score_of(const std::vector<const Summary*>& used, const Prior& prior,
                   const Scatter& scatter) {
  const Index n = prior.pull.size();
  const Index all = n + kCellKnots + 1;
  const Total sum = total_of(used, all, scatter);
  const MatrixXd& total = sum.all;
  MatrixXd information = total.topLeftCorner(n, n);
  information.diagonal() += prior.precision;
  const VectorXd right = prior.precision.cwiseProduct(prior.pull) - total.col(all - 1).head(n);
  const Eigen::LDLT<MatrixXd> ldlt(information);
  const VectorXd step = ldlt.solve(right);
  const MatrixXd cross = total.block(0, n, n, kCellKnots);
  CellScore out;
  out.information =
      total.block(n, n, kCellKnots, kCellKnots) - cross.transpose() * ldlt.solve(cross);
  out.score = -(total.col(all - 1).segment(n, kCellKnots) + cross.transpose() * step);
  const VectorXd off = step - prior.pull;
  const double misfit = total(all - 1, all - 1) + 2.0 * step.dot(total.col(all - 1).head(n)) +
                        step.dot(total.topLeftCorner(n, n) * step);
  out.misfit = misfit;
  out.log_likelihood =
      -0.5 * (misfit + off.dot(prior.precision.cwiseProduct(off)) + sum.ln_det +
              scatter_penalty(scatter.variance) + ldlt.vectorD().array().max(1e-300).log().sum());
  return out;
}

std::vector<const Summary*> those_that_count(const CellColumns& columns, const CellBase& base,
                                             const std::vector<int>& left_out) {
  std::vector<const Summary*> out;
  for (std::size_t i = 0; i < columns.summaries.size(); ++i) {
    if (std::find(left_out.begin(), left_out.end(), base.runs[i]) == left_out.end()) {
      out.push_back(&columns.summaries[i]);
    }
  }
  return out;
}

}  // namespace

CellColumns cell_columns(const Engine& engine, CellBase& base, const Abscissa& abscissa,
                         const InjectionRow& row) {
  CellColumns out;
  out.summaries = summaries_with(engine, base, abscissa, row);
  return out;
}

std::vector<CellScore> scores_of(const CellColumns& columns, const CellBase& base,
                                 const KnotVector& present, const std::vector<int>& left_out) {
  const std::vector<const Summary*> used = those_that_count(columns, base, left_out);
  std::vector<CellScore> out;
  for (const Scatter& scatter : base.scatter) {
    CellScore score = score_of(used, base.prior, scatter);
    const KnotVector whole = score.score + score.information * present;
    // The same of no function at all.
    score.log_likelihood -=
        present.dot(score.score) + 0.5 * present.dot(score.information * present);
    score.misfit += present.dot(score.score + whole);
    score.score = whole;
    out.push_back(std::move(score));
  }
  return out;
}

void keep_own(const CellColumns& columns, const CellBase& base, std::vector<CellScore>& scores) {
  const KnotSquare own =
      own_directions(columns.summaries, static_cast<Index>(base.parameters.size()));
  for (CellScore& each : scores) {
    each.information = own * each.information * own.transpose();
    each.score = own * each.score;
  }
}

VectorXd step_beside(const CellColumns& columns, const CellBase& base, const KnotVector& change,
                     const std::vector<int>& left_out) {
  const Prior& prior = base.prior;
  const Index n = prior.pull.size();
  const MatrixXd total =
      total_of(those_that_count(columns, base, left_out), n + kCellKnots + 1, base.scatter.front())
          .all;
  MatrixXd information = total.topLeftCorner(n, n);
  information.diagonal() += prior.precision;
  const VectorXd right = prior.precision.cwiseProduct(prior.pull) -
                         total.col(n + kCellKnots).head(n) -
                         total.block(0, n, n, kCellKnots) * change;
  return information.ldlt().solve(right);
}

}  // namespace beltgrip::diagnose
