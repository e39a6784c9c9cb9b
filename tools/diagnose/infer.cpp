#include "tools/diagnose/infer.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace beltgrip::diagnose {
namespace {

using Eigen::ArrayXd;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kHuber = 3.0;
constexpr double kScatterCap = 8.0;  // in usual scatters: beyond, it is an effect and not scatter

// One sigma between healthy experiments: what replicates on rigs scatter by.
constexpr std::array<double, kRandomEffects> kDefaultScatter{3e-3, 1.5e-4, 0.08, 0.02, 0.08, 500.0};

std::array<ResidualColumns, kRandomEffects> random_columns(const Campaign& campaign, int run,
                                                           const ModelState& state,
                                                           const Residuals& at) {
  const auto n = at.foot.size();
  std::array<ResidualColumns, kRandomEffects> out;
  QuantityChange level, seat, zero, zero_out, zero_track;
  level.ln_capacity = ArrayXd::Ones(n);
  out[0] = propagate(campaign, at, level);
  seat.slip = ArrayXd::Ones(n);
  out[1] = propagate(campaign, at, seat);
  zero.torque = ArrayXd::Ones(n);
  zero.balance = ArrayXd::Ones(n);
  out[2] = propagate(campaign, at, zero);
  const ExperimentData& data = campaign.runs[static_cast<std::size_t>(run)];
  QuantityChange peak;
  peak.torque = ArrayXd::Zero(n);
  for (Index k = 0; k < n; ++k) {
    const int stop = data.stop[static_cast<std::size_t>(k)];
    if (stop == kNoStop) continue;
    peak.torque[k] =
        at.slope[k] * at.foot[k] *
        std::exp(state.nuisance[stop == kLowStop ? kLnPeakSlipLow : kLnPeakSlipOverdrive]);
  }
  out[3] = propagate(campaign, at, peak);
  zero_out.balance = ArrayXd::Ones(n);
  out[4] = propagate(campaign, at, zero_out);
  zero_track.tracking = ArrayXd::Ones(n);
  out[5] = propagate(campaign, at, zero_track);
  return out;
}

// y filtered in place over the valid samples, segment by segment.
void whiten(const ExperimentData& data, const Whitening::Filter& filter, const ArrayXd& in,
            Eigen::Ref<VectorXd> out) {
  Index row = 0;
  int since = 0;
  for (int k = 0; k < data.size(); ++k) {
    if (!data.valid[static_cast<std::size_t>(k)]) {
      since = 0;
      continue;
    }
    const int order = std::min(since, static_cast<int>(filter.coefficient.size()) - 1);
    const VectorXd& a = filter.coefficient[static_cast<std::size_t>(order)];
    double e = in[k];
    for (int i = 0; i < order; ++i) e -= a[i] * in[k - 1 - i];
    out[row++] = e / filter.sigma[static_cast<std::size_t>(order)];
    ++since;
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

int valid_samples(const ExperimentData& data) { return data.valid_count; }

}  // namespace

Scatter default_scatter() {
  Scatter out;
  for (int i = 0; i < kRandomEffects; ++i) {
    const double s = kDefaultScatter[static_cast<std::size_t>(i)];
    out.variance[i] = s * s;
  }
  return out;
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

struct Design {
  MatrixXd columns;  // rows x (parameters + residual + random effects)
  int rows_per_kind = 0;
  std::vector<int> kinds;
};

Design design_of(const Campaign& campaign, int run, const ModelState& state,
                 const std::vector<int>& parameters, const VectorXd& scale,
                 const Whitening& whitening, const ExtraColumns& extra) {
  const ExperimentData& data = campaign.runs[static_cast<std::size_t>(run)];
  Design out;
  out.rows_per_kind = valid_samples(data);
  out.kinds = {kFrictionResidual};
  if (campaign.has_balance) out.kinds.push_back(kBalanceResidual);
  if (campaign.has_tracking) out.kinds.push_back(kTrackingResidual);
  const auto own = static_cast<Index>(parameters.size());
  Index n = own;
  const Index rows = out.rows_per_kind * static_cast<Index>(out.kinds.size());
  if (rows == 0) return out;
  const Residuals at = residuals_of(campaign, run, state);
  std::vector<ResidualColumns> further;
  if (extra) further = extra(run, at);
  n += static_cast<Index>(further.size());
  out.columns.resize(rows, n + 1 + kRandomEffects);
  const auto put = [&](Index column, const ResidualColumns& values, double factor) {
    for (std::size_t i = 0; i < out.kinds.size(); ++i) {
      const auto kind = static_cast<std::size_t>(out.kinds[i]);
      auto block = out.columns.col(column).segment(static_cast<Index>(i) * out.rows_per_kind,
                                                   out.rows_per_kind);
      whiten(data, whitening.filter[kind], values[kind], block);
      block.array() *= whitening.weight[static_cast<std::size_t>(run)][kind] * factor;
    }
    if (campaign.has_balance && whitening.cross != 0.0) {
      const double clean = std::sqrt(1.0 - whitening.cross * whitening.cross);
      auto friction = out.columns.col(column).segment(0, out.rows_per_kind);
      const auto balance = out.columns.col(column).segment(out.rows_per_kind, out.rows_per_kind);
      friction = (friction - whitening.cross * balance) / clean;
    }
  };
  for (Index j = 0; j < own; ++j) {
    const int parameter = parameters[static_cast<std::size_t>(j)];
    put(j, derivative(campaign, run, state, at, parameter), scale[j]);
  }
  for (Index j = own; j < n; ++j) put(j, further[static_cast<std::size_t>(j - own)], 1.0);
  put(n, at.value, 1.0);
  const auto random = random_columns(campaign, run, state, at);
  for (int i = 0; i < kRandomEffects; ++i) put(n + 1 + i, random[static_cast<std::size_t>(i)], 1.0);
  return out;
}

}  // namespace

Summary summarise(const Campaign& campaign, int run, const ModelState& state,
                  const std::vector<int>& parameters, const VectorXd& scale,
                  const Whitening& whitening, const ExtraColumns& extra) {
  const Design design = design_of(campaign, run, state, parameters, scale, whitening, extra);
  const Index all = design.columns.cols();
  const Index n = all - kRandomEffects;
  MatrixXd product = MatrixXd::Zero(all, all);
  product.selfadjointView<Eigen::Lower>().rankUpdate(design.columns.transpose());
  product = product.selfadjointView<Eigen::Lower>();
  Summary out;
  out.aa = product.topLeftCorner(n, n);
  out.ua = product.bottomLeftCorner(kRandomEffects, n);
  out.uu = product.bottomRightCorner(kRandomEffects, kRandomEffects);
  out.samples = static_cast<int>(design.columns.rows());
  return out;
}

Fit fit_linear(const std::vector<Summary>& summaries, const std::vector<int>& columns,
               const Prior& prior, const Scatter& start, int scatter_iterations) {
  const auto n = static_cast<Index>(columns.size());
  const auto runs = summaries.size();
  const Index last = summaries.empty() ? 0 : summaries[0].aa.rows() - 1;
  std::vector<int> picked = columns;
  picked.push_back(static_cast<int>(last));
  struct Part {
    MatrixXd aa, ua;
  };
  std::vector<Part> parts(runs);
  for (std::size_t e = 0; e < runs; ++e) {
    parts[e].aa = summaries[e].aa(picked, picked);
    parts[e].ua = summaries[e].ua(Eigen::all, picked);
  }
  const Scatter usual = default_scatter();
  Fit fit;
  fit.scatter = start;
  for (int iteration = 0;; ++iteration) {
    MatrixXd total = MatrixXd::Zero(n + 1, n + 1);
    double ln_det = 0.0;
    std::vector<MatrixXd> posterior(runs);  // covariance of the random effects given the parameters
    const MatrixXd inverse = (1.0 / fit.scatter.variance).matrix().asDiagonal();
    for (std::size_t e = 0; e < runs; ++e) {
      const Eigen::LLT<MatrixXd> llt(summaries[e].uu + inverse);
      posterior[e] = llt.solve(MatrixXd::Identity(kRandomEffects, kRandomEffects));
      total += parts[e].aa - parts[e].ua.transpose() * posterior[e] * parts[e].ua;
      ln_det +=
          2.0 * llt.matrixLLT().diagonal().array().log().sum() + fit.scatter.variance.log().sum();
    }
    MatrixXd information = total.topLeftCorner(n, n);
    VectorXd right = -total.topRightCorner(n, 1);
    for (Index j = 0; j < n; ++j) {
      information(j, j) += prior.precision[j];
      right[j] += prior.precision[j] * prior.pull[j];
    }
    const Eigen::LDLT<MatrixXd> ldlt(information);
    fit.step = ldlt.solve(right);
    fit.covariance = ldlt.solve(MatrixXd::Identity(n, n));
    const VectorXd off = fit.step - prior.pull;
    VectorXd full(n + 1);
    full << fit.step, 1.0;
    fit.misfit = full.dot(total * full);
    const double quadratic = fit.misfit + off.dot(prior.precision.cwiseProduct(off));
    double scatter_prior = 0.0;
    for (int i = 0; i < kRandomEffects; ++i) {
      scatter_prior += kScatterPriorRuns * (std::log(fit.scatter.variance[i]) +
                                            usual.variance[i] / fit.scatter.variance[i]);
    }
    fit.log_likelihood = -0.5 * (quadratic + ln_det + scatter_prior);
    if (iteration >= scatter_iterations) break;
    Eigen::Array<double, kRandomEffects, 1> square =
        Eigen::Array<double, kRandomEffects, 1>::Zero();
    for (std::size_t e = 0; e < runs; ++e) {
      const VectorXd u = -posterior[e] * (parts[e].ua * full);
      const MatrixXd lever = posterior[e] * parts[e].ua.leftCols(n);
      square += u.array().square() + posterior[e].diagonal().array() +
                (lever * fit.covariance * lever.transpose()).diagonal().array();
    }
    fit.scatter.variance = (square + kScatterPriorRuns * usual.variance) /
                           (static_cast<double>(runs) + kScatterPriorRuns);
    fit.scatter.variance = fit.scatter.variance.min(kScatterCap * kScatterCap * usual.variance);
  }
  return fit;
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
      total -= ua.transpose() * (each.uu + inverse).llt().solve(ua);
    }
    for (Index j = 0; j < n; ++j) total(j, j) += prior.precision[j];
    const VectorXd cross = total.topRightCorner(n, 1);
    return total(n, n) - cross.dot(total.topLeftCorner(n, n).ldlt().solve(cross));
  };
  return {perpendicular(true), perpendicular(false)};
}

Whitening fit_whitening(const Campaign& campaign, const ModelState& state,
                        const std::vector<int>& parameters, const VectorXd& scale,
                        const Prior& prior, const Whitening& before) {
  std::vector<Summary> summaries;
  std::vector<Design> designs;
  Whitening plain = identity_whitening(campaign);
  plain.weight = before.weight;
  const auto runs = campaign.runs.size();
  summaries.reserve(runs);
  for (std::size_t e = 0; e < runs; ++e) {
    summaries.push_back(summarise(campaign, static_cast<int>(e), state, parameters, scale, before));
  }
  std::vector<int> all(parameters.size());
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = static_cast<int>(i);
  const Fit fit = fit_linear(summaries, all, prior, default_scatter(), 4);
  VectorXd full(fit.step.size() + 1);
  full << fit.step, 1.0;
  const MatrixXd inverse = (1.0 / fit.scatter.variance).matrix().asDiagonal();

  // What is left over, unwhitened and unweighted, in the grid's order.
  Whitening out = identity_whitening(campaign);
  std::array<std::vector<std::vector<double>>, kResidualKinds> rest;
  std::array<std::vector<double>, kResidualKinds> covariance;
  std::array<std::vector<double>, kResidualKinds> count;
  for (int kind = 0; kind < kResidualKinds; ++kind) {
    const auto q = static_cast<std::size_t>(kind);
    rest[q].resize(runs);
    covariance[q].assign(Whitening::kOrder + 1, 0.0);
    count[q].assign(Whitening::kOrder + 1, 0.0);
  }
  std::vector<int> kinds;
  for (std::size_t e = 0; e < runs; ++e) {
    const ExperimentData& data = campaign.runs[e];
    const Design design = design_of(campaign, static_cast<int>(e), state, parameters, scale,
                                    identity_whitening(campaign), {});
    if (design.columns.rows() == 0) continue;
    kinds = design.kinds;
    const VectorXd u = -(summaries[e].uu + inverse).llt().solve(summaries[e].ua * full);
    VectorXd weights(design.columns.cols());
    weights << full, u;
    const VectorXd left = design.columns * weights;
    for (std::size_t i = 0; i < design.kinds.size(); ++i) {
      const auto q = static_cast<std::size_t>(design.kinds[i]);
      const auto block =
          left.segment(static_cast<Index>(i) * design.rows_per_kind, design.rows_per_kind);
      rest[q][e].assign(block.data(), block.data() + block.size());
      // Clipped: a few outliers must not make the noise look white.
      std::vector<double> size(rest[q][e]);
      for (double& v : size) v = std::abs(v);
      std::sort(size.begin(), size.end());
      const double bound = 4.0 * 1.4826 * size[size.size() / 2] + 1e-12;
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
          count[q][static_cast<std::size_t>(lag)] += 1.0;
        }
      }
    }
  }
  for (const int kind : kinds) {
    const auto q = static_cast<std::size_t>(kind);
    for (std::size_t lag = 0; lag < covariance[q].size(); ++lag) {
      covariance[q][lag] /= std::max(count[q][0], 1.0);  // biased: keeps the filter stable
    }
    out.filter[q] = levinson(covariance[q]);
  }
  double cross = 0.0, power_friction = 0.0, power_balance = 0.0;
  for (std::size_t e = 0; e < runs; ++e) {
    const ExperimentData& data = campaign.runs[e];
    if (rest[kFrictionResidual][e].empty()) continue;
    std::array<VectorXd, kResidualKinds> white;
    for (const int kind : kinds) {
      const auto q = static_cast<std::size_t>(kind);
      ArrayXd grid = ArrayXd::Zero(data.size());
      std::size_t row = 0;
      for (int k = 0; k < data.size(); ++k) {
        if (data.valid[static_cast<std::size_t>(k)]) grid[k] = rest[q][e][row++];
      }
      white[q].resize(data.valid_count);
      whiten(data, out.filter[q], grid, white[q]);
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
  return out;
}

namespace {

// Regularised incomplete beta by Lentz's continued fraction.
double incomplete_beta(double a, double b, double x) {
  if (x <= 0.0) return 0.0;
  if (x >= 1.0) return 1.0;
  if (x > (a + 1.0) / (a + b + 2.0)) return 1.0 - incomplete_beta(b, a, 1.0 - x);
  const double front = std::exp(std::lgamma(a + b) - std::lgamma(a) - std::lgamma(b) +
                                a * std::log(x) + b * std::log1p(-x)) /
                       a;
  double f = 1.0, c = 1.0, d = 0.0;
  for (int i = 0; i <= 300; ++i) {
    const int half = i / 2;
    const double m = half;
    double numerator = 1.0;
    if (i > 0) {
      numerator = i % 2 == 0 ? m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m))
                             : -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
    }
    d = 1.0 + numerator * d;
    d = 1.0 / (std::abs(d) < 1e-30 ? 1e-30 : d);
    c = 1.0 + numerator / c;
    if (std::abs(c) < 1e-30) c = 1e-30;
    f *= c * d;
    if (std::abs(1.0 - c * d) < 1e-12) break;
  }
  return front * (f - 1.0);
}

double ln_normal_p(double z) {  // two-sided
  if (z < 25.0) return std::log(std::erfc(z / std::numbers::sqrt2));
  return -0.5 * z * z - std::log(z * std::sqrt(std::numbers::pi / 2.0));
}

}  // namespace

double student_p(double t, double degrees) {
  return incomplete_beta(0.5 * degrees, 0.5, degrees / (degrees + t * t));
}

namespace {
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
  const double p = student_p(t, degrees);
  // Far tail: ln p of Student's t directly.
  return chi2_of_ln_p(p < 1e-280
                          ? std::log(2.0) - 0.5 * (degrees + 1.0) * std::log1p(t * t / degrees)
                          : std::log(p));
}

double chi2_of_f(double f, double numerator_degrees, double denominator_degrees) {
  const double denominator = std::min(denominator_degrees, 1e5);
  const double x = denominator / (denominator + numerator_degrees * f);
  const double p = incomplete_beta(0.5 * denominator, 0.5 * numerator_degrees, x);
  return chi2_of_ln_p(p < 1e-280 ? 0.5 * denominator * std::log(x) : std::log(p));
}

}  // namespace beltgrip::diagnose
