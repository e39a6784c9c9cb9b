#include "tests/statistics/blind/blind_trial.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <ctime>

#include "tools/diagnose/decide/namer.h"
#include "tools/diagnose/infer/gain.h"

namespace beltgrip::blind {
namespace {

using diagnose::Engine;
using nlohmann::json;

constexpr const char* kKinds[] = {"nothing", "single", "pair", "unknown", "stress"};

double processor_s() {
  return static_cast<double>(std::clock()) / static_cast<double>(CLOCKS_PER_SEC);
}

// The slot that carries a planted parameter; -1: none.
int slot_of(const diagnose::Campaign& campaign, const Planted& planted, const std::string& name) {
  for (std::size_t i = 0; i < campaign.slots.size(); ++i) {
    const diagnose::Slot& slot = campaign.slots[i];
    if (slot.row->id != planted.effect || slot.row->parameter != name) continue;
    if (slot.counts_experiments() && slot.index != planted.parameters.at("at")) continue;
    if (!planted.role.empty() && slot.role != planted.role) continue;
    return static_cast<int>(i);
  }
  return -1;
}

// Information of the data on every slot, the machine's constants and the scatter taken out.
Eigen::MatrixXd information(const Engine& engine, const diagnose::Scatter& scatter) {
  const auto nuisances = static_cast<Eigen::Index>(engine.active_nuisances().size());
  // Behind the slots stand columns of sizes far from zero.
  const auto slots = static_cast<Eigen::Index>(engine.campaign().slots.size());
  const Eigen::Index all = nuisances + slots;
  Eigen::MatrixXd total = Eigen::MatrixXd::Zero(all, all);
  const Eigen::MatrixXd inverse = (1.0 / scatter.variance).matrix().asDiagonal();
  for (const diagnose::Summary& each : engine.summaries()) {
    const Eigen::MatrixXd ua = each.ua.leftCols(all);
    total += each.aa.topLeftCorner(all, all) - ua.transpose() * (each.uu + inverse).llt().solve(ua);
  }
  for (Eigen::Index j = 0; j < nuisances; ++j) total(j, j) += 1.0;
  const Eigen::MatrixXd cross = total.topRightCorner(nuisances, slots);
  return total.bottomRightCorner(slots, slots) -
         cross.transpose() * total.topLeftCorner(nuisances, nuisances).ldlt().solve(cross);
}

// Share of draws in which a classifier with the same information names the effect.
double oracle(const diagnose::Campaign& campaign, const Eigen::MatrixXd& m, int truth, double size,
              double threshold, Random& random) {
  const Eigen::Index n = m.rows();
  Eigen::MatrixXd root = m;
  root.diagonal().array() += 1e-9 * m.diagonal().maxCoeff();
  const Eigen::LLT<Eigen::MatrixXd> llt(root);
  if (llt.info() != Eigen::Success) return -1.0;
  constexpr int kDraws = 200;
  int right = 0;
  for (int i = 0; i < kDraws; ++i) {
    Eigen::VectorXd z(n);
    for (Eigen::Index j = 0; j < n; ++j) z[j] = random.normal();
    const Eigen::VectorXd b = m.col(truth) * size + llt.matrixL() * z;
    Eigen::Index best = 0;
    double top = -1.0;
    for (Eigen::Index j = 0; j < n; ++j) {
      if (m(j, j) < 1e-6) continue;
      const double gain = b[j] * b[j] / m(j, j);
      if (gain > top) top = gain, best = j;
    }
    right += top > threshold && campaign.slots[static_cast<std::size_t>(best)].row->id ==
                                    campaign.slots[static_cast<std::size_t>(truth)].row->id;
  }
  return static_cast<double>(right) / kDraws;
}

// The rivals: white noise, no scatter, no left-out experiments.
json rivals(const Engine& engine, const diagnose::ModelState& nominal) {
  const diagnose::Campaign& campaign = engine.campaign();
  std::vector<int> slots(campaign.slots.size());
  for (std::size_t i = 0; i < slots.size(); ++i) slots[i] = static_cast<int>(i);
  const std::vector<int> parameters = engine.with_nuisances(slots);
  Eigen::VectorXd scale(static_cast<Eigen::Index>(parameters.size()));
  for (Eigen::Index j = 0; j < scale.size(); ++j) {
    scale[j] = engine.scale(parameters[static_cast<std::size_t>(j)]);
  }
  diagnose::Summary sum;
  const diagnose::Whitening white = diagnose::identity_whitening(campaign);
  for (std::size_t e = 0; e < campaign.runs.size(); ++e) {
    if (campaign.runs[e].valid_count == 0) continue;
    const diagnose::Summary each =
        diagnose::summarise(campaign, static_cast<int>(e), nominal, parameters, scale, white);
    if (sum.samples == 0) {
      sum = each;
    } else {
      sum.aa += each.aa;
      sum.samples += each.samples;
    }
  }
  const auto nuisances = static_cast<Eigen::Index>(engine.active_nuisances().size());
  const Eigen::Index last = sum.aa.rows() - 1;
  double correlation = 0.0, gain = 0.0;
  std::size_t by_correlation = 0, by_error = 0;
  const double power = sum.aa(last, last);
  Eigen::MatrixXd base = sum.aa.topLeftCorner(nuisances, nuisances);
  base.diagonal().array() += 1.0;
  const Eigen::LDLT<Eigen::MatrixXd> ldlt(base);
  const Eigen::VectorXd right = sum.aa.col(last).head(nuisances);
  for (std::size_t i = 0; i < slots.size(); ++i) {
    const Eigen::Index j = nuisances + static_cast<Eigen::Index>(i);
    const double own = sum.aa(j, j);
    if (own <= 0.0) continue;
    const double c = std::abs(sum.aa(j, last)) / std::sqrt(own * power);
    if (c > correlation) correlation = c, by_correlation = i;
    const Eigen::VectorXd cross = sum.aa.col(j).head(nuisances);
    const Eigen::VectorXd solved = ldlt.solve(cross);
    const double rest = own - cross.dot(solved);
    if (rest < 1e-6 * own) continue;
    const double b = sum.aa(j, last) - right.dot(solved);
    if (b * b / rest > gain) gain = b * b / rest, by_error = i;
  }
  const double scaled = gain / (power / sum.samples);
  return {
      {"correlation", correlation > 0.1 ? std::string(campaign.slots[by_correlation].row->id) : ""},
      {"error",
       scaled > std::log(sum.samples) ? std::string(campaign.slots[by_error].row->id) : ""}};
}

}  // namespace

Envelope draw_envelope(std::uint64_t number) {
  Random random(number * 2654435761ULL + 12345ULL);
  Envelope out;
  const double which = random.uniform();
  out.kind = which < 0.25   ? Kind::kNothing
             : which < 0.70 ? Kind::kSingle
             : which < 0.80 ? Kind::kPair
             : which < 0.95 ? Kind::kUnknown
                            : Kind::kStress;
  Trial& trial = out.trial;
  trial.seed = number;
  trial.machine = draw_machine(random);
  trial.plan =
      random.uniform() < 0.9 ? draw_plan(random, trial.machine.setting, 12) : paper_plan(8);
  if (out.kind == Kind::kStress) {
    trial.machine.heavy_tails = true;
    trial.machine.scatter_friction *= 2.0;
    trial.plan.resize(7);
  }
  Random later(~number);
  const auto effect = [&] {
    // One draw a line: compilers differ in the order of a call's arguments.
    const double size = random.log_uniform(0.25, 2.5);
    const auto& all = plantables();
    const int count = static_cast<int>(all.size());
    // What came to the list later is drawn from a stream of its own: the other trials stay.
    int which_one = random.below(count - kLaterPlantables);
    if (later.below(count) < kLaterPlantables) {
      which_one = count - 1 - later.below(kLaterPlantables);
    }
    return draw_effect(random, all[static_cast<std::size_t>(which_one)], size);
  };
  if (out.kind == Kind::kSingle || out.kind == Kind::kPair) trial.planted.push_back(effect());
  while (out.kind == Kind::kPair && trial.planted.size() < 2) {
    const Planted second = effect();
    if (second.effect != trial.planted[0].effect) trial.planted.push_back(second);
  }
  if (out.kind == Kind::kUnknown) {
    const double size = random.log_uniform(0.5, 2.5);
    const auto& all = outside_causes();
    const int which_one = random.below(static_cast<int>(all.size()));
    trial.planted.push_back(draw_outside(random, all[static_cast<std::size_t>(which_one)], size));
  }
  return out;
}

json run_trial(std::uint64_t number) {
  const Envelope envelope = draw_envelope(number);
  const Recording recording = record(envelope.trial);

  // The tool: nothing but the texts and the configuration's inertia goes in.
  const double begin_s = processor_s();
  estimator::VariatorParameters variator;
  variator.primary_inertia_kg_m2 = 0.18;
  std::vector<diagnose::ExperimentData> runs;
  for (std::size_t i = 0; i < recording.csv.size(); ++i) {
    runs.push_back(diagnose::prepare(
        diagnose::parse_csv(recording.csv[i], "run" + std::to_string(i + 1) + ".csv"), variator));
  }
  Engine engine(diagnose::make_campaign(std::move(runs), diagnose::nominal_model(variator)));
  const diagnose::Campaign& campaign = engine.campaign();
  const diagnose::Naming naming = diagnose::name_effects(engine, [] { return false; });
  const diagnose::ModelState& state = naming.hypothesis.state;
  std::vector<int> slots;
  for (const auto& each : naming.accepted) slots.push_back(each.slot);
  const diagnose::Gain gain = diagnose::left_out_gain(engine, naming.nominal, state, slots);
  const double tool_s = processor_s() - begin_s;

  json out{{"trial", number},
           {"kind", kKinds[static_cast<int>(envelope.kind)]},
           {"setting", static_cast<int>(envelope.trial.machine.setting)},
           {"law", static_cast<int>(envelope.trial.machine.law)},
           {"runs", envelope.trial.plan.size()},
           {"paper_plan", envelope.trial.plan.size() == 8},
           {"tool_s", tool_s}};
  // The answer.
  json findings = json::array();
  for (const auto& each : naming.accepted) {
    const diagnose::Slot& slot = campaign.slots[static_cast<std::size_t>(each.slot)];
    json finding{{"effect", slot.row->id},
                 {"slot", slot.label()},
                 {"value", state.effects[each.slot]},
                 {"sigma", each.sigma},
                 {"degrees", each.degrees},
                 {"chi2", each.chi2},
                 {"probability", each.probability},
                 {"left_out", each.left_out_gain}};
    json aliases = json::array();
    for (const int alias : each.aliases) {
      aliases.push_back(campaign.slots[static_cast<std::size_t>(alias)].row->id);
    }
    finding["aliases"] = aliases;
    findings.push_back(finding);
  }
  out["findings"] = findings;
  for (const auto& each : naming.ripples) {
    if (!each.found) continue;
    out["findings"].push_back({{"effect", "speed_ripple"},
                               {"slot", "speed_ripple." + each.shaft},
                               {"value", each.amplitude},
                               {"sigma", each.sigma},
                               {"degrees", 1e6},
                               {"chi2", each.chi2},
                               {"probability", 1.0},
                               {"aliases", json::array()}});
  }
  if (naming.unknown) {
    out["unknown"] = {{"acts_on", naming.unknown->acts_on},
                      {"depends_on", naming.unknown->depends_on},
                      {"chi2", naming.unknown->chi2},
                      {"size", naming.unknown->size}};
  }
  json not_confirmed = json::array();
  for (const int slot : naming.not_confirmed) {
    not_confirmed.push_back(campaign.slots[static_cast<std::size_t>(slot)].label());
  }
  out["not_confirmed"] = not_confirmed;
  out["gain"] = json::object();
  for (const auto& [name, value] : gain.signals)
    out["gain"][name] = {value.before, value.after, value.low};

  // The envelope is opened.
  Random random(number);
  json truth = json::array();
  std::vector<int> true_slots;
  diagnose::ModelState true_sizes = naming.nominal.state;
  const Eigen::MatrixXd m = information(engine, naming.hypothesis.fit.scatter);
  for (const Planted& planted : envelope.trial.planted) {
    for (const auto& [name, value] : planted.parameters) {
      if (name == "at") continue;
      json each{{"effect", planted.effect}, {"parameter", name}, {"value", value}};
      if (!planted.role.empty()) each["role"] = planted.role;
      if (const int slot = slot_of(campaign, planted, name); slot >= 0) {
        const double size = value / campaign.slots[static_cast<std::size_t>(slot)].row->typical;
        true_slots.push_back(slot);
        true_sizes.effects[slot] = value;
        each["slot"] = campaign.slots[static_cast<std::size_t>(slot)].label();
        each["d"] = std::abs(size) * std::sqrt(std::max(m(slot, slot), 0.0));
        each["oracle"] = oracle(campaign, m, slot, size, naming.threshold, random);
      }
      if (planted.effect == "speed_ripple") {
        for (const auto& ripple : naming.ripples) {
          if (ripple.shaft != name) continue;
          each["slot"] = "speed_ripple." + name;
          each["d"] = std::sqrt(ripple.chi2);
          each["oracle"] = ripple.chi2 > 100.0 ? 1.0 : 0.0;
        }
      }
      truth.push_back(each);
    }
  }
  out["truth"] = truth;
  // What the true structure removes when it is fitted: the error that can be removed.
  out["removable"] = json::object();
  if (!true_slots.empty() && true_slots.size() == truth.size()) {
    engine.accept(engine.refine_from(true_sizes, true_slots, 20));
    for (const auto& [name, value] :
         diagnose::left_out_gain(engine, naming.nominal, engine.state(), true_slots).signals) {
      out["removable"][name] = {value.before, value.after, value.low};
    }
  }
  out["rivals"] = rivals(engine, naming.nominal.state);
  json left = json::array();
  auto scores = naming.last_screen;
  std::sort(scores.begin(), scores.end(), [](auto& a, auto& b) { return a.chi2 > b.chi2; });
  for (std::size_t i = 0; i < 3 && i < scores.size(); ++i) {
    left.push_back(
        {campaign.slots[static_cast<std::size_t>(scores[i].slot)].label(), scores[i].chi2});
  }
  out["left"] = left;
  return out;
}

}  // namespace beltgrip::blind
