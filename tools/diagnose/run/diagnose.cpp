#include "tools/diagnose/run/diagnose.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "estimator/physics/assumed_constants.h"
#include "estimator/statistics/distributions.h"
#include "tools/diagnose/data/baseline_tests.h"
#include "tools/diagnose/data/text_of.h"
#include "tools/diagnose/decide/criticism.h"
#include "tools/diagnose/decide/learn.h"
#include "tools/diagnose/decide/namer.h"
#include "tools/diagnose/decide/plausibility.h"
#include "tools/diagnose/infer/engine.h"
#include "tools/diagnose/infer/gain.h"
#include "tools/diagnose/infer/parallel.h"
#include "tools/diagnose/infer/residual_tests.h"
#include "tools/diagnose/run/next_experiment.h"
#include "tools/diagnose/run/search.h"
#include "tools/diagnose/run/told_findings.h"
#include "tools/diagnose/run/told_machine.h"

namespace beltgrip::diagnose {
namespace {

// Chosen: 10 s of usable data. A fifth less or more answers or refuses those of 8 to 12 s alone;
// the least of 300 campaigns of other make is 166 s.
constexpr int kSamplesMin = 100;

class Run {
 public:
  explicit Run(Request request) : request_(std::move(request)) {}

  Answer run() {
    answer_.extended = request_.model;
    std::vector<ExperimentData> runs;
    drop_copies(request_.experiments, implausible_);
    drop_copies_of(request_.experiments, request_.held_out, implausible_);
    std::vector<const SignalTable*> tables;
    tables.reserve(request_.experiments.size() + request_.held_out.size());
    for (const SignalTable& table : request_.experiments) tables.push_back(&table);
    for (const SignalTable& table : request_.held_out) tables.push_back(&table);
    sensors_ = sensors_of(tables);
    runs.resize(request_.experiments.size());
    in_parallel(request_.jobs, runs.size(), [&](std::size_t i) {
      runs[i] = prepare(request_.experiments[i], request_.model.variator, sensors_);
      // From here on the grid is all that counts; half of the memory that an hour takes.
      if (!request_.with_plots) request_.experiments[i] = {};
    });
    for (const ExperimentData& run : runs) {
      out().experiments += run.valid_count > 0 ? 1 : 0;
      out().samples += run.valid_count;
      for (const std::string& note : run.notes) out().notes.push_back(note);
      if (run.valid_count == 0) {
        out().notes.push_back(run.name + ": " + why_unusable(run));
      }
    }
    drop_uneven_channels(runs, implausible_);
    check_same_machine(runs, request_.model.variator, implausible_);
    check_torques(runs, implausible_);
    if (out().samples < kSamplesMin) {
      torques_are_impossible(implausible_);
      answer_.impossible = too_little();
      return std::move(answer_);
    }
    check_friction(runs, request_.model.variator, implausible_);
    note_assumed(runs);
    progress(0.1, "fit");
    const Campaign campaign = make_campaign(std::move(runs), request_.model, request_.accuracies);
    Found found =
        search(campaign, {request_.jobs, !implausible_.impossible && implausible_.torques.empty(),
                          stop(), [&] { progress(0.6, "tests"); }});
    Engine& engine = found.engine;
    const Naming& naming = found.naming;
    const Learning& learning = found.learning;
    progress(0.8, "gain");
    fill(engine, naming, learning);
    if (request_.with_plots) {
      answer_.plots = make_plots(engine.campaign(), naming.nominal.state, naming.hypothesis.state,
                                 request_.experiments, out());
    }
    progress(1.0, "done");
    return std::move(answer_);
  }

 private:
  Diagnosis& out() { return answer_.diagnosis; }
  std::function<bool()> stop() const {
    return request_.stop ? request_.stop : [] { return false; };
  }
  void progress(double share, const std::string& what) const {
    if (request_.progress) request_.progress(share, what);
  }

  // What nobody told of the machine, or of a sensor, that these data come from.
  void note_assumed(const std::vector<ExperimentData>& runs) {
    std::string all;
    const auto add = [&](const std::string& key, double value) {
      all += (all.empty() ? "" : ", ") + key + " = " + text_of(value);
    };
    const auto is_used = [&](EndStopIndex stop) {
      return std::any_of(runs.begin(), runs.end(), [&](const ExperimentData& run) {
        return std::find(run.stop.begin(), run.stop.end(), stop) != run.stop.end();
      });
    };
    const auto counts = [&](estimator::Constant constant) {
      if (!estimator::has(request_.assumed_constants, constant)) return false;
      using enum estimator::Constant;
      if (constant == kPrimaryInertia) return runs.front().torque_is_engine;
      if (constant == kRadiusOverdrive) return is_used(kOverdriveStop);
      if (constant == kRadiusLow) return is_used(kLowStop);
      return true;
    };
    for (std::size_t i = 0; i < estimator::kConstantCount; ++i) {
      if (!counts(static_cast<estimator::Constant>(i))) continue;
      const estimator::Assumption& each = estimator::assumptions()[i];
      add("variator." + std::string(each.key), request_.model.variator.*each.value);
    }
    for (const daemon::AssumedAccuracy& each : request_.assumed) {
      const bool is_torque = each.role == Role::kEngineTorque || each.role == Role::kPrimaryTorque;
      const bool is_engine = each.role == Role::kEngineTorque;
      if (is_torque && is_engine != runs.front().torque_is_engine) continue;
      add(each.key, each.value);
    }
    if (!all.empty()) out().notes.push_back("assumed, since nobody told: " + all);
  }

  // With the note that most likely says why.
  std::string too_little() {
    note_implausible();
    const std::vector<std::string>& notes = out().notes;
    const auto telling = std::find_if(notes.begin(), notes.end(), [](const std::string& note) {
      return note.find(": not used: ") != std::string::npos;
    });
    const std::string why = telling != notes.end() ? *telling
                            : notes.empty()        ? std::string()
                                                   : notes.front();
    return "found " + text_of(0.1 * out().samples) + " s of usable data, expected at least " +
           text_of(0.1 * kSamplesMin) + " s" + (why.empty() ? why : " (" + why + ")");
  }

  static std::string why_unusable(const ExperimentData& run) {
    std::string missing, sparse;
    const auto need = [&](const GridSignal& signal, const char* name) {
      std::string& list = signal.is_read ? sparse : missing;
      if (!signal.present) list += (list.empty() ? "" : ", ") + std::string(name);
    };
    need(run.omega_p, "primary_speed");
    need(run.omega_s, "secondary_speed");
    need(run.pressure, "secondary_pressure");
    need(run.torque, "primary_torque or engine_torque");
    if (!missing.empty()) return "not used: no " + missing;
    if (!sparse.empty()) return "not used: too few samples without gaps of " + sparse;
    int at_stop = 0;
    for (const int stop : run.stop) at_stop += stop != kNoStop;
    if (at_stop == 0) {
      return "not used: the speed ratio is never near an end stop (units of the speeds, "
             "ratio_low and ratio_overdrive of [variator]?)";
    }
    return "not used: never 1.6 s without gaps, shifts, saturation or run-away at an end stop";
  }

  void note_implausible() {
    out().notes.insert(out().notes.end(), implausible_.notes.begin(), implausible_.notes.end());
  }

  void fill(Engine& engine, const Naming& naming, const Learning& learning) {
    const Campaign& campaign = engine.campaign();
    const ModelState& extended = naming.hypothesis.state;
    out().complete = !stop()();
    if (!out().complete) {
      out().notes.emplace_back("stopped before the end: what is not named here may be there");
    }
    machine_.fill(engine, naming);
    // A cause with which all tests pass is what both torques differ by.
    const bool is_caused =
        learning.left.passed() && learning.terms.empty() && !naming.accepted.empty();
    if (!is_caused) torques_are_impossible(implausible_);
    check_fitted_friction(out().machine, implausible_);
    note_implausible();
    fill_baseline(engine, naming);
    out().simulation = simulated_signals(campaign, naming.nominal.state);
    fill_not_identifiable(engine, naming, out());
    if (implausible_.impossible) {
      nothing_identifiable("the data cannot be of one belt as configured", out());
      if (out().machine.contains("mu_max")) machine_.no_mu_max("no belt has such friction");
      out().verdict = Verdict::kUnexplained;
      out().unexplained = implausible_.impossible;
      return;
    }
    const std::size_t used = used_runs(campaign);
    if (used < kExperimentsMin) {
      out().notes.push_back(
          "fewer than three experiments: how they scatter is not known, and what "
          "changes from one to the next (wear, temperature) cannot be seen");
    }
    std::vector<int> slots;
    slots.reserve(naming.accepted.size());
    for (const Accepted& each : naming.accepted) slots.push_back(each.slot);
    Campaign held_out = campaign;
    if (!request_.held_out.empty()) {
      std::vector<ExperimentData> runs;
      runs.reserve(request_.held_out.size());
      for (const SignalTable& table : request_.held_out) {
        runs.push_back(prepare(table, request_.model.variator, sensors_));
      }
      held_out.runs = std::move(runs);
      held_out.slip_noise_share = estimate_slip_noise_shares(held_out, naming.nominal.state);
    }
    const auto gain_over = [&](const Nominal& nominal) -> Gain {
      if (!request_.held_out.empty()) return held_out_gain(held_out, nominal.state, extended);
      if (campaign.runs.size() < 3) return {};
      if (!learning.terms.empty()) {
        return left_out_gain(engine, nominal, learning.terms.back().fit.folds, {});
      }
      return left_out_gain(engine, nominal, extended, slots);
    };
    const Gain gain = gain_over(naming.nominal);
    for (const int slot : naming.not_confirmed) {
      // What went out may have come back beside another.
      if (std::find(slots.begin(), slots.end(), slot) != slots.end()) continue;
      out().notes.push_back(campaign.slots[static_cast<std::size_t>(slot)].label() +
                            ": fits, but does not help to predict experiments left out of the "
                            "fit; not named");
    }
    // What does not help on the experiments that the user has set aside is no finding either.
    const auto helps = [&](const Gain& over_sharp) {
      return over_sharp.better() && !over_sharp.worse(noise_floors(campaign, naming.sharp.state));
    };
    const bool refuted = !request_.held_out.empty() && !gain.signals.empty() && !slots.empty() &&
                         !helps(gain_over(naming.sharp));
    if (refuted) {
      out().notes.push_back(
          "what was found does not help to predict the held-out experiments; not named");
    }
    const bool unconfirmed =
        used < kExperimentsMin && request_.held_out.empty() && !naming.accepted.empty();
    for (const Accepted& each : naming.accepted) {
      if (!unconfirmed) break;
      out().notes.push_back(campaign.slots[static_cast<std::size_t>(each.slot)].label() +
                            ": fits, but nothing confirms it with fewer than three experiments; "
                            "not named");
    }
    const bool named = !refuted && !unconfirmed;
    if (named && !slots.empty() && !gain.better() &&
        gain.worse(noise_floors(campaign, naming.sharp.state))) {
      out().notes.emplace_back(
          "experiments that were left out of the fit are predicted worse with what was found: it "
          "rests on what machines usually have, and these data may be of a machine that has it "
          "not");
    }
    const Gain told = named ? gain : unchanged(gain);
    out().held_out = told.signals;
    out().mu_max = told.mu_max;
    for (const auto& [name, errors] : told.forward) out().simulation[name].left_out = errors;
    fill_findings(engine, named ? naming.accepted : std::vector<Accepted>(), naming, told, out());
    fill_learned(engine, naming, learning, told, out());
    judge(engine, naming, learning, named);
    if (named && !(naming.accepted.empty() && learning.terms.empty())) {
      out().explained_share = explained_share(engine, naming.nominal.state, extended);
    }
    machine_.count_learned(engine, learning);
    machine_.count_unexplained(engine, naming, learning.left);
    out().next_experiment = next_experiment(engine, naming, learning, out(), machine_.open());
    answer_.extended = request_.model;
    store_learned();
    const ModelState& stored = !named ? naming.nominal.state : extended;
    store_machine(stored.nuisance, answer_.extended);
    if (!out().machine.contains("mu_max")) keep_given_mu_max();
    for (const Ripple& ripple : naming.ripples) {
      if (ripple.found) {
        answer_.extended.effects["speed_ripple"].parameters[ripple.shaft] = ripple.amplitude;
      }
    }
    store_effects(campaign.slots, campaign.switched_on + stored.effects, stored.nuisance,
                  answer_.extended);
    if (machine_.has_play()) store_play(stored.nuisance);
  }

  // The machine's own, beside what the model has of it.
  void store_play(const Eigen::VectorXd& nuisance) {
    // Derived: nearer to it than to in between. It decides the role in the file alone: a fifth
    // more, and one of six looked at (-0.52) has none, a fifth less, and none of them changes.
    constexpr double kFromAnEnd = 0.5;
    daemon::ModelEffect& play = answer_.extended.effects["clamp_hysteresis"];
    const double from = nuisance[kPlayFrom];
    if (play.parameters.empty() && std::abs(from) > kFromAnEnd) {
      play.role = from < 0.0 ? "raised" : "lowered";
    }
    play.parameters["force_N"] += nuisance[kPlay_N];
  }

  // Where none is told the file has none either but what it was given.
  void keep_given_mu_max() {
    const auto given = request_.model.friction.find("mu_max");
    if (!request_.is_model_given || given == request_.model.friction.end()) {
      answer_.extended.friction.erase("mu_max");
    } else {
      answer_.extended.friction["mu_max"] = given->second;
    }
  }

  // Of what is not named nothing is gained.
  static Gain unchanged(Gain gain) {
    const auto stays = [](auto& each) {
      each.after = each.before;
      each.low = each.high = 0.0;
    };
    for (auto& [name, change] : gain.signals) stays(change);
    for (auto& [name, change] : gain.forward) stays(change);
    if (gain.mu_max) stays(*gain.mu_max);
    return gain;
  }

  void store_learned() {
    for (const LearnedFinding& each : out().learned) {
      // A function of the same kind that the model has already stays beside it.
      std::string name = each.name;
      while (answer_.extended.learned.contains(name)) name += "_more";
      daemon::ModelLearned& stored = answer_.extended.learned[name];
      stored.acts_on = each.acts_on;
      stored.depends_on = each.depends_on;
      stored.knots = each.knots;
      stored.values = each.values;
      stored.covariance = each.covariance;
      stored.box = each.box;
      stored.law = each.law;
    }
  }

  // The tests of the residuals that are left decide.
  void judge(const Engine& engine, const Naming& naming, const Learning& learning, bool named) {
    const Criticism& criticism = learning.left;
    if (criticism.tests.empty()) {
      out().verdict = Verdict::kNone;
      return;
    }
    out().scatter_from_replicates = criticism.base.from_replicates;
    for (const JudgedTest& test : criticism.tests) out().left[test.name] = {test.value, test.limit};
    if (!criticism.passed()) {
      out().unexplained = what_is_left(criticism, engine.campaign().has_balance);
    } else if (naming.unknown) {
      out().left["group"] = {naming.unknown->chi2, naming.unknown->limit};
      out().unexplained =
          Unexplained{naming.unknown->acts_on, {naming.unknown->depends_on}, naming.unknown->share};
    } else if (!named && !naming.accepted.empty()) {
      const int slot = naming.accepted.front().slot;
      const EffectRow& row = *engine.campaign().slots[static_cast<std::size_t>(slot)].row;
      out().unexplained = Unexplained{std::string(row.acts_on), {std::string(row.depends_on)}};
    }
    out().verdict = !out().complete                                   ? Verdict::kNone
                    : out().unexplained                               ? Verdict::kUnexplained
                    : out().findings.empty() && out().learned.empty() ? Verdict::kNothingWrong
                                                                      : Verdict::kExplained;
    if (!out().complete) out().unexplained.reset();
  }

  // Nothing: the machine alone leaves no more than noise and scatter.
  static std::optional<double> explained_share(const Engine& engine, const ModelState& nominal,
                                               const ModelState& extended) {
    const auto beyond_noise = [&](const ModelState& state) {
      double out = 0.0;
      for (const int run : engine.used()) {
        for (const Eigen::VectorXd& rows :
             white_residuals(engine.campaign(), run, state, engine.whitening(), engine.scatter())) {
          out += rows.squaredNorm() - static_cast<double>(rows.size());
        }
      }
      return out;
    };
    const double before = beyond_noise(nominal);
    if (before <= 0.0) return std::nullopt;
    return std::clamp(1.0 - beyond_noise(extended) / before, 0.0, 1.0);
  }

  void fill_baseline(const Engine& engine, const Naming& naming) {
    const Campaign& campaign = engine.campaign();
    std::map<std::string, SignalErrors::Sum> sums;
    for (std::size_t e = 0; e < campaign.runs.size(); ++e) {
      for (const auto& [name, sum] :
           signal_errors(campaign, static_cast<int>(e), naming.nominal.state).signal) {
        sums[name].squares += sum.squares;
        sums[name].count += sum.count;
      }
    }
    const auto floors = noise_floors(campaign, naming.nominal.state);
    std::vector<ResidualTest> tests = test_residuals(engine, naming.nominal.state);
    for (const UnknownGroup& group : naming.nominal_groups) {
      tests.push_back(
          {group.acts_on, group.depends_on, estimator::chi2_p(beyond_healthy(group.chi2, 1), 1)});
    }
    for (const Ripple& ripple : naming.ripples) {
      tests.push_back({"ratio", "order_spectrum_" + ripple.shaft,
                       estimator::chi2_p(beyond_healthy(ripple.chi2, 1), 1)});
    }
    for (const auto& [name, sum] : sums) {
      if (sum.count == 0.0) continue;
      BaselineSignal signal;
      signal.rmse = std::sqrt(sum.squares / sum.count);
      signal.noise_floor = floors.at(name);
      signal.unexplained_share =
          std::max(0.0, 1.0 - std::pow(signal.noise_floor / std::max(signal.rmse, 1e-300), 2.0));
      const std::string acts_on = name == "secondary_speed"      ? "ratio"
                                  : name == "secondary_torque"   ? "torque"
                                  : name == "secondary_pressure" ? "clamp force"
                                                                 : "friction";
      for (const ResidualTest& test : tests) {
        if (test.acts_on == acts_on) signal.tests[test.name] = test.p;
      }
      out().baseline[name] = signal;
    }
    // Small by itself, and nothing among so many: said, so that nobody takes it for a
    // contradiction.
    const BaselineTests all = baseline_tests(out().baseline);
    if (all.count > 0 && all.least_p < kNoChance && !all.fails(all.least_p)) {
      out().notes.push_back(
          "of " + std::to_string(all.count) + " tests of the residuals the smallest p is " +
          text_of(all.least_p) + " (" + all.signal + ", " + all.test + "), which chance gives in " +
          text_of(100.0 * all.by_chance(all.least_p)) + " % of healthy campaigns");
    }
  }

  Request request_;
  Answer answer_;
  ToldMachine machine_{request_.accuracies, request_.is_model_given, answer_.diagnosis};
  Implausible implausible_;
  Sensors sensors_;  // by what is fitted and what is held out
};

}  // namespace

Answer diagnose(Request request) { return Run(std::move(request)).run(); }

}  // namespace beltgrip::diagnose
