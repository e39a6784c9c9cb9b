#include "tools/diagnose/decide/unknown.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <utility>

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

// The index variables that vary, from -1 to 1: of each its values, run by run.
struct VariedIndex {
  std::vector<const IndexVariable*> variables;
  std::vector<std::vector<ArrayXd>> values;
};

VariedIndex varied_index(const Campaign& campaign) {
  VariedIndex out;
  for (const IndexVariable& variable : index_variables()) {
    if (variable.name == std::string_view("torque") && !campaign.torque_varies) continue;
    std::optional<Abscissa> abscissa = abscissa_of(campaign, variable);
    if (!abscissa) continue;
    std::vector<ArrayXd> values = std::move(abscissa->x);
    for (ArrayXd& x : values) x = 2.0 * x - 1.0;
    out.values.push_back(std::move(values));
    out.variables.push_back(&variable);
  }
  return out;
}

// What a group changes along one of its polynomials p.
QuantityChange injected(std::size_t injection, const ArrayXd& p, const Residuals& at) {
  QuantityChange change;
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
  return change;
}

// Extra columns of a run: variable x injection x degree.
std::vector<ResidualColumns> group_columns(const Campaign& campaign, const VariedIndex& index,
                                           int run, const Residuals& at) {
  std::vector<ResidualColumns> columns;
  for (std::size_t v = 0; v < index.variables.size(); ++v) {
    const ArrayXd& x = index.values[v][static_cast<std::size_t>(run)];
    const std::array<ArrayXd, 3> legendre{x, 1.5 * x.square() - 0.5, 2.5 * x.cube() - 1.5 * x};
    for (std::size_t injection = 0; injection < kActsOn.size(); ++injection) {
      const bool counts = sensible(campaign, index.variables[v]->name, injection);
      for (const ArrayXd& p : legendre) {
        // A column all the same, its place is counted.
        columns.push_back(counts ? propagate(campaign, at, injected(injection, p, at))
                                 : ResidualColumns{});
      }
    }
  }
  return columns;
}

// Root mean square of the fitted polynomial over all valid samples.
double size_of(const Campaign& campaign, const std::vector<ArrayXd>& values,
               const Eigen::Vector3d& step) {
  double squares = 0.0, samples = 0.0;
  for (std::size_t e = 0; e < campaign.runs.size(); ++e) {
    const ExperimentData& run = campaign.runs[e];
    for (int k = 0; k < run.size(); ++k) {
      if (!run.valid[static_cast<std::size_t>(k)]) continue;
      const double x = values[e][k];
      const double y =
          step[0] * x + step[1] * (1.5 * x * x - 0.5) + step[2] * (2.5 * x * x * x - 1.5 * x);
      squares += y * y;
      samples += 1.0;
    }
  }
  return std::sqrt(squares / std::max(samples, 1.0));
}

// The three columns of a group beside the parameters: which of all columns, and their prior.
struct GroupColumns {
  std::vector<int> columns;
  Prior prior;
};

class GroupScores {
 public:
  GroupScores(const Engine& engine, const VariedIndex& index);
  // Nothing where the machine's constants could as well be it.
  std::optional<UnknownGroup> score(std::size_t v, std::size_t injection);

 private:
  GroupColumns group(std::size_t v, std::size_t injection) const;
  // What is known of the group's three by themselves, with the scatter between experiments counted
  // or not.
  MatrixXd information(const GroupColumns& group, const Fit& fit, bool is_scatter_counted) const;
  // The share of a direction of the group that the machine's constants, whatever their usual
  // values, could not as well be.
  double own_share(const GroupColumns& group, const VectorXd& direction) const;
  std::vector<double> accepted_chi2(const Fit& fit) const;

  const Engine& engine_;
  const VariedIndex& index_;
  std::vector<int> parameters_;
  Index n_;
  std::vector<Summary> summaries_;
  std::vector<int> base_;
  Prior base_prior_;
  Fit none_;
  std::optional<double> none_left_out_;
};

GroupScores::GroupScores(const Engine& engine, const VariedIndex& index)
    : engine_(engine),
      index_(index),
      parameters_(engine.with_nuisances(engine.accepted())),
      n_(static_cast<Index>(parameters_.size())),
      summaries_(engine.used().size()),
      base_(parameters_.size()) {
  const Campaign& campaign = engine.campaign();
  const ExtraColumns extra = [&](int run, const Residuals& at) {
    return group_columns(campaign, index, run, at);
  };
  VectorXd scales(n_);
  for (Index j = 0; j < n_; ++j) scales[j] = engine.scale(parameters_[static_cast<std::size_t>(j)]);
  in_parallel(engine.jobs(), summaries_.size(), [&](std::size_t i) {
    summaries_[i] = summarise(campaign, engine.used()[i], engine.state(), parameters_, scales,
                              engine.whitening(), extra);
  });
  engine.add_curve_bounds(engine.state(), parameters_, summaries_);
  std::iota(base_.begin(), base_.end(), 0);
  base_prior_ = engine.prior(parameters_, engine.state());
  none_ = fit_linear(summaries_, base_, base_prior_, engine.first_scatter(), 15);
}

GroupColumns GroupScores::group(std::size_t v, std::size_t injection) const {
  const int first = static_cast<int>(n_) + static_cast<int>(v * kPerVariable + injection * 3);
  GroupColumns out{base_, base_prior_};
  out.prior.pull.conservativeResize(n_ + 3);
  out.prior.precision.conservativeResize(n_ + 3);
  for (int i = 0; i < 3; ++i) {
    out.columns.push_back(first + i);
    out.prior.pull[n_ + i] = 0.0;
    out.prior.precision[n_ + i] = 1.0 / 9.0;
  }
  return out;
}

MatrixXd GroupScores::information(const GroupColumns& group, const Fit& fit,
                                  bool is_scatter_counted) const {
  MatrixXd total = MatrixXd::Zero(n_ + 3, n_ + 3);
  for (const Summary& each : summaries_) {
    total += each.aa(group.columns, group.columns);
    if (!is_scatter_counted) continue;
    const MatrixXd ua = each.ua(Eigen::all, group.columns);
    const MatrixXd inverse = (1.0 / fit.scatter.variance).matrix().asDiagonal();
    total -= ua.transpose() * solved_llt(each.uu + inverse, ua);
  }
  for (Index j = 0; j < n_; ++j) total(j, j) += base_prior_.precision[j];
  const MatrixXd cross = total.topRightCorner(n_, 3);
  return total.bottomRightCorner(3, 3) -
         cross.transpose() * solved_ldlt(total.topLeftCorner(n_, n_), cross);
}

double GroupScores::own_share(const GroupColumns& group, const VectorXd& direction) const {
  MatrixXd plain = MatrixXd::Zero(n_ + 3, n_ + 3);
  for (const Summary& each : summaries_) plain += each.aa(group.columns, group.columns);
  for (Index j = 0; j < n_; ++j) plain(j, j) += kAnyConstant;
  const VectorXd mixed = plain.topRightCorner(n_, 3) * direction;
  const double energy = direction.dot(plain.bottomRightCorner(3, 3) * direction);
  return (energy - mixed.dot(solved_ldlt(plain.topLeftCorner(n_, n_), mixed))) / energy;
}

std::vector<double> GroupScores::accepted_chi2(const Fit& fit) const {
  std::vector<double> out;
  for (std::size_t i = 0; i < engine_.accepted().size(); ++i) {
    const auto j = static_cast<Index>(engine_.active_nuisances().size() + i);
    const int slot = engine_.accepted()[i];
    const double size =
        engine_.state().effects[slot] / engine_.scale(kNuisanceCount + slot) + fit.step[j];
    out.push_back(size * size / std::max(fit.covariance(j, j), 1e-300));
  }
  return out;
}

std::optional<UnknownGroup> GroupScores::score(std::size_t v, std::size_t injection) {
  const GroupColumns columns = group(v, injection);
  const Fit fit = fit_linear(summaries_, columns.columns, columns.prior, none_.scatter, 8);
  UnknownGroup out;
  out.acts_on = kActsOn[injection];
  out.depends_on = index_.variables[v]->name;
  out.gain = 2.0 * (fit.log_likelihood - none_.log_likelihood);
  out.share = none_.misfit > 0.0 ? (none_.misfit - fit.misfit) / none_.misfit : 0.0;
  const VectorXd value = fit.step.tail(3);
  const MatrixXd covariance = fit.covariance.bottomRightCorner(3, 3);
  const double wald = value.dot(solved_ldlt(covariance, value));
  const VectorXd direction = value / std::max(value.norm(), 1e-30);
  const double own = own_share(columns, direction);
  if (own < kOwnShareMin) return std::nullopt;
  // What fits no better and only spares the machine's constants their way explains nothing.
  if (out.share <= 0.0 || parts_experiments(none_.scatter, fit.scatter)) return std::nullopt;
  // Its rest alone is seen; what they imitate is whatever fits best.
  out.size = size_of(engine_.campaign(), index_.values[v], value) * kUnit[injection] /
             kMatters[injection] * std::sqrt(std::min(own, 1.0));
  // Each direction of the group by its own mix of evidence within and between experiments.
  const MatrixXd with = information(columns, fit, true);
  const MatrixXd without = information(columns, fit, false);
  const double degrees =
      engine_.degrees(direction.dot(with * direction), direction.dot(without * direction));
  out.chi2 = chi2_of_f(wald / 3.0, 3.0, degrees);
  out.accepted_chi2 = accepted_chi2(fit);
  if (out.chi2 > kLooked && out.gain > kLooked && out.size > 1.0) {
    if (!none_left_out_)
      none_left_out_ = left_out_density(summaries_, base_, base_prior_, engine_.first_scatter());
    out.left_out_gain =
        left_out_density(summaries_, columns.columns, columns.prior, engine_.first_scatter()) -
        none_left_out_.value_or(0.0);
  }
  return out;
}

}  // namespace

std::vector<UnknownGroup> score_groups(const Engine& engine) {
  const VariedIndex index = varied_index(engine.campaign());
  std::vector<UnknownGroup> out;
  if (index.variables.empty()) return out;
  GroupScores scores(engine, index);
  for (std::size_t v = 0; v < index.variables.size(); ++v) {
    for (std::size_t injection = 0; injection < kActsOn.size(); ++injection) {
      if (!sensible(engine.campaign(), index.variables[v]->name, injection)) continue;
      if (auto group = scores.score(v, injection)) out.push_back(std::move(*group));
    }
  }
  std::sort(out.begin(), out.end(),
            [](const UnknownGroup& a, const UnknownGroup& b) { return a.gain > b.gain; });
  return out;
}

}  // namespace beltgrip::diagnose
