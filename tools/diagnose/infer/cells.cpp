#include "tools/diagnose/infer/cells.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace beltgrip::diagnose {
namespace {

using Eigen::ArrayXd;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kAnyConstant = 1e-3;  // precision: of a constant that is not known at all
constexpr double kOwnShareMin = 0.02;  // of a direction: less is the machine's constants
constexpr int kScatterSteps = 6;       // from the fitted scatter to the usual

// The curve's own abscissa is torque over capacity: in a ramp the clamp force is it by another
// name.
bool is_sensible(const IndexVariable& variable, const InjectionRow& row, const Campaign& campaign) {
  const std::string_view name = variable.name;
  if (name == "secondary_pressure") return false;
  // What follows the rate is a delay, a lag or a play: dynamics, which no function of it describes.
  if (name == "pressure_rate") return false;
  if (name == "torque") {
    return campaign.torque_varies && row.injection == Injection::kFriction;
  }
  // Without the torque behind the belt these two are friction by another name.
  const bool like_friction =
      row.injection == Injection::kTorqueGain || row.injection == Injection::kClampForce;
  return campaign.has_balance || !like_friction;
}

// What a unit of the row changes at each sample.
QuantityChange unit_change(const ModelState& state, const Residuals& at, const InjectionRow& row,
                           const ArrayXd& size) {
  QuantityChange out;
  const ArrayXd by = size * row.unit;
  switch (row.injection) {
    case Injection::kFriction:
      out.ln_capacity = by;
      break;
    case Injection::kRatio:
      out.slip = by * (1.0 - at.there.slip);
      if (at.there.balance.size() > 0) out.balance = -at.clean_Nm * by;
      break;
    case Injection::kTorque:
      out.torque = -by;
      out.balance = -by;
      break;
    case Injection::kTorqueGain:
      out.torque = -by * at.clean.torque.value;
      out.balance = out.torque;
      break;
    case Injection::kClampForce: {
      const ArrayXd ln_ratio = -1e-3 * state.nuisance[kDeformationPerkN] * by;
      out.ln_capacity = by / at.there.force_N.max(50.0);
      out.slip = ln_ratio * (1.0 - at.there.slip);
      if (at.there.balance.size() > 0) out.balance = -at.clean_Nm * ln_ratio;
      break;
    }
  }
  return out;
}

// The columns of all experiments but the cell's, and what the scatter may be.
struct Base {
  std::vector<int> runs;        // those with valid samples
  std::vector<RawColumns> raw;  // parameters
  std::vector<ResidualColumns> residual;
  std::vector<Residuals> at;
  std::vector<int> parameters;
  Prior prior;
  std::vector<Scatter> scatter;
};

Base base_of(const Engine& engine) {
  const Campaign& campaign = engine.campaign();
  Base out;
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
  if ((engine.scatter().variance > 1.5 * usual.variance).any()) {
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
  return out;
}

std::vector<Summary> summaries_with(const Engine& engine, Base& base, const Abscissa& abscissa,
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
      columns.push_back(std::move(column));
    }
    columns.push_back(base.residual[i]);
    out.push_back(summary_of(campaign, run, base.raw[i], engine.whitening()));
    columns.resize(own);
  }
  engine.add_curve_bounds(engine.state(), base.parameters, out);
  return out;
}

// Directions of the function that the machine's constants could as well be, whatever their usual
// values: the data say nothing of them.
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

CellScore score_of(const std::vector<Summary>& summaries, const Prior& prior,
                   const Scatter& scatter) {
  const Index n = prior.pull.size();
  const Index all = n + kCellKnots + 1;
  const Scatter usual = default_scatter();
  MatrixXd total = MatrixXd::Zero(all, all);
  double ln_det = 0.0;
  const MatrixXd inverse = (1.0 / scatter.variance).matrix().asDiagonal();
  for (const Summary& each : summaries) {
    const Eigen::LLT<MatrixXd> llt(each.uu + inverse);
    const MatrixXd root = llt.matrixL().solve(each.ua);
    total += each.aa;
    total.selfadjointView<Eigen::Lower>().rankUpdate(root.transpose(), -1.0);
    ln_det += 2.0 * llt.matrixLLT().diagonal().array().log().sum() + scatter.variance.log().sum();
  }
  total.triangularView<Eigen::StrictlyUpper>() = total.transpose();
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
  const double scatter_prior =
      kScatterPriorRuns * (scatter.variance.log() + usual.variance / scatter.variance).sum();
  out.misfit = misfit;
  out.log_likelihood = -0.5 * (misfit + off.dot(prior.precision.cwiseProduct(off)) + ln_det +
                               scatter_prior + ldlt.vectorD().array().max(1e-300).log().sum());
  return out;
}

}  // namespace

std::vector<Cell> score_cells(const Engine& engine) {
  std::vector<Cell> out;
  if (engine.whitening().random.empty()) return out;  // stopped before the noise was known
  Base base = base_of(engine);
  const auto n = static_cast<Index>(base.parameters.size());
  for (const IndexVariable& variable : index_variables()) {
    const std::optional<Abscissa> abscissa = abscissa_of(engine.campaign(), variable);
    if (!abscissa) continue;
    for (const InjectionRow& row : kInjections) {
      if (!is_sensible(variable, row, engine.campaign())) continue;
      const std::vector<Summary> summaries = summaries_with(engine, base, *abscissa, row);
      const KnotSquare filter = own_directions(summaries, n);
      Cell cell;
      cell.injection = &row;
      cell.abscissa = *abscissa;
      for (const Scatter& scatter : base.scatter) {
        CellScore score = score_of(summaries, base.prior, scatter);
        score.information = filter * score.information * filter.transpose();
        score.score = filter * score.score;
        cell.scores.push_back(std::move(score));
      }
      judge_cell(cell);
      out.push_back(std::move(cell));
    }
  }
  std::sort(out.begin(), out.end(),
            [](const Cell& a, const Cell& b) { return a.gain() > b.gain(); });
  return out;
}

}  // namespace beltgrip::diagnose
