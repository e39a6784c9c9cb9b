#include "tools/diagnose/infer/uncertainty.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "can_dbc/text/number_text.h"
#include "tools/diagnose/infer/gain.h"

namespace beltgrip::diagnose {
namespace {

using Eigen::Index;

// One sigma of what the equations themselves leave out (a grid of a tenth of a second, one form
// where nature has another), as a share of the size: no size is surer. A delay or a lag works on
// slow copies of signals: where these step, their steps are too gentle, and the delay seems longer.
constexpr double kEquationShare = 0.01, kDelayShare = 0.1;

// Chosen, of the gain of the effect that explains most: what explains less is its shadow. A fifth
// less or more: not run.
constexpr double kHalf = 0.5;

// Derived, tolerances: beyond, one sensor in twenty is off. Where many campaigns are asked, few of
// those that are fitted so are. A fifth less or more: the same verdicts in 16 campaigns, which it
// is not to change; it widens mu_max.
constexpr double kPushed = 2.0;

}  // namespace

std::vector<Uncertainty> uncertainties(const Engine& engine, const Hypothesis& hypothesis) {
  const LeftOut left_out = leave_one_out(engine, hypothesis.state, hypothesis.slots);
  const double between = std::max(1.0, static_cast<double>(engine.summaries().size()) - 1.0);
  std::vector<Uncertainty> out;
  for (std::size_t i = 0; i < hypothesis.slots.size(); ++i) {
    const int slot = hypothesis.slots[i];
    const double scale = engine.scale(kNuisanceCount + slot);
    const auto column = static_cast<Index>(engine.active_nuisances().size() + i);
    // From the noise, or from how the size changes when an experiment is left out, whichever is
    // larger.
    const double noise =
        std::sqrt(std::max(hypothesis.fit.covariance(column, column), 0.0)) * scale;
    const bool disagree = left_out.spread[i] > noise;
    const double sampled = disagree ? left_out.spread[i] : noise;
    const double degrees =
        disagree ? std::min(hypothesis.degrees[i], between) : hypothesis.degrees[i];
    const bool is_time = engine.campaign().slots[static_cast<std::size_t>(slot)].row->unit == "s";
    const double equation =
        (is_time ? kDelayShare : kEquationShare) * hypothesis.state.effects[slot];
    const double variance = sampled * sampled + equation * equation;
    // Satterthwaite: only what is sampled has few degrees of freedom.
    const double share = sampled * sampled / std::max(variance, 1e-300);
    out.push_back(
        {std::sqrt(variance), degrees / std::max(share * share, 1e-9), left_out.stability[i]});
  }
  return out;
}

std::string open_share(const LeftOpen::Share& share) {
  return std::string(share.effect) + " (" + rounded_text(100.0 * std::sqrt(share.variance), 3) +
         " %)";
}

bool is_seen(const Score& score, const Slot& slot) {
  return score.in_curve < kInCurveMax && score.sigma > 0.0 &&
         kDetectable * score.sigma < kRealistic * slot.row->typical;
}

namespace {
// Effects beside the constants of the machine and what is accepted.
struct Beside {
  Eigen::VectorXd levers;       // of the quantity, per usual size
  Eigen::MatrixXd information;  // on the sizes, in usual ones
};
Beside beside(const Engine& engine, const std::vector<int>& slots, const Eigen::VectorXd& lever) {
  const std::vector<int> base = engine.with_nuisances(engine.accepted());
  const auto constants = static_cast<int>(engine.active_nuisances().size());
  std::vector<int> columns(static_cast<std::size_t>(constants));
  std::iota(columns.begin(), columns.end(), 0);
  for (const int slot : engine.accepted()) columns.push_back(constants + slot);
  for (const int slot : slots) columns.push_back(constants + slot);
  const Eigen::MatrixXd total =
      normal_equations(engine.summaries(), columns, engine.scatter()).total;
  const auto n = static_cast<Index>(base.size());
  const auto k = static_cast<Index>(slots.size());
  Eigen::MatrixXd known = total.topLeftCorner(n, n);
  known.diagonal() += engine.prior(base, engine.state()).precision;
  const Eigen::MatrixXd cross = total.block(0, n, n, k);
  const Eigen::MatrixXd follow = solved_ldlt(known, cross);
  return {-(follow.transpose() * lever), total.block(n, n, k, k) - cross.transpose() * follow};
}
}  // namespace

LeftOpen left_open(const Engine& engine, const std::vector<Score>& unseen,
                   const Eigen::VectorXd& lever) {
  LeftOpen out;
  if (unseen.empty() || engine.summaries().empty()) return out;
  std::vector<int> slots;
  slots.reserve(unseen.size());
  for (const Score& score : unseen) slots.push_back(score.slot);
  auto [moved, sizes] = beside(engine, slots, lever);
  const auto k = static_cast<Index>(slots.size());
  // What a friction curve that runs otherwise does as well: what is left of it is the form's, which
  // no data prove.
  for (Index i = 0; i < k; ++i) {
    if (unseen[static_cast<std::size_t>(i)].in_curve < kInCurveMax) continue;
    sizes.row(i).setZero();
    sizes.col(i).setZero();
  }
  sizes.diagonal().array() += 1.0;  // one usual size is one sigma before the data
  const Eigen::MatrixXd covariance =
      solved_ldlt(sizes, Eigen::MatrixXd(Eigen::MatrixXd::Identity(k, k)));
  const Eigen::VectorXd along = covariance * moved;
  out.variance = std::max(moved.dot(along), 0.0);
  for (Index i = 0; i < k; ++i) {
    const int slot = slots[static_cast<std::size_t>(i)];
    const std::string_view effect = engine.campaign().slots[static_cast<std::size_t>(slot)].row->id;
    // What its size being known would take away.
    const double share = along[i] * along[i] / std::max(covariance(i, i), 1e-300);
    const auto same = std::find_if(out.by_effect.begin(), out.by_effect.end(),
                                   [&](const auto& each) { return each.effect == effect; });
    if (same != out.by_effect.end()) {
      same->variance += share;
    } else {
      out.by_effect.push_back({effect, share});
    }
  }
  std::sort(out.by_effect.begin(), out.by_effect.end(),
            [](const auto& a, const auto& b) { return a.variance > b.variance; });
  return out;
}

double variance_of_halves(const Engine& engine, const std::vector<Score>& scores,
                          const Eigen::VectorXd& lever) {
  const auto best = std::max_element(scores.begin(), scores.end(),
                                     [](auto& a, auto& b) { return a.gain < b.gain; });
  if (best == scores.end() || engine.summaries().empty()) return 0.0;
  std::vector<int> slots;
  std::vector<double> sizes;  // in usual ones
  for (const Score& score : scores) {
    if (!(score.gain > kHalf * best->gain)) continue;
    const EffectRow& row = *engine.campaign().slots[static_cast<std::size_t>(score.slot)].row;
    slots.push_back(score.slot);
    const double least = least_size(engine.campaign(), score.slot);
    sizes.push_back(std::clamp(score.value, least, row.high) / row.typical);
  }
  if (slots.empty()) return 0.0;
  const Eigen::VectorXd levers = beside(engine, slots, lever).levers;
  double squares = 0.0;
  for (std::size_t i = 0; i < slots.size(); ++i) {
    squares += std::pow(levers[static_cast<Index>(i)] * sizes[i], 2.0);
  }
  return squares / static_cast<double>(slots.size());
}

namespace {
// Squared: by how much the quantity would differ, were these constants, of the active ones, the
// nominal ones.
double square_at_nominal(const Engine& engine, const Hypothesis& hypothesis,
                         const std::vector<Index>& columns, const Eigen::VectorXd& lever) {
  if (columns.empty()) return 0.0;
  const Eigen::MatrixXd& covariance = hypothesis.fit.covariance;
  const Eigen::VectorXd off =
      engine.prior(engine.active_nuisances(), hypothesis.state).pull(columns);
  const Eigen::VectorXd along = (covariance * lever)(columns);
  return std::pow(along.dot(solved_ldlt(covariance(columns, columns), off)), 2.0);
}
}  // namespace

double variance_of_bending(const Engine& engine, const Hypothesis& hypothesis,
                           const Eigen::VectorXd& lever) {
  const std::vector<int>& all = engine.active_nuisances();
  std::vector<Index> columns;
  for (std::size_t j = 0; j < all.size(); ++j) {
    if (all[j] > kEndOfShapes) columns.push_back(static_cast<Index>(j));
  }
  return square_at_nominal(engine, hypothesis, columns, lever);
}

double variance_of_pushed(const Engine& engine, const Hypothesis& hypothesis,
                          const Eigen::VectorXd& lever) {
  const std::vector<int>& all = engine.active_nuisances();
  std::vector<Index> columns;
  for (std::size_t j = 0; j < all.size(); ++j) {
    if (all[j] != kPressureBias_Pa) continue;
    const NuisanceRow& row = engine.campaign().nuisances[static_cast<std::size_t>(all[j])];
    const double off = hypothesis.state.nuisance[all[j]] - row.nominal;
    if (std::abs(off) > kPushed * row.tolerance) columns.push_back(static_cast<Index>(j));
  }
  return square_at_nominal(engine, hypothesis, columns, lever);
}

}  // namespace beltgrip::diagnose
