#include "tools/diagnose/report/finding_picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "tools/diagnose/infer/cell_columns.h"
#include "tools/diagnose/infer/index_variables.h"
#include "tools/diagnose/model/effects/effect.h"
#include "tools/diagnose/report/finding_words.h"

namespace beltgrip::diagnose {
namespace {

using Eigen::ArrayXd;
using report::Series;

constexpr std::size_t kPoints = 30;    // about, each of as many samples
constexpr double kInformative = 1e-3;  // of the best point: less says nothing of the effect

// Where a finding acts: what one unit there changes, and how it is shown.
struct Point {
  std::string_view acts_on;
  const char* label;
  double (*shown)(double of_unit);
  QuantityChange (*unit)(const Residuals& at, const Eigen::VectorXd& nuisance);
};

QuantityChange of_torque(const Residuals& at, const Eigen::VectorXd& /*nuisance*/) {
  QuantityChange out;
  out.torque = ArrayXd::Constant(at.foot.size(), -1.0);
  out.balance = out.torque;
  return out;
}
QuantityChange of_secondary_torque(const Residuals& at, const Eigen::VectorXd& /*nuisance*/) {
  QuantityChange out;
  out.balance = -at.measured.ratio;
  return out;
}
// With what the pulleys give way to it and what it takes of the torque.
QuantityChange of_force(const Residuals& at, const Eigen::VectorXd& nuisance) {
  constexpr double kPerN = 1e-3;  // of what is given per kN
  QuantityChange out;
  out.ln_capacity = 1.0 / at.measured.force_N.max(50.0);
  const ArrayXd deformation =
      kPerN * nuisance[kDeformationPerkN] +
      2.0 * kPerN * kPerN * nuisance[kDeformationPerkN2] * at.measured.force_N;
  out.slip_share = -deformation * (1.0 - at.measured.slip_share) / (1.0 - at.measured.deformation);
  out.torque = ArrayXd::Constant(at.foot.size(), -kPerN * nuisance[kLossPerkN_Nm]);
  out.balance = out.torque;
  if (at.measured.balance.size() > 0) {
    out.balance -=
        at.clean_Nm * out.slip_share + kPerN * nuisance[kSecondaryLossPerkN_Nm] * at.measured.ratio;
  }
  return out;
}
QuantityChange of_friction(const Residuals& at, const Eigen::VectorXd& /*nuisance*/) {
  QuantityChange out;
  out.ln_capacity = ArrayXd::Ones(at.foot.size());
  return out;
}
QuantityChange of_ratio(const Residuals& at, const Eigen::VectorXd& /*nuisance*/) {
  QuantityChange out;
  out.slip_share = 1.0 - at.measured.slip_share;
  if (at.measured.balance.size() > 0) out.balance = -at.clean_Nm;
  return out;
}

double as_it_is(double value) { return value; }
double percent_of_ln(double ln) { return 1e2 * std::expm1(ln); }
double per_mille(double share) { return 1e3 * share; }

constexpr std::array<Point, 6> kActsOn{{
    {"torque", "torque that the belt does not get, Nm", as_it_is, of_torque},
    {"secondary torque", "torque that the secondary shaft loses, Nm", as_it_is,
     of_secondary_torque},
    {"clamp force", "clamp force beyond the model's, N", as_it_is, of_force},
    {"friction", "friction beyond the model's, %", percent_of_ln, of_friction},
    {"ratio", "ratio beyond the model's, 1/1000", per_mille, of_ratio},
    {"speed", "speed ratio beyond the model's, 1/1000", per_mille, of_ratio},
}};

// What a finding may follow.
struct Variable {
  std::string_view name;
  const char* label;
  ArrayXd (*value)(const ExperimentData& run, int experiment);
};

ArrayXd primary_speed(const ExperimentData& run, int) { return run.omega_p.value; }
ArrayXd secondary_speed(const ExperimentData& run, int) { return run.omega_s.value; }
ArrayXd pressure_bar(const ExperimentData& run, int) { return 1e-5 * run.pressure.slow; }
ArrayXd pressure_rate(const ExperimentData& run, int) { return 1e-5 * run.pressure.slow_slope; }
ArrayXd torque(const ExperimentData& run, int) { return run.torque.slow; }
ArrayXd torque_rate(const ExperimentData& run, int) { return run.torque.slow_slope; }
ArrayXd acceleration(const ExperimentData& run, int) { return run.omega_p.slow_slope; }
ArrayXd secondary_acceleration(const ExperimentData& run, int) { return run.omega_s.slow_slope; }
ArrayXd oil(const ExperimentData& run, int) {
  return run.temperature.present ? run.temperature.value : ArrayXd();
}
ArrayXd primary_pressure(const ExperimentData& run, int) {
  return run.pressure_p.present ? ArrayXd(1e-5 * run.pressure_p.value) : ArrayXd();
}
ArrayXd speed_ratio(const ExperimentData& run, int) {
  return run.omega_s.value / run.omega_p.value;
}
ArrayXd time(const ExperimentData& run, int) { return run.t_s; }
ArrayXd count(const ExperimentData& run, int experiment) {
  return ArrayXd::Constant(run.size(), experiment + 1.0);
}

constexpr std::array<Variable, 14> kVariables{{
    {"primary_speed", "primary speed, rad/s", primary_speed},
    {"secondary_speed", "secondary speed, rad/s", secondary_speed},
    {"secondary_pressure", "secondary pressure, bar", pressure_bar},
    {"rate of secondary_pressure", "rate of the secondary pressure, bar/s", pressure_rate},
    {"direction of secondary_pressure", "rate of the secondary pressure, bar/s", pressure_rate},
    {"torque", "torque, Nm", torque},
    {"rate of torque", "rate of the torque, Nm/s", torque_rate},
    {"acceleration of primary_speed", "acceleration of the primary shaft, rad/s2", acceleration},
    {"acceleration of secondary_speed", "acceleration of the secondary shaft, rad/s2",
     secondary_acceleration},
    {"primary_pressure", "primary pressure, bar", primary_pressure},
    {"oil_temperature", "oil temperature, degC", oil},
    {"ratio", "speed ratio", speed_ratio},
    {"time", "time in the experiment, s", time},
    {"experiment", "experiment", count},
}};

// What a channel that comes late or early acts on and follows, of those that are shifted.
struct Shifted {
  std::string_view role, acts_on, depends_on;
};
constexpr std::array<Shifted, 3> kShifted{{
    {"primary_speed", "speed", "acceleration of primary_speed"},
    {"secondary_speed", "speed", "acceleration of secondary_speed"},
    {"secondary_pressure", "clamp force", "rate of secondary_pressure"},
}};

// Of a finding, as the table of effects says it or, where that differs by channel, the one above.
struct Place {
  std::string_view acts_on, depends_on;
};
Place place_of(const Slot& slot) {
  const auto shifted = std::find_if(kShifted.begin(), kShifted.end(), [&](const Shifted& each) {
    return slot.row->id == "channel_skew" && each.role == slot.role;
  });
  if (shifted != kShifted.end()) return {shifted->acts_on, shifted->depends_on};
  return {slot.row->acts_on, slot.row->depends_on};
}

const Variable* variable_of(const Place& place) {
  const auto named = [](std::string_view name) {
    const auto found = std::find_if(kVariables.begin(), kVariables.end(),
                                    [&](const Variable& each) { return each.name == name; });
    return found == kVariables.end() ? nullptr : &*found;
  };
  // What follows nothing is as large everywhere: shown over what it is added to.
  if (place.depends_on != "nothing") return named(place.depends_on);
  return named(place.acts_on == "clamp force" ? "secondary_pressure"
               : place.acts_on == "ratio"     ? "ratio"
                                              : "torque");
}

// One sample of one residual: place, what a unit at the point changes, what the finding changes,
// and the residual that is left with it.
struct Sample {
  double x, column, by_finding, left;
};

// What a unit at the point and the finding change of the residuals of an experiment.
struct Changes {
  ResidualColumns unit, by_finding;
};

// Of both residuals what counts. changes(experiment, residuals with the finding, the variable).
template <typename ChangesOf>
std::vector<Sample> samples_of(const Campaign& campaign, const ModelState& extended,
                               ArrayXd (*variable)(const ExperimentData& run, int experiment),
                               const ChangesOf& changes_of) {
  std::vector<Sample> out;
  for (std::size_t e = 0; e < campaign.runs.size(); ++e) {
    const ExperimentData& run = campaign.runs[e];
    const int experiment = static_cast<int>(e);
    const ArrayXd x = variable(run, experiment);
    if (run.valid_count == 0 || x.size() == 0) continue;
    Residuals with = residuals_of(campaign, experiment, extended);
    prepare_derivatives(campaign, experiment, extended, with);
    const Changes changes = changes_of(experiment, with, x);
    for (const ResidualKind kind : {kFrictionResidual, kBalanceResidual}) {
      const auto k = static_cast<std::size_t>(kind);
      const ArrayXd &unit = changes.unit[k], &by = changes.by_finding[k];
      for (Eigen::Index i = 0; i < unit.size(); ++i) {
        if (!run.valid[static_cast<std::size_t>(i)] || unit[i] == 0.0) continue;
        const Sample each{x[i], unit[i], by.size() > 0 ? by[i] : 0.0, with.value[k][i]};
        if (std::isfinite(each.x + each.column + each.by_finding + each.left)) out.push_back(each);
      }
    }
  }
  return out;
}

std::vector<Sample> samples_of(const Campaign& campaign, const ModelState& extended, int slot,
                               const Point& point, const Variable& variable) {
  return samples_of(campaign, extended, variable.value,
                    [&](int experiment, const Residuals& with, const ArrayXd& /*x*/) {
                      Changes out{
                          propagate(campaign, with, point.unit(with, extended.nuisance)),
                          // Along the tangent of the friction curve, as the unit: about the peak,
                          // the residual without the finding says nothing of its size.
                          secant(campaign, experiment, extended, with, slot, 0.0)};
                      for (ArrayXd& each : out.by_finding) each *= extended.effects[slot];
                      return out;
                    });
}

// Of a function that was learned: a unit of its point, as it is met in practice.
std::vector<Sample> samples_of(const Campaign& campaign, const ModelState& extended,
                               const estimator::LearnedTerm& term, const InjectionRow& row,
                               const IndexVariable& variable) {
  return samples_of(campaign, extended, variable.value,
                    [&](int /*experiment*/, const Residuals& with, const ArrayXd& x) {
                      const ArrayXd units =
                          x.unaryExpr([&](double at) { return term.at(at) / row.unit; });
                      const auto change = [&](const ArrayXd& size) {
                        return propagate(campaign, with, unit_change(extended, with, row, size));
                      };
                      return Changes{change(ArrayXd::Ones(x.size())), change(units)};
                    });
}

// The sum over some neighbours by weighted least squares: what is asked for at the point.
struct Asked {
  double x = 0.0, by_finding = 0.0, left = 0.0, information = 0.0;
};

std::vector<Asked> asked_by(std::vector<Sample> samples) {
  std::stable_sort(samples.begin(), samples.end(),
                   [](const Sample& a, const Sample& b) { return a.x < b.x; });
  std::vector<Asked> out;
  if (samples.empty()) return out;
  const std::size_t most = std::max<std::size_t>(1, samples.size() / kPoints);
  const double widest = (samples.back().x - samples.front().x) / static_cast<double>(kPoints);
  for (std::size_t begin = 0, end = 0; begin < samples.size(); begin = end) {
    Asked sum;
    // As many as the others, but not over a gap.
    for (end = begin;
         end < samples.size() && end - begin < most && samples[end].x - samples[begin].x <= widest;
         ++end) {
      const Sample& each = samples[end];
      const double weight = each.column * each.column;
      sum.x += weight * each.x;
      sum.by_finding += each.column * each.by_finding;
      sum.left -= each.column * each.left;
      sum.information += weight;
    }
    sum.x /= sum.information;
    sum.by_finding /= sum.information;
    sum.left /= sum.information;
    out.push_back(sum);
  }
  double best = 0.0;
  for (const Asked& each : out) best = std::max(best, each.information);
  std::erase_if(out, [&](const Asked& each) { return each.information < kInformative * best; });
  return out;
}

// The interval of a size over the size; none where it is not a straight multiple.
std::optional<std::array<double, 2>> band_of(const Slot& slot,
                                             const std::vector<Finding>& findings) {
  for (const Finding& each : findings) {
    if (each.effect != slot.row->id || each.role != slot.role) continue;
    const auto found = each.parameters.find(std::string(slot.row->parameter));
    if (found == each.parameters.end() || found->second.value == 0.0) continue;
    if (slot.row->to_contract != nullptr) return std::nullopt;
    return std::array{found->second.low / found->second.value,
                      found->second.high / found->second.value};
  }
  return std::nullopt;
}

// What belongs to a finding of the answer; nothing where one of them is missing.
struct LearnedParts {
  const estimator::LearnedTerm* term = nullptr;
  const InjectionRow* row = nullptr;
  const IndexVariable* variable = nullptr;
};
std::optional<LearnedParts> parts_of(const LearnedFinding& learned, const ModelState& extended) {
  const auto role = estimator::learned_variable(learned.depends_on.front());
  const auto row =
      std::find_if(kInjections.begin(), kInjections.end(),
                   [&](const InjectionRow& each) { return each.acts_on == learned.acts_on; });
  const std::span<const IndexVariable> all = index_variables();
  const auto variable = std::find_if(all.begin(), all.end(), [&](const IndexVariable& each) {
    return each.learnable.has_value() && each.learnable == role;
  });
  const auto term = std::find_if(
      extended.learned.begin(), extended.learned.end(), [&](const estimator::LearnedTerm& each) {
        return each.variable == role &&
               estimator::kLearnedPoints[static_cast<std::size_t>(each.point)] == learned.acts_on;
      });
  if (row == kInjections.end() || variable == all.end() || term == extended.learned.end()) {
    return std::nullopt;
  }
  return LearnedParts{&*term, &*row, &*variable};
}

}  // namespace

std::vector<std::vector<Series>> points_of_learned(const Campaign& campaign,
                                                   const ModelState& extended,
                                                   const std::vector<LearnedFinding>& learned) {
  std::vector<std::vector<Series>> out;
  for (const LearnedFinding& each : learned) {
    Series before{"asked for by the data", {}, {}, false, false},
        after{"left with the finding", {}, {}, false, false};
    if (const auto parts = parts_of(each, extended)) {
      const auto& [term, row, variable] = *parts;
      for (const Asked& at : asked_by(samples_of(campaign, extended, *term, *row, *variable))) {
        before.x.push_back(at.x);
        after.x.push_back(at.x);
        before.y.push_back(row->unit * (at.by_finding + at.left));
        after.y.push_back(row->unit * at.left);
      }
    }
    out.push_back({std::move(before), std::move(after)});
  }
  return out;
}

std::vector<report::Chart> pictures_of(const Campaign& campaign, const ModelState& extended,
                                       const std::vector<Finding>& findings) {
  std::vector<report::Chart> out;
  for (std::size_t i = 0; i < campaign.slots.size(); ++i) {
    const Slot& slot = campaign.slots[i];
    if (extended.effects[static_cast<Eigen::Index>(i)] == 0.0) continue;
    const Place place = place_of(slot);
    const auto point = std::find_if(kActsOn.begin(), kActsOn.end(), [&](const Point& each) {
      return each.acts_on == place.acts_on;
    });
    const Variable* variable = variable_of(place);
    if (point == kActsOn.end() || variable == nullptr) continue;
    const std::vector<Asked> asked =
        asked_by(samples_of(campaign, extended, static_cast<int>(i), *point, *variable));
    if (asked.size() < 2) continue;
    Series law{"as found", {}, {}, true, false}, low{"", {}, {}, true, false, true},
        high{"95 %", {}, {}, true, false, true},
        before{"asked for by the data", {}, {}, false, false},
        after{"left with the finding", {}, {}, false, false};
    const auto band = band_of(slot, findings);
    for (const Asked& each : asked) {
      for (Series* series : {&law, &low, &high, &before, &after}) series->x.push_back(each.x);
      law.y.push_back(point->shown(each.by_finding));
      low.y.push_back(point->shown(each.by_finding * (band ? (*band)[0] : 1.0)));
      high.y.push_back(point->shown(each.by_finding * (band ? (*band)[1] : 1.0)));
      before.y.push_back(point->shown(each.by_finding + each.left));
      after.y.push_back(point->shown(each.left));
    }
    std::string title =
        words_of(slot.row->id, slot.row->parameter, extended.effects[static_cast<Eigen::Index>(i)]);
    if (slot.row->id == "channel_skew") title += ": " + std::string(slot.role);
    report::Chart chart{std::move(title), variable->label, point->label, {}};
    if (band) chart.series = {low, high};
    chart.series.insert(chart.series.end(), {law, before, after});
    out.push_back(std::move(chart));
  }
  return out;
}

}  // namespace beltgrip::diagnose
