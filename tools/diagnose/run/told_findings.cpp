#include "tools/diagnose/run/told_findings.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <string_view>

#include "estimator/statistics/distributions.h"
#include "estimator/statistics/interval.h"
#include "tools/diagnose/infer/uncertainty.h"
#include "tools/diagnose/run/shown_gain.h"

namespace beltgrip::diagnose {
namespace {

constexpr double kAbsorbed = 0.99;  // chosen, of a column: a constant by another name

double quantile_975(double degrees) {
  double low = 0.0, high = 100.0;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (estimator::student_p(middle, degrees) > 0.05 ? low : high) = middle;
  }
  return low;
}

// Causes outside the table that do the same. Friction stands beside the clamp force in all that a
// ramp shows, and beside the torque where none is recorded behind the belt.
void add_twins(const Campaign& campaign, Finding& finding, const EffectRow& row) {
  if (row.stage != Stage::kFriction) return;
  if (row.depends_on != "oil_temperature" && row.depends_on != "primary_speed" &&
      row.depends_on != "ratio") {
    return;
  }
  const bool is_alone = finding.aliases.empty();
  const std::string over = " over " + std::string(row.depends_on);
  if (!campaign.has_balance) finding.aliases.push_back("learned torque_gain" + over);
  finding.aliases.push_back("learned clamp_force" + over);
  if (!is_alone) return;
  finding.separate_by =
      campaign.has_balance
          ? "a reference gauge of the secondary pressure where the " +
                std::string(row.depends_on == "oil_temperature" ? "oil"
                            : row.depends_on == "ratio"         ? "ratio"
                                                                : "speed") +
                " differs"
          : "record secondary_torque: a gain of the torque shows there, friction does not; and a "
            "reference gauge of the secondary pressure";
}

}  // namespace

void nothing_identifiable(const std::string& reason, Diagnosis& out) {
  std::string last;
  for (const EffectRow& row : effect_rows()) {
    if (row.id == last) continue;
    last = row.id;
    out.not_identifiable.push_back({std::string(row.id), {}, reason});
  }
}

void fill_learned(const Engine& engine, const Naming& naming, const Learning& learning,
                  const Gain& gain, Diagnosis& out) {
  for (const Learned& each : learning.terms) {
    const LearnedFit& fit = each.fit;
    LearnedFinding found;
    const std::string role = role_of(engine.campaign(), *fit.cell.abscissa.variable);
    found.acts_on = fit.cell.injection->acts_on;
    found.depends_on = {role};
    found.name = found.acts_on + "_over_" + role;
    found.aliases = each.aliases;
    const std::vector<LawEvidence> laws = possible_laws(fit);
    for (const LawEvidence& law : laws) found.laws.emplace_back(law.name);
    if (const LawEvidence* law = named_law(fit, laws)) found.law = law->text;
    found.levels = fit.cell.abscissa.levels;
    found.box[role] = {fit.cell.abscissa.low, fit.cell.abscissa.high};
    const double unit = fit.cell.injection->unit;
    for (std::size_t i = 0; i < fit.term.count; ++i) {
      found.knots.push_back(fit.term.knot[i]);
      found.values.push_back(fit.term.value[i]);
      for (std::size_t j = 0; j < fit.term.count; ++j) {
        found.covariance.push_back(
            unit * unit *
            fit.cell.covariance(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)));
      }
    }
    found.gain = gain.signals;
    if (gain.mu_max) found.gain["mu_max"] = change_of(*gain.mu_max);
    const Gain at_left_out = left_out_gain(engine, naming.nominal, fit.folds, fit.is_inner);
    if (const auto shown = shown_by(at_left_out, found.acts_on)) {
      found.metric = shown->metric;
      found.at_left_out_values = shown->change;
    }
    out.learned.push_back(std::move(found));
  }
}

void fill_findings(const Engine& engine, const std::vector<Accepted>& accepted,
                   const Naming& naming, const Gain& gain, Diagnosis& out) {
  const Campaign& campaign = engine.campaign();
  for (const Accepted& each : accepted) {
    const Slot& slot = campaign.slots[static_cast<std::size_t>(each.slot)];
    const auto& h = naming.hypothesis;
    const double value = h.state.effects[each.slot];
    // How far the sensors' own gain goes stands in no covariance once it has come to its bound.
    const double stated = slot.row->id == "torque_gain" && campaign.has_balance
                              ? campaign.nuisances[kSecondaryTorqueGain].tolerance
                              : 0.0;
    const double half =
        std::hypot(quantile_975(each.degrees) * each.sigma, estimator::kNormal95 * stated);
    const auto found = std::find_if(out.findings.begin(), out.findings.end(),
                                    [&](const Finding& f) { return f.effect == slot.row->id; });
    Finding& finding = found == out.findings.end() ? out.findings.emplace_back() : *found;
    finding.effect = slot.row->id;
    finding.probability = std::max(finding.probability, each.probability);
    finding.stability = std::min(finding.stability.value_or(1.0), each.stability);
    finding.separate_by = slot.row->separating;
    finding.equation = slot.row->equation;
    finding.acts_on = slot.row->acts_on;
    finding.role = slot.role;
    if (slot.counts_experiments()) {
      finding.fixed["at"] = slot.index;
      const std::string& path = campaign.runs[static_cast<std::size_t>(slot.index)].name;
      finding.from_file = path.substr(path.rfind('/') + 1);
    }
    const double a = slot.to_contract(value - half, h.state.nuisance);
    const double b = slot.to_contract(value + half, h.state.nuisance);
    finding.parameters[std::string(slot.row->parameter)] = {
        slot.to_contract(value, h.state.nuisance), std::min(a, b), std::max(a, b)};
    for (const int alias : each.aliases) {
      const std::string id(campaign.slots[static_cast<std::size_t>(alias)].row->id);
      if (id != finding.effect &&
          std::find(finding.aliases.begin(), finding.aliases.end(), id) == finding.aliases.end()) {
        finding.aliases.push_back(id);
      }
    }
    if (finding.effect == "torque_delay" && finding.aliases.empty()) {
      finding.aliases.emplace_back("channel_skew");  // of the torque: the same thing
    }
    add_twins(campaign, finding, *slot.row);
    finding.gain = gain.signals;
    if (gain.mu_max) {  // relative error of the friction at the peak
      finding.gain["mu_max"] = {gain.mu_max->before, gain.mu_max->after, gain.mu_max->low,
                                gain.mu_max->high};
    }
  }
  for (const Ripple& ripple : naming.ripples) {
    if (!ripple.found) continue;
    const auto found = std::find_if(out.findings.begin(), out.findings.end(),
                                    [](const Finding& f) { return f.effect == "speed_ripple"; });
    Finding& finding = found == out.findings.end() ? out.findings.emplace_back() : *found;
    finding.effect = "speed_ripple";
    finding.probability = 1.0;
    finding.equation = "omega_measured = omega_true (1 + a sin(phi + phi0))";
    finding.acts_on = "speed";
    finding.parameters[ripple.shaft] = {ripple.amplitude,
                                        ripple.amplitude - estimator::kNormal95 * ripple.sigma,
                                        ripple.amplitude + estimator::kNormal95 * ripple.sigma};
  }
  for (Finding& finding : out.findings) {
    if (finding.aliases.empty()) finding.separate_by.clear();
  }
}

void fill_not_identifiable(const Engine& engine, const Naming& naming, Diagnosis& out) {
  const Campaign& campaign = engine.campaign();
  std::map<std::string, std::map<std::string, double>> smallest;
  std::map<std::string, bool> visible;
  std::map<std::string, double> absorbed;
  for (const Score& score : naming.last_screen) {
    const Slot& slot = campaign.slots[static_cast<std::size_t>(score.slot)];
    const std::string id(slot.row->id), parameter(slot.row->parameter);
    visible.try_emplace(id, false);
    if (!(score.in_curve < kInCurveMax)) continue;
    const double size =
        score.sigma > 0.0 ? kDetectable * score.sigma : std::numeric_limits<double>::infinity();
    auto& known = smallest[id];
    if (!known.contains(parameter) || size < known[parameter]) known[parameter] = size;
    visible[id] |= is_seen(score, slot);
    absorbed[id] = std::max(absorbed[id], score.absorbed);
  }
  const auto named = [&](std::string_view id) {
    return std::any_of(naming.accepted.begin(), naming.accepted.end(), [&](const Accepted& each) {
      return campaign.slots[static_cast<std::size_t>(each.slot)].row->id == id;
    });
  };
  for (const EffectRow& row : effect_rows()) {
    const std::string id(row.id);
    const std::vector<NotIdentifiable>& told = out.not_identifiable;
    const bool again = !told.empty() && told.back().effect == id;  // another parameter of it
    if (visible.contains(id) || named(id) || again || row.apply == nullptr) continue;
    out.not_identifiable.push_back({id, {}, "no signal in these data shows it"});
  }
  for (const auto& [id, seen] : visible) {
    if (seen || named(id)) continue;
    out.not_identifiable.push_back(
        {id, smallest[id],
         smallest[id].empty() ? "no other thing here than a friction curve that runs otherwise"
         : absorbed[id] > kAbsorbed ? "absorbed by a fitted constant of the machine"
                                    : "the experiments hardly move what it depends on"});
  }
}

}  // namespace beltgrip::diagnose
