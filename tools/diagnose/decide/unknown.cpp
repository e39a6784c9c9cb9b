#include "tools/diagnose/decide/unknown.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>

#include "tools/diagnose/infer/index_variables.h"
#include "tools/diagnose/infer/parallel.h"

namespace beltgrip::diagnose {
namespace {

using Eigen::ArrayXd;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::array<const char*, 5> kActsOn{"friction", "ratio", "torque", "torque_gain",
                                             "clamp_force"};
constexpr std::size_t kPerVariable = 3 * kActsOn.size();
// Size of one unit of a column, and the size that begins to matter: less is the difference between
// one friction law and another.
constexpr std::array<double, 5> kUnit{0.05, 2e-3, 2.0, 0.05, 200.0};  // share, share, Nm, share, N
constexpr double kAnyConstant = 1e-3;  // precision: of a constant that is not known at all
constexpr double kVaried = 0.05;       // of its middle; less may be the channel's own noise
constexpr double kOwnShareMin = 0.01;
constexpr double kLooked = 8.0;  // below this a group is no candidate
constexpr std::array<double, 5> kMatters{5e-3, 2e-4, 0.2, 5e-3, 20.0};

// The curve's own abscissa is torque over capacity: against torque only friction is looked at.
// A gain and a force are told from friction by the torque behind the belt alone, and along what
// does not move within a ramp.
bool sensible(const Campaign& campaign, const std::string& variable, std::size_t injection) {
  if (injection < 3) return variable != "torque" || injection == 0;
  return campaign.has_balance &&
         (variable == "oil_temperature" || variable == "primary_speed" || variable == "time");
}

// The variable scaled to [-1, 1] between its 1 % and 99 % points over all valid samples; false if
// it does not vary.
bool scaled_variable(const Campaign& campaign, const IndexVariable& variable,
                     std::vector<ArrayXd>& out) {
  std::vector<double> all;
  out.clear();
  for (std::size_t e = 0; e < campaign.runs.size(); ++e) {
    const ExperimentData& run = campaign.runs[e];
    out.push_back(run.valid_count > 0 ? variable.value(run, static_cast<int>(e)) : ArrayXd());
    if (run.valid_count > 0 && out.back().size() == 0) return false;
    for (int k = 0; k < run.size(); ++k) {
      if (run.valid[static_cast<std::size_t>(k)]) all.push_back(out.back()[k]);
    }
  }
  if (all.size() < 50) return false;
  std::sort(all.begin(), all.end());
  const double low = all[all.size() / 100], high = all[all.size() - 1 - all.size() / 100];
  const double middle = all[all.size() / 2];
  if (!(high - low > kVaried * std::abs(middle) + 1e-12)) return false;
  for (ArrayXd& x : out) x = (2.0 * (x - low) / (high - low) - 1.0).max(-1.1).min(1.1);
  return true;
}

}  // namespace

std::vector<UnknownGroup> score_groups(const Engine& engine) {
  const Campaign& campaign = engine.campaign();
  const std::vector<int> parameters = engine.with_nuisances(engine.accepted());
  const auto n = static_cast<Index>(parameters.size());
  std::vector<UnknownGroup> out;
  std::vector<std::vector<ArrayXd>> index;
  std::vector<const IndexVariable*> used;
  for (const IndexVariable& variable : index_variables()) {
    if (variable.name == std::string_view("torque") && !campaign.torque_varies) continue;
    std::vector<ArrayXd> values;
    if (scaled_variable(campaign, variable, values)) {
      index.push_back(std::move(values));
      used.push_back(&variable);
    }
  }
  if (used.empty()) return out;
  // Extra columns: variable x injection x degree.
  const ExtraColumns extra = [&](int run, const Residuals& at) {
    std::vector<ResidualColumns> columns;
    for (const auto& values : index) {
      const ArrayXd& x = values[static_cast<std::size_t>(run)];
      const std::array<ArrayXd, 3> legendre{x, 1.5 * x.square() - 0.5, 2.5 * x.cube() - 1.5 * x};
      const std::string name = used[static_cast<std::size_t>(&values - index.data())]->name;
      for (std::size_t injection = 0; injection < kActsOn.size(); ++injection) {
        for (const ArrayXd& p : legendre) {
          QuantityChange change;
          if (!sensible(campaign, name,
                        injection)) {  // a column all the same, its place is counted
            columns.emplace_back();
            continue;
          }
          if (injection == 0) change.ln_capacity = p * kUnit[0];
          if (injection == 1) change.slip_share = p * kUnit[1];
          if (injection == 2) {
            change.torque = p * kUnit[2];
            change.balance = p * kUnit[2];
          }
          if (injection == 3) {
            change.torque = p * kUnit[3] * at.clean_reading_Nm;
            change.balance = change.torque;
          }
          if (injection == 4) change.ln_capacity = p * kUnit[4] / at.there.force_N.max(50.0);
          columns.push_back(propagate(campaign, at, change));
        }
      }
    }
    return columns;
  };
  VectorXd scales(n);
  for (Index j = 0; j < n; ++j) scales[j] = engine.scale(parameters[static_cast<std::size_t>(j)]);
  std::vector<Summary> summaries(engine.used().size());
  in_parallel(engine.jobs(), summaries.size(), [&](std::size_t i) {
    summaries[i] = summarise(campaign, engine.used()[i], engine.state(), parameters, scales,
                             engine.whitening(), extra);
  });
  engine.add_curve_bounds(engine.state(), parameters, summaries);
  std::vector<int> base(static_cast<std::size_t>(n));
  for (std::size_t i = 0; i < base.size(); ++i) base[i] = static_cast<int>(i);
  const Prior base_prior = engine.prior(parameters, engine.state());
  const Fit none = fit_linear(summaries, base, base_prior, default_scatter(), 15);
  std::optional<double> none_left_out;
  for (std::size_t v = 0; v < used.size(); ++v) {
    for (std::size_t injection = 0; injection < kActsOn.size(); ++injection) {
      if (!sensible(campaign, used[v]->name, injection)) continue;
      const int first = static_cast<int>(n) + static_cast<int>(v * kPerVariable + injection * 3);
      std::vector<int> columns = base;
      Prior prior = base_prior;
      prior.pull.conservativeResize(n + 3);
      prior.precision.conservativeResize(n + 3);
      for (int i = 0; i < 3; ++i) {
        columns.push_back(first + i);
        prior.pull[n + i] = 0.0;
        prior.precision[n + i] = 1.0 / 9.0;
      }
      const Fit fit = fit_linear(summaries, columns, prior, none.scatter, 8);
      UnknownGroup group;
      group.acts_on = kActsOn[injection];
      group.depends_on = used[v]->name;
      group.gain = 2.0 * (fit.log_likelihood - none.log_likelihood);
      group.share = none.misfit > 0.0 ? (none.misfit - fit.misfit) / none.misfit : 0.0;
      double squares = 0.0, samples = 0.0;
      for (std::size_t e = 0; e < campaign.runs.size(); ++e) {
        const ExperimentData& run = campaign.runs[e];
        for (int k = 0; k < run.size(); ++k) {
          if (!run.valid[static_cast<std::size_t>(k)]) continue;
          const double x = index[v][e][k];
          const double y = fit.step[n] * x + fit.step[n + 1] * (1.5 * x * x - 0.5) +
                           fit.step[n + 2] * (2.5 * x * x * x - 1.5 * x);
          squares += y * y;
          samples += 1.0;
        }
      }
      group.size =
          std::sqrt(squares / std::max(samples, 1.0)) * kUnit[injection] / kMatters[injection];
      // Each direction of the group by its own mix of evidence within and between experiments.
      const VectorXd value = fit.step.tail(3);
      const MatrixXd covariance = fit.covariance.bottomRightCorner(3, 3);
      const double wald = value.dot(covariance.ldlt().solve(value));
      const VectorXd direction = value / std::max(value.norm(), 1e-30);
      MatrixXd with = MatrixXd::Zero(3, 3), without = MatrixXd::Zero(3, 3);
      for (const bool counted : {true, false}) {
        MatrixXd total = MatrixXd::Zero(n + 3, n + 3);
        for (const Summary& each : summaries) {
          total += each.aa(columns, columns);
          if (!counted) continue;
          const MatrixXd ua = each.ua(Eigen::all, columns);
          const MatrixXd inverse = (1.0 / fit.scatter.variance).matrix().asDiagonal();
          total -= ua.transpose() * (each.uu + inverse).llt().solve(ua);
        }
        for (Index j = 0; j < n; ++j) total(j, j) += base_prior.precision[j];
        const MatrixXd cross = total.topRightCorner(n, 3);
        (counted ? with : without) =
            total.bottomRightCorner(3, 3) -
            cross.transpose() * total.topLeftCorner(n, n).ldlt().solve(cross);
      }
      // What the machine's constants could as well be, whatever their usual values, is no cause.
      MatrixXd plain = MatrixXd::Zero(n + 3, n + 3);
      for (const Summary& each : summaries) plain += each.aa(columns, columns);
      for (Index j = 0; j < n; ++j) plain(j, j) += kAnyConstant;
      const VectorXd mixed = plain.topRightCorner(n, 3) * direction;
      const double energy = direction.dot(plain.bottomRightCorner(3, 3) * direction);
      const double own = energy - mixed.dot(plain.topLeftCorner(n, n).ldlt().solve(mixed));
      if (own < kOwnShareMin * energy) continue;
      // What fits no better and only spares the machine's constants their way explains nothing.
      if (group.share <= 0.0 || parts_experiments(none.scatter, fit.scatter)) continue;
      // Its rest alone is seen; what they imitate is whatever fits best.
      group.size *= std::sqrt(std::min(own / energy, 1.0));
      const double degrees =
          engine.degrees(direction.dot(with * direction), direction.dot(without * direction));
      group.chi2 = chi2_of_f(wald / 3.0, 3.0, degrees);
      for (std::size_t i = 0; i < engine.accepted().size(); ++i) {
        const auto j = static_cast<Index>(engine.active_nuisances().size() + i);
        const int slot = engine.accepted()[i];
        const double size =
            engine.state().effects[slot] / engine.scale(kNuisanceCount + slot) + fit.step[j];
        group.accepted_chi2.push_back(size * size / std::max(fit.covariance(j, j), 1e-300));
      }
      if (group.chi2 > kLooked && group.gain > kLooked && group.size > 1.0) {
        if (!none_left_out) none_left_out = left_out_density(summaries, base, base_prior);
        group.left_out_gain =
            left_out_density(summaries, columns, prior) - none_left_out.value_or(0.0);
      }
      out.push_back(group);
    }
  }
  std::sort(out.begin(), out.end(),
            [](const UnknownGroup& a, const UnknownGroup& b) { return a.gain > b.gain; });
  return out;
}

}  // namespace beltgrip::diagnose
