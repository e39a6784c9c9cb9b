#include "tools/diagnose/infer/infer.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>

#include "estimator/statistics/distributions.h"
#include "estimator/statistics/order.h"
#include "tools/diagnose/infer/column_work.h"
#include "tools/diagnose/infer/parallel.h"
#include "tools/diagnose/model/curve_family.h"

namespace beltgrip::diagnose {
namespace {

using Eigen::ArrayXd;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kLevel = 0, kTorqueZero = 2, kTorqueOutZero = 4;  // of the random effects
constexpr double kHuber = 3.0;
constexpr double kClipSigmas = 4.0;  // chosen: normal noise is hardly ever beyond
constexpr double kScatterCap = 8.0;  // in usual scatters: beyond, it is an effect and not scatter

// One sigma between healthy experiments: what replicates on rigs scatter by.
constexpr std::array<double, kRandomEffects> kDefaultScatter{4e-3, 1.5e-4, 0.1, 0.02, 0.1, 500.0};
// Of the constant error that was stated of a torque: what is another from one experiment to the
// next. Chosen: a torque that is known to a few Nm only is not the same to a tenth of one. A fifth
// less or more: the same words in ten campaigns of other make, seven of them healthy.
constexpr double kBiasMovesShare = 0.2;

// What the zero of a torque scatters by, in usual scatters.
double zero_scatter(const Campaign& campaign, Role role, int random) {
  const double bias_Nm = campaign.accuracies[static_cast<std::size_t>(role)].bias;
  return std::hypot(1.0,
                    kBiasMovesShare * bias_Nm / kDefaultScatter[static_cast<std::size_t>(random)]);
}
double torque_zero_scatter(const Campaign& campaign, const ExperimentData& data) {
  return zero_scatter(campaign, data.torque_is_engine ? Role::kEngineTorque : Role::kPrimaryTorque,
                      kTorqueZero);
}
double torque_out_zero_scatter(const Campaign& campaign) {
  return zero_scatter(campaign, Role::kSecondaryTorque, kTorqueOutZero);
}

// A pressure that rests on one step all along.
bool rests_throughout(const ExperimentData& data) {
  constexpr double kThroughout = 0.9;  // chosen, of the valid samples
  double on_step = 0.0;
  for (const Rest& rest : data.rests_pressure) {
    if (rest.step != data.rests_pressure.front().step) continue;
    on_step += static_cast<double>(
        std::count(data.valid.begin() + rest.begin, data.valid.begin() + rest.end, true));
  }
  return on_step > kThroughout * data.valid_count;
}

// What the level of the friction scatters by, in usual scatters: a pressure that rests throughout
// has it off by the same all along.
double level_scatter(const Campaign& campaign, const ExperimentData& data) {
  if (!rests_throughout(data)) return 1.0;
  const estimator::VariatorParameters& variator = campaign.variator;
  double sum_N = 0.0;
  for (const auto& [begin, end] : data.stretches) {
    sum_N +=
        variator.secondary_piston_area_m2 * data.pressure.value.segment(begin, end - begin).sum() +
        variator.secondary_spring_force_N * (end - begin);
  }
  const double mean_N = std::max(50.0, sum_N / std::max(data.valid_count, 1));
  const double off = variator.secondary_piston_area_m2 * data.rounding_pressure_Pa / mean_N;
  return std::hypot(1.0, off / kDefaultScatter[kLevel]);
}

std::array<ResidualColumns, kRandomEffects> random_columns(const Campaign& campaign, int run,
                                                           const ModelState& state,
                                                           const Residuals& at) {
  const auto n = at.foot.size();
  std::array<ResidualColumns, kRandomEffects> out;
  QuantityChange level, slip_offset, zero, zero_out, zero_track;
  const ExperimentData& data = campaign.runs[static_cast<std::size_t>(run)];
  level.ln_capacity = ArrayXd::Constant(n, level_scatter(campaign, data));
  out[0] = propagate(campaign, at, level);
  // A speed that is held on one step of its rounding is off by the same all along.
  slip_offset.slip_share =
      ArrayXd::Constant(n, std::hypot(1.0, data.rounding_slip_share / kDefaultScatter[1]));
  out[1] = propagate(campaign, at, slip_offset);
  zero.torque = ArrayXd::Constant(n, torque_zero_scatter(campaign, data));
  zero.balance = zero.torque;
  out[2] = propagate(campaign, at, zero);
  QuantityChange peak;
  peak.torque = ArrayXd::Zero(n);
  const double peak_low = std::exp(state.nuisance[kLnPeakSlipLow]);
  const double peak_overdrive = std::exp(state.nuisance[kLnPeakSlipOverdrive]);
  for (Index k = 0; k < n; ++k) {
    const int stop = data.stop[static_cast<std::size_t>(k)];
    if (stop == kNoStop) continue;
    peak.torque[k] = at.slope[k] * at.foot[k] * (stop == kLowStop ? peak_low : peak_overdrive);
  }
  out[3] = propagate(campaign, at, peak);
  zero_out.balance = ArrayXd::Constant(n, torque_out_zero_scatter(campaign));
  out[4] = propagate(campaign, at, zero_out);
  zero_track.tracking = ArrayXd::Ones(n);
  out[5] = propagate(campaign, at, zero_track);
  return out;
}

// The rows times the inverse root of one and the covariance of the errors that rest.
ArrayXd less_rests(const std::vector<Whitening::Rest>& rests, ArrayXd rows) {
  for (const auto& [first, by] : rests) {
    const double square = by.squaredNorm();
    if (square == 0.0) continue;
    auto part = rows.segment(first, by.size());
    const double share = (1.0 - 1.0 / std::sqrt(1.0 + square)) / square;
    part -= share * by.dot(part.matrix()) * by.array();
  }
  return rows;
}

// Derived: a course that comes into a step and leaves it by the same edge, with its top anywhere in
// it, bends by two thirds of that. Chosen: samples of a rest that is long enough to. Of 16
// campaigns of other make a fifth less of either lets one alarm again (54, 43), a fifth more none.
constexpr double kBent = 2.0 / 3.0;
constexpr int kBends = 10;

// Of one experiment, from its random effects' columns, the last of all.
std::array<std::vector<Whitening::Rest>, kResidualKinds> rests_of(const Campaign& campaign, int run,
                                                                  const RawColumns& raw) {
  const ExperimentData& data = campaign.runs[static_cast<std::size_t>(run)];
  const estimator::VariatorParameters& variator = campaign.variator;
  std::array<std::vector<Whitening::Rest>, kResidualKinds> out;
  if (data.rests_pressure.empty() && data.rests_torque.empty() && data.rests_torque_s.empty()) {
    return out;
  }
  // Row of a sample: how many valid ones come before it.
  std::vector<int> row(static_cast<std::size_t>(data.size()) + 1, 0);
  ArrayXd per_force(data.valid_count), ratio(data.valid_count);
  for (int k = 0; k < data.size(); ++k) {
    const auto i = static_cast<std::size_t>(k);
    row[i + 1] = row[i] + data.valid[i];
    if (!data.valid[i]) continue;
    per_force[row[i]] =
        1.0 / std::max(50.0, variator.secondary_piston_area_m2 * data.pressure.value[k] +
                                 variator.secondary_spring_force_N);
    ratio[row[i]] = data.stop[i] == kLowStop ? variator.ratio_low : variator.ratio_overdrive;
  }
  const auto column = [&](int random, ResidualKind kind) -> const ArrayXd& {
    const std::size_t first = raw.columns.size() - kRandomEffects;
    return raw.columns[first + static_cast<std::size_t>(random)][static_cast<std::size_t>(kind)];
  };
  const auto add = [&](const std::vector<Rest>& rests, ResidualKind kind, const ArrayXd& by) {
    if (by.size() == 0) return;
    std::map<long, Whitening::Rest> by_step;
    for (const Rest& rest : rests) {
      const int first = row[static_cast<std::size_t>(rest.begin)];
      const int end = row[static_cast<std::size_t>(rest.end)];
      Whitening::Rest& all =
          by_step.try_emplace(rest.step, Whitening::Rest{first, {}}).first->second;
      all.by.conservativeResizeLike(VectorXd::Zero(end - all.first));
      all.by.tail(end - first) = by.segment(first, end - first);
    }
    for (auto& [step, all] : by_step) out[static_cast<std::size_t>(kind)].push_back(std::move(all));
  };
  // The pressure's each for itself: where it has been between two steps was found for each.
  if (!rests_throughout(data)) {
    const ArrayXd by = column(kLevel, kFrictionResidual) * per_force *
                       (variator.secondary_piston_area_m2 * data.rounding_pressure_Pa);
    for (const Rest& rest : data.rests_pressure) {
      add({rest}, kFrictionResidual, by);
      const int first = row[static_cast<std::size_t>(rest.begin)];
      const int end = row[static_cast<std::size_t>(rest.end)];
      if (by.size() == 0 || end - first < kBends) continue;
      // Within it it may have gone to one side or there and back: by the first and second Legendre
      // polynomial.
      const ArrayXd x = ArrayXd::LinSpaced(end - first, -1.0, 1.0);
      for (const ArrayXd& form : {ArrayXd(x), ArrayXd(1.5 * x.square() - 0.5)}) {
        ArrayXd bent = ArrayXd::Zero(by.size());
        bent.segment(first, end - first) = kBent * form * by.segment(first, end - first);
        add({rest}, kFrictionResidual, bent);
      }
    }
  }
  for (const ResidualKind kind : {kFrictionResidual, kBalanceResidual}) {
    add(data.rests_torque, kind,
        column(kTorqueZero, kind) *
            (data.rounding_torque_Nm / torque_zero_scatter(campaign, data)));
  }
  if (campaign.has_balance) {
    add(data.rests_torque_s, kBalanceResidual,
        column(kTorqueOutZero, kBalanceResidual) * ratio *
            (data.rounding_torque_s_Nm / torque_out_zero_scatter(campaign)));
  }
  return out;
}

// The prediction errors of the valid samples, stretch by stretch, in units of their sigma,
// weighted.
void whiten(const ExperimentData& data, const Whitening::Filter& filter, const ArrayXd& in,
            const ArrayXd& weight, double* out) {
  const int full = static_cast<int>(filter.coefficient.size()) - 1;
  static_assert(Whitening::kOrder == kFilterOrder);
  Index row = 0;
  for (const auto& [begin, end] : data.stretches) {
    const Index k = row;  // the stretch's first in the rows
    const int warm = std::min(full, end - begin);
    for (int order = 0; order < warm; ++order) {
      const VectorXd& a = filter.coefficient[static_cast<std::size_t>(order)];
      double e = in[k + order];
      for (int i = 0; i < order; ++i) e -= a[i] * in[k + order - 1 - i];
      out[row] = e / filter.sigma[static_cast<std::size_t>(order)] * weight[row];
      ++row;
    }
    const Index rest = end - begin - warm;
    if (rest == 0) continue;
    if (full == Whitening::kOrder) {
      predict({filter.coefficient.back().data(), filter.sigma.back()}, in.data() + row,
              weight.data() + row, rest, out + row);
    } else {  // not fitted yet: order 0
      Eigen::Map<ArrayXd>(out + row, rest) =
          in.segment(row, rest) / filter.sigma.back() * weight.segment(row, rest);
    }
    row += rest;
  }
}

// Prediction coefficients of all orders up to kOrder (Levinson), from the segments' autocovariance.
Whitening::Filter levinson(const std::vector<double>& covariance) {
  Whitening::Filter out;
  const int order = static_cast<int>(covariance.size()) - 1;
  const double power = std::max(covariance[0], 1e-12);
  VectorXd a = VectorXd::Zero(order);
  double error = power * (1.0 + 1e-6);
  out.coefficient.push_back(a);
  out.sigma.push_back(std::sqrt(error));
  for (int m = 0; m < order; ++m) {
    double reflection = covariance[static_cast<std::size_t>(m) + 1];
    for (int i = 0; i < m; ++i) reflection -= a[i] * covariance[static_cast<std::size_t>(m - i)];
    reflection /= error;
    VectorXd next = a;
    next[m] = reflection;
    for (int i = 0; i < m; ++i) next[i] = a[i] - reflection * a[m - 1 - i];
    a = next;
    error *= std::max(1.0 - reflection * reflection, 1e-6);
    out.coefficient.push_back(a);
    out.sigma.push_back(std::sqrt(error));
  }
  return out;
}

}  // namespace

VectorXd solved_llt(const MatrixXd& matrix, const VectorXd& right) {
  return matrix.llt().solve(right);
}
MatrixXd solved_llt(const MatrixXd& matrix, const MatrixXd& right) {
  return matrix.llt().solve(right);
}
VectorXd solved_ldlt(const MatrixXd& matrix, const VectorXd& right) {
  return matrix.ldlt().solve(right);
}
MatrixXd solved_ldlt(const MatrixXd& matrix, const MatrixXd& right) {
  return matrix.ldlt().solve(right);
}

Scatter default_scatter() {
  Scatter out;
  for (int i = 0; i < kRandomEffects; ++i) {
    const double s = kDefaultScatter[static_cast<std::size_t>(i)];
    out.variance[i] = s * s;
  }
  out.most = kScatterCap * kScatterCap * out.variance;
  return out;
}

namespace {
RandomVector prior_runs(const RandomVector& variance) {
  return (variance < default_scatter().variance)
      .select(RandomVector::Constant(kScatterPriorRunsBelow),
              RandomVector::Constant(kScatterPriorRuns));
}
}  // namespace

RandomVector scatter_variance(const RandomVector& mean_square, double runs) {
  const RandomVector strength = prior_runs(mean_square);
  return (runs * mean_square + strength * default_scatter().variance) / (runs + strength);
}

RandomVector mean_square_of(const RandomVector& variance, double runs) {
  const RandomVector strength = prior_runs(variance);
  return ((runs + strength) * variance - strength * default_scatter().variance) /
         std::max(runs, 1.0);
}

double scatter_penalty(const RandomVector& variance) {
  const RandomVector share = variance / default_scatter().variance;
  return (prior_runs(variance) * (share.log() + 1.0 / share - 1.0)).sum();
}

bool is_beyond_scatter(const Scatter& scatter) {
  return scatter.variance[kLevel] >= default_scatter().most[kLevel];
}

Eigen::Array<bool, kRandomEffects, 1> is_unusual(const Scatter& scatter) {
  constexpr double kUnusual = 3.0;  // chosen: times the usual, more than rigs differ by
  return scatter.variance > kUnusual * kUnusual * default_scatter().variance;
}

bool parts_experiments(const Scatter& without, const Scatter& with) {
  constexpr double kMore = 4.0;  // of the variance, on balance of all kinds
  // By what healthy experiments differ anyway, none has been driven apart.
  const RandomVector usual = default_scatter().variance;
  const RandomVector grown = with.variance.max(usual) / without.variance.max(usual);
  return (with.variance / without.variance).min(grown.max(1.0)).prod() > kMore;
}

bool gathers_experiments(const Scatter& without, const Scatter& with) {
  return (is_unusual(without) && !is_unusual(with)).any();
}

Whitening identity_whitening(const Campaign& campaign) {
  Whitening out;
  for (auto& filter : out.filter) {
    filter.coefficient = {VectorXd()};
    filter.sigma = {1.0};
  }
  for (const ExperimentData& run : campaign.runs) {
    out.weight.push_back({ArrayXd::Ones(run.valid_count), ArrayXd::Ones(run.valid_count),
                          ArrayXd::Ones(run.valid_count)});
  }
  return out;
}

namespace {

std::vector<int> kinds_of(const Campaign& campaign) {
  std::vector<int> kinds{kFrictionResidual};
  if (campaign.has_balance) kinds.push_back(kBalanceResidual);
  if (campaign.has_tracking) kinds.push_back(kTrackingResidual);
  return kinds;
}

bool is_zero(const ArrayXd& column) {
  return std::all_of(column.begin(), column.end(), [](double v) { return v == 0.0; });
}

// One block per kind of residual; rows: valid samples.
std::vector<WhiteBlock> whitened(const Campaign& campaign, int run, const RawColumns& raw,
                                 const Whitening& whitening) {
  const ExperimentData& data = campaign.runs[static_cast<std::size_t>(run)];
  const std::vector<int> kinds = kinds_of(campaign);
  const Index rows = data.valid_count;
  const auto& weight = whitening.weight[static_cast<std::size_t>(run)];
  const auto e = static_cast<std::size_t>(run);
  std::vector<WhiteBlock> out(kinds.size());
  const bool mixed = campaign.has_balance && whitening.cross != 0.0;
  for (std::size_t i = kinds.size(); i-- > 0;) {  // friction last: the balance's goes into it
    const auto kind = static_cast<std::size_t>(kinds[i]);
    WhiteBlock& block = out[i];
    const std::vector<int>* beside = mixed && kind == kFrictionResidual ? &out[1].columns : nullptr;
    for (std::size_t j = 0; j < raw.columns.size(); ++j) {
      const auto column = static_cast<int>(j);
      if (!is_zero(raw.columns[j][kind]) ||
          (beside != nullptr && std::binary_search(beside->begin(), beside->end(), column))) {
        block.columns.push_back(column);
      }
    }
    block.rows.resize(rows, static_cast<Index>(block.columns.size()));
    std::size_t next = 0;
    for (Index c = 0; c < block.rows.cols(); ++c) {
      const int column = block.columns[static_cast<std::size_t>(c)];
      const ArrayXd& in = raw.columns[static_cast<std::size_t>(column)][kind];
      auto to = block.rows.col(c);
      if (in.size() == 0) {
        to.setZero();
      } else {
        const bool rests = e < whitening.rest.size() && !whitening.rest[e][kind].empty();
        const ArrayXd less = rests ? less_rests(whitening.rest[e][kind], in) : ArrayXd();
        whiten(data, whitening.filter[kind], rests ? less : in, weight[kind], to.data());
      }
      if (beside == nullptr) continue;
      if (next < beside->size() && (*beside)[next] == column) {
        to -= whitening.cross * out[1].rows.col(static_cast<Index>(next++));
      }
      to /= std::sqrt(1.0 - whitening.cross * whitening.cross);
    }
  }
  return out;
}

}  // namespace

ResidualColumns valid_rows(const ExperimentData& data, const ResidualColumns& column,
                           double scale) {
  ResidualColumns out;
  for (std::size_t kind = 0; kind < kResidualKinds; ++kind) {
    const ArrayXd& from = column[kind];
    if (from.size() == 0) continue;
    ArrayXd& to = out[kind];
    to.resize(data.valid_count);
    Index row = 0;
    for (const auto& [begin, end] : data.stretches) {
      to.segment(row, end - begin) = from.segment(begin, end - begin) * scale;
      row += end - begin;
    }
  }
  return out;
}

RawColumns raw_columns(const Campaign& campaign, int run, const ModelState& state, Residuals& at,
                       const std::vector<int>& parameters, const VectorXd& scale, bool with_random,
                       const ExtraColumns& extra) {
  RawColumns out;
  out.with_random = with_random;
  if (with_random) move_to_foot(campaign, run, at);
  if (!parameters.empty()) prepare_derivatives(campaign, run, state, at);
  out.columns.reserve(parameters.size() + 1 + kRandomEffects);
  const ExperimentData& data = campaign.runs[static_cast<std::size_t>(run)];
  for (std::size_t j = 0; j < parameters.size(); ++j) {
    out.columns.push_back(
        derivative_rows(campaign, run, state, at, parameters[j], scale[static_cast<Index>(j)]));
  }
  if (extra) {
    for (const ResidualColumns& column : extra(run, at)) {
      out.columns.push_back(valid_rows(data, column));
    }
  }
  out.columns.push_back(valid_rows(data, at.value));
  if (with_random) {
    for (const ResidualColumns& column : random_columns(campaign, run, state, at)) {
      out.columns.push_back(valid_rows(data, column));
    }
  }
  return out;
}

Summary summary_of(const Campaign& campaign, int run, const RawColumns& raw,
                   const Whitening& whitening) {
  if (campaign.runs[static_cast<std::size_t>(run)].valid_count == 0) {
    const auto count =
        static_cast<Index>(raw.columns.size()) - (raw.with_random ? kRandomEffects : 0);
    return {MatrixXd::Zero(count, count), MatrixXd::Zero(kRandomEffects, count),
            MatrixXd::Zero(kRandomEffects, kRandomEffects), 0};
  }
  const std::vector<WhiteBlock> all = whitened(campaign, run, raw, whitening);
  const int n = static_cast<int>(raw.columns.size()) - (raw.with_random ? kRandomEffects : 0);
  Summary out{MatrixXd::Zero(n, n), MatrixXd::Zero(kRandomEffects, n),
              MatrixXd::Zero(kRandomEffects, kRandomEffects), 0};
  for (std::size_t i = 0; i < all.size(); ++i) {
    const WhiteBlock& block = all[i];
    const auto own = std::lower_bound(block.columns.begin(), block.columns.end(), n);
    const std::vector<int> columns(block.columns.begin(), own);
    const auto count = static_cast<Index>(columns.size());
    // The random effects: behind the others, or kept from before.
    const WhiteBlock& holder =
        raw.with_random ? block : whitening.random[static_cast<std::size_t>(run)][i];
    std::vector<int> effects(raw.with_random
                                 ? holder.columns.begin() + static_cast<std::ptrdiff_t>(count)
                                 : holder.columns.begin(),
                             holder.columns.end());
    const Columns random = holder.rows.rightCols(static_cast<Index>(effects.size()));
    if (raw.with_random) {
      for (int& effect : effects) effect -= n;
    }
    const Columns rows = block.rows.leftCols(count);
    out.samples += static_cast<int>(block.rows.rows());
    // A signal that never moves leaves a block without columns: nothing to add.
    if (!effects.empty() && raw.with_random) {
      out.uu(effects, effects) += products(random);
    } else if (!effects.empty()) {
      out.uu(effects, effects) += whitening.random_products[static_cast<std::size_t>(run)][i];
    }
    if (columns.empty()) continue;
    out.aa(columns, columns) += products(rows);
    if (!effects.empty()) out.ua(effects, columns) += products(random, rows);
  }
  return out;
}

Summary summarise(const Campaign& campaign, int run, const ModelState& state, Residuals& at,
                  const std::vector<int>& parameters, const VectorXd& scale,
                  const Whitening& whitening, const ExtraColumns& extra) {
  return summary_of(
      campaign, run,
      raw_columns(campaign, run, state, at, parameters, scale, whitening.random.empty(), extra),
      whitening);
}

Summary summarise(const Campaign& campaign, int run, const ModelState& state,
                  const std::vector<int>& parameters, const VectorXd& scale,
                  const Whitening& whitening, const ExtraColumns& extra) {
  Residuals at = residuals_of(campaign, run, state);
  return summarise(campaign, run, state, at, parameters, scale, whitening, extra);
}

std::array<VectorXd, kResidualKinds> white_residuals(const Campaign& campaign, int run,
                                                     const ModelState& state,
                                                     const Whitening& whitening,
                                                     const Scatter& scatter) {
  Residuals at = residuals_of(campaign, run, state);
  const RawColumns raw = raw_columns(campaign, run, state, at, {}, {}, true);
  const Summary summary = summary_of(campaign, run, raw, whitening);
  const MatrixXd inverse = (1.0 / scatter.variance).matrix().asDiagonal();
  VectorXd weights(1 + kRandomEffects);
  weights << 1.0, -solved_llt(summary.uu + inverse, VectorXd(summary.ua.col(0)));
  const std::vector<WhiteBlock> blocks = whitened(campaign, run, raw, whitening);
  const std::vector<int> kinds = kinds_of(campaign);
  std::array<VectorXd, kResidualKinds> out;
  for (std::size_t i = 0; i < kinds.size(); ++i) {
    if (blocks[i].columns.empty()) continue;
    out[static_cast<std::size_t>(kinds[i])] = blocks[i].rows * weights(blocks[i].columns);
  }
  return out;
}

namespace {
using RandomRows = Eigen::Matrix<double, kRandomEffects, Eigen::Dynamic>;
using RandomSquare = Eigen::Matrix<double, kRandomEffects, kRandomEffects>;

double log_likelihood_of(double quadratic, double ln_det, const Scatter& scatter) {
  return -0.5 * (quadratic + ln_det + scatter_penalty(scatter.variance));
}

// What no scatter changes, of the columns asked for.
struct Picked {
  MatrixXd aa;                 // of all experiments together
  std::vector<RandomRows> ua;  // per experiment
};

Picked pick(const std::vector<Summary>& summaries, const std::vector<int>& columns) {
  std::vector<int> picked = columns;
  picked.push_back(static_cast<int>(summaries.empty() ? 0 : summaries[0].aa.rows() - 1));
  const auto count = static_cast<Index>(picked.size());
  Picked out;
  out.aa = MatrixXd::Zero(count, count);
  for (const Summary& each : summaries) {
    out.aa += each.aa(picked, picked);
    out.ua.emplace_back(each.ua(Eigen::all, picked));
  }
  return out;
}

// posterior: covariance of the random effects given the parameters, per experiment; may be null.
NormalEquations reduce(const std::vector<Summary>& summaries, const Picked& picked,
                       const Scatter& scatter, std::vector<RandomSquare>* posterior) {
  NormalEquations out;
  const RandomSquare inverse = (1.0 / scatter.variance).matrix().asDiagonal();
  const double ln_scatter = scatter.variance.log().sum();
  MatrixXd roots(kRandomEffects * static_cast<Index>(summaries.size()), picked.aa.cols());
  for (std::size_t e = 0; e < summaries.size(); ++e) {
    const Eigen::LLT<RandomSquare> llt(summaries[e].uu + inverse);
    if (posterior != nullptr) (*posterior)[e] = llt.solve(RandomSquare::Identity());
    roots.middleRows<kRandomEffects>(kRandomEffects * static_cast<Index>(e)) =
        llt.matrixL().solve(picked.ua[e]);
    out.ln_det += 2.0 * llt.matrixLLT().diagonal().array().log().sum() + ln_scatter;
  }
  out.total = picked.aa - products(roots);
  return out;
}

Eigen::LDLT<MatrixXd> decomposed(const NormalEquations& equations, const Prior& prior) {
  const Index n = equations.total.cols() - 1;
  MatrixXd information = equations.total.topLeftCorner(n, n);
  information.diagonal() += prior.precision;
  return Eigen::LDLT<MatrixXd>(information);
}

VectorXd step_of(const Eigen::LDLT<MatrixXd>& ldlt, const NormalEquations& equations,
                 const Prior& prior) {
  VectorXd right = -equations.total.topRightCorner(equations.total.cols() - 1, 1);
  right += prior.precision.cwiseProduct(prior.pull);
  return ldlt.solve(right);
}

// Of each column, its square by the inverse of what is decomposed, which is not needed for it.
VectorXd squares_by_inverse(const Eigen::LDLT<MatrixXd>& ldlt, const MatrixXd& columns) {
  MatrixXd roots = ldlt.transpositionsP() * columns;
  ldlt.matrixL().solveInPlace(roots);
  return roots.cwiseAbs2().transpose() * ldlt.vectorD().cwiseInverse();
}

Fit solve(const NormalEquations& equations, const Prior& prior, const Scatter& scatter,
          Wanted wanted) {
  const MatrixXd& total = equations.total;
  const Index n = total.cols() - 1;
  const Eigen::LDLT<MatrixXd> ldlt = decomposed(equations, prior);
  Fit fit;
  fit.scatter = scatter;
  fit.step = step_of(ldlt, equations, prior);
  if (wanted == Wanted::kCovariance) fit.covariance = ldlt.solve(MatrixXd::Identity(n, n));
  const VectorXd off = fit.step - prior.pull;
  VectorXd full(n + 1);
  full << fit.step, 1.0;
  fit.misfit = full.dot(total * full);
  fit.log_likelihood = log_likelihood_of(fit.misfit + off.dot(prior.precision.cwiseProduct(off)),
                                         equations.ln_det, scatter);
  return fit;
}
}  // namespace

NormalEquations normal_equations(const std::vector<Summary>& summaries,
                                 const std::vector<int>& columns, const Scatter& scatter) {
  return reduce(summaries, pick(summaries, columns), scatter, nullptr);
}

Fit fit_linear(const NormalEquations& equations, const Prior& prior, const Scatter& scatter) {
  return solve(equations, prior, scatter, Wanted::kStep);
}

double log_likelihood(const NormalEquations& equations, const Scatter& scatter) {
  const Index last = equations.total.cols() - 1;
  return log_likelihood_of(equations.total(last, last), equations.ln_det, scatter);
}

Fit fit_linear(const std::vector<Summary>& summaries, const std::vector<int>& columns,
               const Prior& prior, const Scatter& start, int scatter_iterations, Wanted wanted) {
  const auto n = static_cast<Index>(columns.size());
  const auto runs = summaries.size();
  const Picked picked = pick(summaries, columns);
  Scatter scatter = start;
  for (int iteration = 0;; ++iteration) {
    const bool is_last = iteration >= scatter_iterations;
    std::vector<RandomSquare> posterior(is_last ? 0 : runs);
    const NormalEquations equations =
        reduce(summaries, picked, scatter, is_last ? nullptr : &posterior);
    if (is_last) return solve(equations, prior, scatter, wanted);
    const Eigen::LDLT<MatrixXd> ldlt = decomposed(equations, prior);
    VectorXd full(n + 1);
    full << step_of(ldlt, equations, prior), 1.0;
    MatrixXd levers(n, kRandomEffects * static_cast<Index>(runs));
    Eigen::Array<double, kRandomEffects, 1> square =
        Eigen::Array<double, kRandomEffects, 1>::Zero();
    for (std::size_t e = 0; e < runs; ++e) {
      const Eigen::Matrix<double, kRandomEffects, 1> u = -posterior[e] * (picked.ua[e] * full);
      square += u.array().square() + posterior[e].diagonal().array();
      if (n == 0) continue;
      levers.middleCols<kRandomEffects>(kRandomEffects * static_cast<Index>(e)) =
          picked.ua[e].leftCols(n).transpose() * posterior[e];
    }
    if (levers.size() > 0) {
      square +=
          squares_by_inverse(ldlt, levers).reshaped(kRandomEffects, runs).rowwise().sum().array();
    }
    const double count = std::max(1.0, static_cast<double>(runs));
    scatter.variance = scatter_variance(square / count, static_cast<double>(runs));
    scatter.variance = scatter.variance.min(scatter.most);
  }
}

std::vector<double> left_out_densities(const std::vector<Summary>& summaries,
                                       const std::vector<int>& columns, const Prior& prior,
                                       const Scatter& start) {
  constexpr int kScatterIterations = 6;
  std::vector<int> picked = columns;
  picked.push_back(static_cast<int>(summaries.empty() ? 0 : summaries[0].aa.rows() - 1));
  std::vector<Summary> own;  // of these columns alone: copied for every experiment
  own.reserve(summaries.size());
  for (const Summary& each : summaries) {
    own.push_back({each.aa(picked, picked), each.ua(Eigen::all, picked), each.uu, each.samples});
  }
  std::vector<int> all_of_them(columns.size());
  std::iota(all_of_them.begin(), all_of_them.end(), 0);
  std::vector<double> out;
  for (std::size_t e = 0; e < summaries.size(); ++e) {
    std::vector<Summary> runs = own;
    runs.erase(runs.begin() + static_cast<std::ptrdiff_t>(e));
    const Fit others = fit_linear(runs, all_of_them, prior, start, kScatterIterations);
    // The others' posterior as the prior of the one left out; its gain in evidence.
    runs.push_back(own[e]);
    const Fit all = fit_linear(runs, all_of_them, prior, others.scatter, 0);
    const double ln_det = others.covariance.ldlt().vectorD().array().max(1e-300).log().sum() -
                          all.covariance.ldlt().vectorD().array().max(1e-300).log().sum();
    out.push_back(all.log_likelihood - others.log_likelihood - 0.5 * ln_det);
  }
  return out;
}

double left_out_density(const std::vector<Summary>& summaries, const std::vector<int>& columns,
                        const Prior& prior, const Scatter& start) {
  const std::vector<double> each = left_out_densities(summaries, columns, prior, start);
  return std::accumulate(each.begin(), each.end(), 0.0);
}

Information information_on(const std::vector<Summary>& summaries, const std::vector<int>& others,
                           const Prior& prior, int column, const Scatter& scatter) {
  const auto n = static_cast<Index>(others.size());
  std::vector<int> picked = others;
  picked.push_back(column);
  const auto perpendicular = [&](bool with_scatter) {
    MatrixXd total = MatrixXd::Zero(n + 1, n + 1);
    const MatrixXd inverse = (1.0 / scatter.variance).matrix().asDiagonal();
    for (const Summary& each : summaries) {
      total += each.aa(picked, picked);
      if (!with_scatter) continue;
      const MatrixXd ua = each.ua(Eigen::all, picked);
      total -= ua.transpose() * solved_llt(each.uu + inverse, ua);
    }
    for (Index j = 0; j < n; ++j) total(j, j) += prior.precision[j];
    const VectorXd cross = total.topRightCorner(n, 1);
    return total(n, n) - cross.dot(solved_ldlt(total.topLeftCorner(n, n), cross));
  };
  return {perpendicular(true), perpendicular(false)};
}

namespace {

// What is left over, unwhitened and unweighted, in the grid's order: kind by kind, run by run; and
// its covariance by lag, added up over the runs.
struct LeftOver {
  explicit LeftOver(std::size_t runs) {
    for (std::size_t q = 0; q < kResidualKinds; ++q) {
      rest[q].resize(runs);
      covariance[q].assign(Whitening::kOrder + 1, 0.0);
      count[q].assign(Whitening::kOrder + 1, 0.0);
    }
  }
  void add(const ExperimentData& data, std::size_t e, std::size_t q, const VectorXd& block);

  std::array<std::vector<std::vector<double>>, kResidualKinds> rest;
  std::array<std::vector<double>, kResidualKinds> covariance;
  std::array<std::vector<double>, kResidualKinds> count;
};

// Clipped: a few outliers must not make the noise look white.
double clip_bound(const std::vector<double>& values) {
  std::vector<double> size;
  for (const double v : values) {
    if (v != 0.0) size.push_back(std::abs(v));
  }
  return (size.empty() ? 0.0 : kClipSigmas * estimator::kSigmaPerMedian * estimator::median(size)) +
         1e-12;
}

void LeftOver::add(const ExperimentData& data, std::size_t e, std::size_t q,
                   const VectorXd& block) {
  rest[q][e].assign(block.data(), block.data() + block.size());
  const double bound = clip_bound(rest[q][e]);
  Index row = 0;
  std::vector<Index> row_of(static_cast<std::size_t>(data.size()), -1);
  for (int k = 0; k < data.size(); ++k) {
    if (data.valid[static_cast<std::size_t>(k)]) row_of[static_cast<std::size_t>(k)] = row++;
  }
  for (int k = 0; k < data.size(); ++k) {
    const Index a = row_of[static_cast<std::size_t>(k)];
    if (a < 0) continue;
    for (int lag = 0; lag <= Whitening::kOrder && k - lag >= 0; ++lag) {
      const Index b = row_of[static_cast<std::size_t>(k - lag)];
      if (b < 0) break;
      covariance[q][static_cast<std::size_t>(lag)] +=
          std::clamp(block[a], -bound, bound) * std::clamp(block[b], -bound, bound);
      // A sample that this residual does not use is exactly zero.
      if (block[a] != 0.0) count[q][static_cast<std::size_t>(lag)] += 1.0;
    }
  }
}

LeftOver left_over(const Campaign& campaign, const std::vector<RawColumns>& raw,
                   const std::vector<Summary>& summaries, const Fit& fit, const Whitening& plain) {
  VectorXd full(fit.step.size() + 1);
  full << fit.step, 1.0;
  const MatrixXd inverse = (1.0 / fit.scatter.variance).matrix().asDiagonal();
  LeftOver out(campaign.runs.size());
  const std::vector<int> kinds = kinds_of(campaign);
  for (std::size_t e = 0; e < campaign.runs.size(); ++e) {
    const ExperimentData& data = campaign.runs[e];
    if (data.valid_count == 0) continue;
    const std::vector<WhiteBlock> blocks = whitened(campaign, static_cast<int>(e), raw[e], plain);
    const VectorXd u = -solved_llt(summaries[e].uu + inverse, VectorXd(summaries[e].ua * full));
    VectorXd weights(full.size() + u.size());
    weights << full, u;
    for (std::size_t i = 0; i < kinds.size(); ++i) {
      VectorXd block = VectorXd::Zero(blocks[i].rows.rows());
      if (!blocks[i].columns.empty()) block = blocks[i].rows * weights(blocks[i].columns);
      out.add(data, e, static_cast<std::size_t>(kinds[i]), block);
    }
  }
  return out;
}

void set_filters(const Campaign& campaign, const LeftOver& left, Whitening& out) {
  for (const int kind : kinds_of(campaign)) {
    const auto q = static_cast<std::size_t>(kind);
    std::vector<double> covariance = left.covariance[q];
    // Biased: keeps the filter stable.
    for (double& each : covariance) each /= std::max(left.count[q][0], 1.0);
    out.filter[q] = levinson(covariance);
  }
}

// Large residuals weigh less; and how friction's and balance's go together.
void set_weights(const Campaign& campaign, const LeftOver& left, Whitening& out) {
  const std::vector<int> kinds = kinds_of(campaign);
  double cross = 0.0, power_friction = 0.0, power_balance = 0.0;
  for (std::size_t e = 0; e < campaign.runs.size(); ++e) {
    const ExperimentData& data = campaign.runs[e];
    if (left.rest[kFrictionResidual][e].empty()) continue;
    std::array<VectorXd, kResidualKinds> white;
    for (const int kind : kinds) {
      const auto q = static_cast<std::size_t>(kind);
      white[q].resize(data.valid_count);
      whiten(data, out.filter[q], ArrayXd::Map(left.rest[q][e].data(), data.valid_count),
             ArrayXd::Ones(data.valid_count), white[q].data());
      for (Index i = 0; i < white[q].size(); ++i) {
        const double size = std::abs(white[q][i]);
        out.weight[e][q][i] = size > kHuber ? std::sqrt(kHuber / size) : 1.0;
      }
    }
    if (campaign.has_balance) {
      const ArrayXd f = white[kFrictionResidual].array() * out.weight[e][kFrictionResidual];
      const ArrayXd b = white[kBalanceResidual].array() * out.weight[e][kBalanceResidual];
      cross += (f * b).sum();
      power_friction += f.square().sum();
      power_balance += b.square().sum();
    }
  }
  if (power_friction > 0.0 && power_balance > 0.0) {
    out.cross = std::clamp(cross / std::sqrt(power_friction * power_balance), -0.95, 0.95);
  }
}

}  // namespace

Whitening fit_whitening(const Campaign& campaign, const std::vector<RawColumns>& raw,
                        const Prior& prior, const Whitening& before, int jobs) {
  const auto runs = campaign.runs.size();
  std::vector<Summary> summaries(runs);
  in_parallel(jobs, runs, [&](std::size_t e) {
    summaries[e] = summary_of(campaign, static_cast<int>(e), raw[e], before);
  });
  std::vector<int> all(static_cast<std::size_t>(prior.pull.size()));
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = static_cast<int>(i);
  const Fit fit = fit_linear(summaries, all, prior, default_scatter(), 4);
  Whitening out = identity_whitening(campaign);
  for (std::size_t e = 0; e < runs; ++e) {
    out.rest.push_back(rests_of(campaign, static_cast<int>(e), raw[e]));
  }
  const LeftOver left = left_over(campaign, raw, summaries, fit, out);
  set_filters(campaign, left, out);
  set_weights(campaign, left, out);
  for (std::size_t e = 0; e < runs; ++e) {
    RawColumns random;
    random.columns.assign(raw[e].columns.end() - kRandomEffects, raw[e].columns.end());
    out.random.push_back(whitened(campaign, static_cast<int>(e), random, out));
    std::vector<MatrixXd>& of_run = out.random_products.emplace_back();
    for (const WhiteBlock& block : out.random.back()) {
      of_run.push_back(products(block.rows));
    }
  }
  return out;
}

namespace {

double ln_normal_p(double z) {  // two-sided
  if (z < 25.0) return std::log(std::erfc(z / std::numbers::sqrt2));
  return -0.5 * z * z - std::log(z * std::sqrt(std::numbers::pi / 2.0));
}

double chi2_of_ln_p(double ln_p) {
  if (ln_p >= 0.0) return 0.0;
  double low = 0.0, high = 1.0;
  while (ln_normal_p(high) > ln_p && high < 1e6) high *= 2.0;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (ln_normal_p(middle) > ln_p ? low : high) = middle;
  }
  return low * low;
}
}  // namespace

double chi2_of_student(double t, double degrees) {
  if (degrees > 2000.0) return t * t;
  const double p = estimator::student_p(t, degrees);
  // Far tail: ln p of Student's t directly.
  return chi2_of_ln_p(p < 1e-280
                          ? std::log(2.0) - 0.5 * (degrees + 1.0) * std::log1p(t * t / degrees)
                          : std::log(p));
}

double chi2_of_f(double f, double numerator_degrees, double denominator_degrees) {
  const double denominator = std::min(denominator_degrees, 1e5);
  const double p = estimator::f_p(f, numerator_degrees, denominator);
  return chi2_of_ln_p(p < 1e-280
                          ? -0.5 * denominator * std::log1p(numerator_degrees * f / denominator)
                          : std::log(p));
}

}  // namespace beltgrip::diagnose
