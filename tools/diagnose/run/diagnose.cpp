#include "tools/diagnose/run/diagnose.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "estimator/physics/assumed_constants.h"
#include "estimator/physics/clamp_force.h"
#include "estimator/statistics/distributions.h"
#include "estimator/statistics/interval.h"
#include "tools/diagnose/data/baseline_tests.h"
#include "tools/diagnose/decide/criticism.h"
#include "tools/diagnose/decide/learn.h"
#include "tools/diagnose/decide/namer.h"
#include "tools/diagnose/decide/needed_scatter.h"
#include "tools/diagnose/decide/plausibility.h"
#include "tools/diagnose/decide/rivals.h"
#include "tools/diagnose/decide/thresholds.h"
#include "tools/diagnose/infer/engine.h"
#include "tools/diagnose/infer/gain.h"
#include "tools/diagnose/infer/parallel.h"
#include "tools/diagnose/infer/peak.h"
#include "tools/diagnose/infer/residual_tests.h"
#include "tools/diagnose/infer/uncertainty.h"
#include "tools/diagnose/model/curve_family.h"
#include "tools/diagnose/run/next_experiment.h"

namespace beltgrip::diagnose {
namespace {

constexpr int kSamplesMin = 100;             // 10 s of usable data
constexpr std::size_t kLearningRunsMin = 6;  // fewer leave no level out
constexpr int kRoundsMax = 2;                // of learning and naming
constexpr double kAbsorbed = 0.99;           // chosen, of a column: a constant by another name

double quantile_975(double degrees) {
  double low = 0.0, high = 100.0;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (estimator::student_p(middle, degrees) > 0.05 ? low : high) = middle;
  }
  return low;
}

// Of the share of their giving way that pulleys take speed by alone: nearer to all of it than to
// none. Derived; measured, 0.93 to 1.00 where it stays. A fifth less or more: the same verdicts in
// 16 campaigns.
constexpr double kStays = 0.5;

std::string text_of(double value) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%.3g", value);
  return buffer;
}

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
    Engine engine = fitted_machine(campaign);
    Naming naming = name_fitted(engine, stop());
    if (is_no_belts(fitted_mu_max(naming)) && !stop()())
      name_with_usual_losses(campaign, engine, naming);
    progress(0.6, "tests");
    Learning learning = criticised(engine, naming);
    // Another machine has a constant or two more, a function one at each of its knots: it is asked
    // for first.
    std::vector<Machine> others;
    const bool is_left = !learning.left.passed() && !stop()();
    if (is_left) {
      others = other_machines(campaign, engine, naming, learning);
      take_better_of(others, engine, naming, learning);
    }
    if (!is_left || !learning.left.passed()) {
      learn_what_is_left(engine, naming, learning);
      if (!is_left && things_in(engine, learning) > 0 && !stop()())
        others = other_machines(campaign, engine, naming, learning);
      for (Machine& each : others) learn_what_is_left(each.engine, each.naming, each.learning);
      take_better_of(others, engine, naming, learning);
    }
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

  void nothing_identifiable(const std::string& reason) {
    std::string last;
    for (const EffectRow& row : effect_rows()) {
      if (row.id == last) continue;
      last = row.id;
      out().not_identifiable.push_back({std::string(row.id), {}, reason});
    }
  }

  static std::size_t used_runs(const Campaign& campaign) {
    return static_cast<std::size_t>(
        std::count_if(campaign.runs.begin(), campaign.runs.end(),
                      [](const ExperimentData& run) { return run.valid_count > 0; }));
  }

  static double fitted_mu_max(const Naming& naming) {
    return std::exp(naming.hypothesis.state.nuisance[kLnMuMax]);
  }
  // Where that leaves friction that belts have.
  void name_with_usual_losses(const Campaign& campaign, Engine& engine, Naming& naming) const {
    Engine usual(campaign, request_.jobs, Losses::kUsual, engine.torque_ratio());
    Naming other = name_effects(usual, stop());
    if (stop()() || is_no_belts(fitted_mu_max(other))) return;
    engine = std::move(usual);
    naming = std::move(other);
  }

  // Causes that were named or learned, and one where something is left.
  static std::size_t things_in(const Engine& engine, const Learning& learning) {
    return engine.accepted().size() + learning.terms.size() + (learning.left.passed() ? 0 : 1);
  }

  struct Machine {
    Engine engine;
    Naming naming;
    Learning learning;
  };

  // The torque ratio is that which the data are more probable with, whatever may be wrong beside
  // it: on the wrong machine names take up what its ratio lacks, and do not give it back. The other
  // one is asked where something is left or named.
  Engine fitted_machine(const Campaign& campaign) {
    Engine follows(campaign, request_.jobs);
    follows.fit_machine();
    if (!campaign.has_balance || stop()()) return follows;
    Engine stays(campaign, request_.jobs, Losses::kAsFitted, TorqueRatio::kMayStay);
    stays.fit_machine();
    Engine by_follows = follows, by_stays = stays;
    by_follows.update_noise();
    by_stays.update_noise();
    const bool is_there = stays.state().nuisance[kDeformationLost] > kStays &&
                          explain_more_than(by_follows, by_stays);
    other_ratio_ = is_there ? follows : stays;
    return is_there ? stays : follows;
  }

  // What may be there instead of causes, with the names that it has.
  std::vector<Machine> other_machines(const Campaign& campaign, const Engine& engine,
                                      const Naming& naming, const Learning& learning) {
    std::vector<Machine> out;
    const auto add = [&](Engine other) {
      if (stop()()) return;
      Naming named = name_fitted(other, stop());
      Learning left = criticised(other, named);
      out.push_back({std::move(other), std::move(named), std::move(left)});
    };
    if (loses_unusually(campaign, naming)) {
      Engine usual(campaign, request_.jobs, Losses::kUsual, engine.torque_ratio());
      usual.fit_machine();
      add(std::move(usual));
    }
    if (!other_ratio_ || stop()()) return out;
    Engine noisy = *other_ratio_;
    noisy.update_noise();
    const auto share = [](const ModelState& state) { return state.nuisance[kDeformationLost]; };
    const bool has_it = engine.torque_ratio() == TorqueRatio::kMayStay;
    // Where the names leave little that stays, or where they leave much, the other machine is
    // there.
    const bool is_there =
        has_it ? share(engine.state()) <= kStays
               : share(noisy.refine_from(engine.state(), engine.accepted()).state) > kStays;
    const bool may_be_there = has_it || share(other_ratio_->state()) > kStays;
    if (is_there || (may_be_there && !is_settled(engine, learning, noisy))) add(*other_ratio_);
    return out;
  }

  // Is it but another machine? Only where the tests then pass with fewer causes, which explain no
  // more.
  void take_better_of(std::vector<Machine>& others, Engine& engine, Naming& naming,
                      Learning& learning) const {
    for (Machine& other : others) {
      if (stop()()) return;
      const std::size_t causes = things_in(other.engine, other.learning);
      const std::size_t before = things_in(engine, learning);
      if (!other.learning.left.passed() || before == 0) continue;
      // A function that explains a little more fails no test beside it.
      const bool is_better =
          causes < before ? engine.accepted().empty() || !explain_more_than(other.engine, engine)
                          : causes == before && explain_more_than(engine, other.engine);
      if (!is_better) continue;
      engine = other.engine;
      naming = other.naming;
      learning = other.learning;
    }
  }

  // One name with which all tests pass, and that does what the other torque ratio cannot: that
  // explains less in its place.
  static bool is_settled(const Engine& engine, const Learning& learning, const Engine& other) {
    return engine.accepted().size() == 1 && things_in(engine, learning) == 1 &&
           explain_more_than(other, engine);
  }

  static bool loses_unusually(const Campaign& campaign, const Naming& naming) {
    constexpr std::array kLosses{kLossConstant_Nm, kLossPerSpeed_Nms, kSecondaryLoss_Nm,
                                 kSecondaryLossPerSpeed_Nms};
    return std::any_of(kLosses.begin(), kLosses.end(), [&](int loss) {
      const NuisanceRow& row = campaign.nuisances[static_cast<std::size_t>(loss)];
      const double off = naming.hypothesis.state.nuisance[loss] - row.nominal;
      return std::abs(off) > Engine::kReach * row.tolerance;
    });
  }

  // Where names leave something, the whole naming anew beside them: the first pass weighs a second
  // effect against the first one's evidence, which is in the machine now. Not where the tests pass:
  // there a second name is what the first one's equation has wrong.
  void name_until_settled(Engine& engine, Naming& naming, Criticism& left) {
    for (int round = 0; round < kRoundsMax && !left.passed() && !stop()(); ++round) {
      const std::vector<int> before = engine.accepted();
      if (before.empty()) return;
      name_anew(engine, naming, stop());
      if (engine.accepted() == before) return;
      left = criticise(engine);
    }
  }

  // Scatter that the data do not need goes first: it hides what they need.
  Criticism criticise_with_needed_scatter(Engine& engine, Naming& naming) {
    Criticism out = criticise(engine);
    // With less of it, what replicates scatter by is less too.
    for (int round = 0; round < kRoundsMax && !stop()(); ++round) {
      std::optional<Engine> bounded = without_needless_scatter(engine, out);
      if (!bounded) break;
      engine = std::move(*bounded);
      name_anew(engine, naming, stop());
      out = criticise(engine);
    }
    return out;
  }

  // Where names leave something, the machine is wrong still, and by its misfit a further name may
  // gain much and stand for nothing: it is there if a test that fails without it passes with it.
  void drop_what_heals_nothing(Engine& engine, Naming& naming, Criticism& left) const {
    while (!left.passed() && engine.accepted().size() > 1 && !stop()()) {
      Engine with_fewer = engine;
      Naming fewer = naming;
      forget_last(with_fewer, fewer, stop());
      Criticism without = criticise(with_fewer);
      if (with_fewer.accepted().empty() || passes_any(without, left)) return;
      engine = std::move(with_fewer);
      naming = std::move(fewer);
      left = std::move(without);
    }
  }

  // What names leave.
  Learning criticised(Engine& engine, Naming& naming) {
    Learning out;
    if (stop()()) return out;
    out.left = criticise_with_needed_scatter(engine, naming);
    name_until_settled(engine, naming, out.left);
    drop_what_heals_nothing(engine, naming, out.left);
    return out;
  }

  // What fails the tests is learned where it can be; with it the whole analysis anew, until nothing
  // changes.
  void learn_what_is_left(Engine& engine, Naming& naming, Learning& out) {
    if (out.left.passed() || stop()()) return;
    if (engine.accepted().empty()) {
      learn_in_turn(engine, naming, out);
      return;
    }
    // Names that leave something: are they needed beside a function, or its shadows?
    Engine bare = engine;
    Naming forgotten = naming;
    forget_names(bare, forgotten);
    Learning alone;
    alone.left = criticise_with_needed_scatter(bare, forgotten);
    const Criticism nothing = alone.left;
    if (nothing.passed() && passes_with_fewer(engine, naming, out.left)) return;
    learn_in_turn(bare, forgotten, alone);
    const bool is_alone =
        !alone.terms.empty() && alone.left.passed() && !explain_more_than(bare, engine);
    if (!is_alone) learn_in_turn(engine, naming, out);
    const bool are_shadows =
        is_alone || (!out.left.passed() &&
                     is_shadowed(engine.campaign(), engine.accepted(), nothing, out.left));
    if (!are_shadows) return;
    engine = std::move(bare);
    naming = std::move(forgotten);
    out = std::move(alone);
  }

  // Where the tests pass without any name, what fails with them is theirs, and no function is to
  // mend it: the last go, one after the other, if with those before them the tests pass. Not all of
  // them: that there is a cause is what the first one's evidence says.
  bool passes_with_fewer(Engine& engine, Naming& naming, Criticism& left) const {
    Engine with_fewer = engine;
    Naming fewer = naming;
    while (with_fewer.accepted().size() > 1 && !stop()()) {
      forget_last(with_fewer, fewer, stop());
      if (with_fewer.accepted().empty()) return false;
      Criticism now = criticise(with_fewer);
      if (!now.passed()) continue;
      engine = std::move(with_fewer);
      naming = std::move(fewer);
      left = std::move(now);
      return true;
    }
    return false;
  }

  // By names against a function in their place.
  static bool explain_more_than(const Engine& function, const Engine& names) {
    const auto by_noise_of = [&](const Engine& noise) {
      return Contest{noise.refine_from(names.state(), names.accepted(), 0).log_likelihood,
                     noise.refine_from(function.state(), function.accepted(), 0).log_likelihood};
    };
    const std::array both{by_noise_of(names), by_noise_of(function)};
    return are_no_shadows(both);
  }

  void learn_in_turn(Engine& engine, Naming& naming, Learning& out) {
    const bool sensible = !implausible_.impossible && implausible_.torques.empty() &&
                          used_runs(engine.campaign()) >= kLearningRunsMin;
    for (int round = 0; round < kRoundsMax && sensible && !out.left.passed(); ++round) {
      Learning more = learn(
          engine, out.left, stop(),
          [&](const Engine& with, const LearnedFit& fit) { return predicts(with, naming, fit); });
      out.needs_levels = more.needs_levels;
      if (more.terms.empty()) break;
      out.left = std::move(more.left);
      for (Learned& each : more.terms) out.terms.push_back(std::move(each));
      const Engine before = engine;
      const Naming names_before = naming;
      const std::vector<Learned> terms_before = out.terms;
      name_anew(engine, naming, stop());
      if (stop()() || engine.accepted() == before.accepted()) break;
      // Other effects: what was learned beside the old ones is learned beside these. A name that
      // makes a function of what no machine has is none: each gives what the other takes.
      relearn(engine, out);
      if (!std::all_of(out.terms.begin(), out.terms.end(),
                       [](const Learned& each) { return is_possible(each.fit); })) {
        engine = before;
        naming = names_before;
        out.terms = terms_before;
        break;
      }
      out.left = criticise(engine);
    }
  }

  static void relearn(Engine& engine, Learning& learning) {
    for (Learned& each : learning.terms) {
      // The function of this term last.
      std::vector<estimator::LearnedTerm> functions = engine.state().learned;
      std::rotate(functions.begin(), functions.begin() + 1, functions.end());
      if (functions.size() > 1) engine.learn(std::move(functions));
      each.fit = fit_further(engine, each.fit);
    }
  }

  void fill(Engine& engine, const Naming& naming, const Learning& learning) {
    const Campaign& campaign = engine.campaign();
    const ModelState& extended = naming.hypothesis.state;
    out().complete = !stop()();
    if (!out().complete) {
      out().notes.emplace_back("stopped before the end: what is not named here may be there");
    }
    fill_machine(engine, naming);
    note_torque_ratio();
    note_torque_from_nothing(campaign);
    tell_turning_oil(engine);
    // A cause with which all tests pass is what both torques differ by.
    const bool is_caused =
        learning.left.passed() && learning.terms.empty() && !naming.accepted.empty();
    if (!is_caused) torques_are_impossible(implausible_);
    check_fitted_friction(out().machine, implausible_);
    note_implausible();
    fill_baseline(engine, naming);
    out().simulation = simulated_signals(campaign, naming.nominal.state);
    fill_not_identifiable(engine, naming);
    if (implausible_.impossible) {
      nothing_identifiable("the data cannot be of one belt as configured");
      if (out().machine.contains("mu_max")) no_mu_max("no belt has such friction");
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
    fill_findings(engine, named ? naming.accepted : std::vector<Accepted>(), naming, told);
    fill_learned(engine, naming, learning, told);
    judge(engine, naming, learning, named);
    if (named && !(naming.accepted.empty() && learning.terms.empty())) {
      out().explained_share = explained_share(engine, naming.nominal.state, extended);
    }
    count_learned(engine, learning);
    count_unexplained(engine, naming, learning.left);
    out().next_experiment = next_experiment(engine, naming, learning, out(), open_);
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

  void fill_learned(const Engine& engine, const Naming& naming, const Learning& learning,
                    const Gain& gain) {
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
      out().learned.push_back(std::move(found));
    }
  }

  static BeforeAfter change_of(const MuMaxError& error) {
    return {error.before, error.after, error.low, error.high};
  }

  // What a cause is to be seen by: mu_max, or the signal that shows it; else what there is.
  struct Shown {
    std::string metric;
    BeforeAfter change;
  };
  static std::optional<Shown> shown_by(const Gain& gain, std::string_view acts_on) {
    const bool is_friction = acts_on == "friction" || acts_on == "clamp_force";
    if (is_friction && gain.mu_max) return Shown{"mu_max", change_of(*gain.mu_max)};
    const bool is_torque = acts_on == "torque" || acts_on == "torque_gain";
    const auto shown = gain.signals.find(is_torque ? "secondary_torque" : "secondary_speed");
    const auto used = shown != gain.signals.end() ? shown : gain.signals.begin();
    if (used == gain.signals.end()) return {};
    return Shown{used->first, used->second};
  }

  // A function that predicts what was left out of its fit clearly worse than none is none.
  static bool predicts(const Engine& engine, const Naming& naming, const LearnedFit& fit) {
    const auto shown = shown_by(left_out_gain(engine, naming.nominal, fit.folds, fit.is_inner),
                                fit.cell.injection->acts_on);
    if (!shown) return true;
    std::map<std::string, double> floors = noise_floors(engine.campaign(), naming.nominal.state);
    floors["mu_max"] = thresholds::kMuMaxTrifle;
    return !is_clearly_worse(shown->change, floors[shown->metric]);
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

  // What is left unexplained stands in the level of the friction as well: which of the experiments,
  // or which value of what it follows, is the machine's own cannot be said.
  void count_unexplained(const Engine& engine, const Naming& naming, const Criticism& left) {
    if (!out().unexplained || left.tests.empty() || !out().machine.contains("mu_max")) return;
    const Scatter& scatter = engine.scatter();
    if (is_beyond_scatter(scatter)) {
      no_mu_max("experiments differ by more than friction scatters, for no reason found");
      return;
    }
    double variance = 0.0;
    const auto fails = [&](const char* name) { return !left.test(name).passed(); };
    if (fails("scatter_friction") || fails("unusual_friction")) variance += scatter.variance[0];
    if (fails("law_cell") || fails("smooth_cell")) {
      variance += friction_variance(engine, left.cells.front());
    }
    widen_mu_max(variance + variance_of_halves(engine, naming.last_screen, mu_height_) +
                 variance_of_bending(engine, naming.hypothesis, mu_height_));
  }

  void note_torque_ratio() {
    const auto share = out().machine.find("deformation_lost_share");
    if (share == out().machine.end()) return;
    out().notes.push_back(
        "the ratio of the torques does not follow pulleys that give way: a share of " +
        text_of(share->second.value) + " of it takes speed alone, as slip does");
  }

  // A zero of the torque sensor looks like a constant loss, of either sign; beyond what was stated
  // of it a loss below nothing is something else's.
  void note_torque_from_nothing(const Campaign& campaign) {
    const auto loss = out().machine.find("loss_constant_Nm");
    if (loss == out().machine.end()) return;
    const Role measured =
        campaign.runs[0].torque_is_engine ? Role::kEngineTorque : Role::kPrimaryTorque;
    const double zero_Nm = request_.accuracies[static_cast<std::size_t>(measured)].bias;
    if (loss->second.high >= -estimator::kNormal95 * zero_Nm) return;
    out().notes.push_back("loss_constant_Nm: " + text_of(loss->second.value) + " (" +
                          text_of(loss->second.low) + " to " + text_of(loss->second.high) +
                          "): no machine makes torque; the torque reads too little by as much, or "
                          "what is wrong stands elsewhere");
  }

  // A gain of the pressure by as much looks the same, and has another friction.
  void tell_turning_oil(const Engine& engine) {
    const auto off = out().machine.find("secondary_centrifugal_off_N_s2");
    if (off == out().machine.end() || off->second.low * off->second.high < 0.0) return;
    const double told = engine.campaign().variator.secondary_centrifugal_N_s2;
    out().notes.push_back("secondary_centrifugal_N_s2: " + text_of(told) + " as told, " +
                          text_of(told + off->second.low) + " to " +
                          text_of(told + off->second.high) +
                          " by these data, or the pressure has a gain by as much");
    if (!out().machine.contains("mu_max")) return;
    widen_mu_max(std::pow(off->second.value / told * share_of_pressure(engine), 2.0));
  }

  void no_mu_max(const std::string& why) {
    out().machine.erase("mu_max");
    out().notes.push_back("mu_max: " + why + "; no value");
  }

  // variance: of its logarithm, beside what its interval counts.
  void widen_mu_max(double variance) {
    Interval& told = out().machine.at("mu_max");
    const double half = std::hypot(0.5 * std::log(told.high / told.low),
                                   estimator::kNormal95 * std::sqrt(variance));
    told.low = told.value * std::exp(-half);
    told.high = told.value * std::exp(half);
    if (half > estimator::kNormal95 * default_nuisances()[kLnMuMax].tolerance) {
      no_mu_max("what is left unexplained may have it off by more than belts differ");
    }
  }

  // A function that was learned is about its mean over the experiments; where on it the machine's
  // own friction lies is not known.
  void count_learned(const Engine& engine, const Learning& learning) {
    double variance = 0.0;
    for (const Learned& each : learning.terms) variance += friction_variance(engine, each.fit.cell);
    if (variance > 0.0 && out().machine.contains("mu_max")) widen_mu_max(variance);
  }

  // What the function that stands out comes to in the friction, relative, about its mean.
  static double friction_variance(const Engine& engine, const Cell& cell) {
    double per_unit = 0.0;
    switch (cell.injection->injection) {
      case Injection::kFriction:
      case Injection::kTorqueGain:
        per_unit = cell.injection->unit;
        break;
      case Injection::kTorque:
        per_unit = cell.injection->unit / typical(engine, &ExperimentData::torque);
        break;
      case Injection::kClampForce:
        per_unit = cell.injection->unit / (engine.campaign().variator.secondary_piston_area_m2 *
                                           typical(engine, &ExperimentData::pressure));
        break;
      case Injection::kRatio:
        return 0.0;
    }
    const Eigen::ArrayXd off = cell.mean.array() - cell.mean.mean();
    return per_unit * per_unit * off.square().mean();
  }

  // Mean magnitude of a channel over the samples that count.
  static double typical(const Engine& engine, GridSignal ExperimentData::*channel) {
    double sum = 0.0, count = 1e-9;
    for (const ExperimentData& run : engine.campaign().runs) {
      for (int k = 0; k < run.size(); ++k) {
        if (!run.valid[static_cast<std::size_t>(k)]) continue;
        sum += std::abs((run.*channel).value[k]);
        count += 1.0;
      }
    }
    return std::max(sum / count, 1e-9);
  }

  // Beyond doubt, and by more than two machines of one type do.
  static bool differs(double off, double sigma, double tolerance) {
    constexpr double kSure = 5.0;  // chosen, sigmas: of some twenty constants none by chance
    return std::abs(off) > tolerance && std::abs(off) > kSure * sigma;
  }

  void fill_machine(const Engine& engine, const Naming& naming) {
    const Fit& fit = naming.hypothesis.fit;
    for (std::size_t j = 0; j < engine.active_nuisances().size(); ++j) {
      const int p = engine.active_nuisances()[j];
      const auto i = static_cast<Eigen::Index>(j);
      double variance = fit.covariance(i, i) * engine.scale(p) * engine.scale(p);
      if (const int first = first_knot(p); first >= 0) {
        // At the low end stop the form in overdrive counts as well, where that is used.
        Eigen::VectorXd lever = Eigen::VectorXd::Zero(fit.covariance.rows());
        for (std::size_t k = 0; k < engine.active_nuisances().size(); ++k) {
          const int q = engine.active_nuisances()[k];
          const int of = first_knot(q);
          if (of != first && !(of == kShapeOverdrive && first == kShapeLow)) continue;
          lever[static_cast<Eigen::Index>(k)] = curve_modes()(p - first, q - of) * engine.scale(q);
        }
        variance = lever.dot(fit.covariance * lever);
      }
      const double sigma = std::sqrt(std::max(variance, 0.0));
      const double value = naming.hypothesis.state.nuisance[p];
      // The curve's own peak and slip are the fit's; what they come to is told below.
      if (p == kLnMuMax || p == kLnPeakSlipOverdrive || p == kLnPeakSlipLow) continue;
      const std::string name(engine.campaign().nuisances[static_cast<std::size_t>(p)].name);
      const Interval fitted{value, value - estimator::kNormal95 * sigma,
                            value + estimator::kNormal95 * sigma};
      const NuisanceRow& row = engine.campaign().nuisances[static_cast<std::size_t>(p)];
      const bool is_shape = first_knot(p) >= 0;
      tell_machine(name, fitted, row.nominal,
                   !is_shape && differs(value - row.nominal, sigma, row.tolerance));
    }
    for (const int stop : {kLowStop, kOverdriveStop}) {  // mu_max of the overdrive where it is used
      if (!uses_stop(engine, stop)) continue;
      const FittedPeak peak = fitted_peak(engine, naming.hypothesis, stop);
      const auto tell = [&](const std::string& name, double ln, double sigma, int p) {
        const double half = estimator::kNormal95 * sigma;
        const NuisanceRow& row = engine.campaign().nuisances[static_cast<std::size_t>(p)];
        tell_machine(name, {std::exp(ln), std::exp(ln - half), std::exp(ln + half)},
                     std::exp(row.nominal), differs(ln - row.nominal, sigma, row.tolerance));
      };
      const bool low = stop == kLowStop;
      tell(low ? "peak_slip_low" : "peak_slip_overdrive", peak.ln_slip, peak.ln_slip_sigma,
           low ? kLnPeakSlipLow : kLnPeakSlipOverdrive);
      if (low && uses_stop(engine, kOverdriveStop)) continue;
      const double seen = std::hypot(peak.ln_mu_sigma, mu_of_class(engine, naming, peak, stop),
                                     mu_of_sensors(engine));
      mu_height_ = peak.height;
      open_ = left_open(engine, unseen_in(engine.campaign(), naming), peak.height);
      const double pushed = variance_of_pushed(engine, naming.hypothesis, peak.height);
      tell("mu_max", peak.ln_mu, std::hypot(seen, std::sqrt(open_.variance + pushed)), kLnMuMax);
      if (open_.variance > seen * seen) {
        note_open();
      } else {
        open_ = {};
      }
    }
  }

  // Effects that these data do not show. What somebody stated a sensor to be accurate to
  // is counted as that.
  std::vector<Score> unseen_in(const Campaign& campaign, const Naming& naming) const {
    std::map<std::string_view, bool> is_plain;
    for (const Score& score : naming.last_screen) {
      const Slot& slot = campaign.slots[static_cast<std::size_t>(score.slot)];
      is_plain[slot.row->id] |= is_seen(score, slot);
    }
    for (const Accepted& each : naming.accepted) {
      is_plain[campaign.slots[static_cast<std::size_t>(each.slot)].row->id] = true;
    }
    const auto& torque = request_.accuracies[static_cast<std::size_t>(
        campaign.runs[0].torque_is_engine ? Role::kEngineTorque : Role::kPrimaryTorque)];
    const auto& pressure = request_.accuracies[static_cast<std::size_t>(Role::kSecondaryPressure)];
    is_plain["torque_bias"] |= torque.bias > 0.0;
    is_plain["torque_gain"] |= torque.gain > 0.0;
    is_plain["pressure_offset"] |= pressure.bias > 0.0;
    is_plain["pressure_gain"] |= pressure.gain > 0.0;
    std::vector<Score> out;
    for (const Score& score : naming.last_screen) {
      const Slot& slot = campaign.slots[static_cast<std::size_t>(score.slot)];
      if (!is_plain[slot.row->id]) out.push_back(score);
    }
    return out;
  }

  // Which effects are behind an interval of mu_max that is wide for what was not seen.
  void note_open() {
    constexpr std::size_t kNamed = 3;
    std::string names;
    for (std::size_t i = 0; i < std::min(kNamed, open_.by_effect.size()); ++i) {
      names += (i == 0 ? "" : ", ") + open_share(open_.by_effect[i]);
    }
    out().notes.push_back(
        "mu_max: known to " + text_of(100.0 * std::sqrt(open_.variance)) +
        " % for what these experiments cannot show, were it there at its usual "
        "size: " +
        names + "; to see the first: " +
        std::string(row_of(std::string(open_.by_effect.front().effect))->separating));
  }

  // What another member of the class in a name's place would have mu_max differ by, one sigma: by
  // their probabilities beside the name's.
  static double mu_of_class(const Engine& engine, const Naming& naming, const FittedPeak& peak,
                            int stop) {
    double weights = 1.0, squares = 0.0;
    for (const Accepted& each : naming.accepted) {
      for (const Hypothesis& other : each.in_its_place) {
        const double weight = std::exp(other.log_evidence - naming.hypothesis.log_evidence);
        const double off = fitted_peak(engine, other, stop).ln_mu - peak.ln_mu;
        weights += weight;
        squares += weight * off * off;
      }
    }
    return std::sqrt(squares / weights);
  }

  // Of the clamp force, about what the pressure makes of it.
  static double share_of_pressure(const Engine& engine) {
    const estimator::VariatorParameters& variator = engine.campaign().variator;
    const double by_pressure_N =
        variator.secondary_piston_area_m2 * typical(engine, &ExperimentData::pressure);
    return by_pressure_N / (by_pressure_N + variator.secondary_spring_force_N);
  }

  // What the gains of torque and pressure may have it off by, as far as somebody stated them, one
  // sigma: nothing in these data says more of them. Constant errors are constants of the fit.
  double mu_of_sensors(const Engine& engine) const {
    const Campaign& campaign = engine.campaign();
    const auto accuracy = [&](Role role) {
      return request_.accuracies[static_cast<std::size_t>(role)];
    };
    const bool is_engine = campaign.runs[0].torque_is_engine;
    const auto torque = accuracy(is_engine ? Role::kEngineTorque : Role::kPrimaryTorque);
    const auto pressure = accuracy(Role::kSecondaryPressure);
    return std::hypot(torque.gain, pressure.gain * share_of_pressure(engine));
  }

  void tell_machine(const std::string& name, const Interval& fitted, double of_model,
                    bool is_different) {
    if (request_.is_model_given && is_different) {
      out().notes.push_back(name + ": the model has " + text_of(of_model) + ", these data say " +
                            text_of(fitted.value) + " (" + text_of(fitted.low) + " to " +
                            text_of(fitted.high) +
                            "), which counts as the machine's own and is no finding");
    }
    out().machine[name] = fitted;
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

  // Causes outside the table that do the same. Friction stands beside the clamp force in all that a
  // ramp shows, and beside the torque where none is recorded behind the belt.
  static void add_twins(const Campaign& campaign, Finding& finding, const EffectRow& row) {
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

  void fill_findings(const Engine& engine, const std::vector<Accepted>& accepted,
                     const Naming& naming, const Gain& gain) {
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
      const auto found = std::find_if(out().findings.begin(), out().findings.end(),
                                      [&](const Finding& f) { return f.effect == slot.row->id; });
      Finding& finding = found == out().findings.end() ? out().findings.emplace_back() : *found;
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
        if (id != finding.effect && std::find(finding.aliases.begin(), finding.aliases.end(), id) ==
                                        finding.aliases.end()) {
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
      const auto found = std::find_if(out().findings.begin(), out().findings.end(),
                                      [](const Finding& f) { return f.effect == "speed_ripple"; });
      Finding& finding = found == out().findings.end() ? out().findings.emplace_back() : *found;
      finding.effect = "speed_ripple";
      finding.probability = 1.0;
      finding.equation = "omega_measured = omega_true (1 + a sin(phi + phi0))";
      finding.acts_on = "speed";
      finding.parameters[ripple.shaft] = {ripple.amplitude,
                                          ripple.amplitude - estimator::kNormal95 * ripple.sigma,
                                          ripple.amplitude + estimator::kNormal95 * ripple.sigma};
    }
    for (Finding& finding : out().findings) {
      if (finding.aliases.empty()) finding.separate_by.clear();
    }
  }

  // What an effect would have to be like to be seen; those that hardly ever are that large.
  void fill_not_identifiable(const Engine& engine, const Naming& naming) {
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
      const std::vector<NotIdentifiable>& told = out().not_identifiable;
      const bool again = !told.empty() && told.back().effect == id;  // another parameter of it
      if (visible.contains(id) || named(id) || again || row.apply == nullptr) continue;
      out().not_identifiable.push_back({id, {}, "no signal in these data shows it"});
    }
    for (const auto& [id, seen] : visible) {
      if (seen || named(id)) continue;
      out().not_identifiable.push_back(
          {id, smallest[id],
           smallest[id].empty() ? "no other thing here than a friction curve that runs otherwise"
           : absorbed[id] > kAbsorbed ? "absorbed by a fitted constant of the machine"
                                      : "the experiments hardly move what it depends on"});
    }
  }

  static const EffectRow* row_of(const std::string& id) {
    return &*std::find_if(effect_rows().begin(), effect_rows().end(),
                          [&](const EffectRow& row) { return row.id == id; });
  }

  Request request_;
  Answer answer_;
  Implausible implausible_;
  std::optional<Engine> other_ratio_;  // the machine with the other torque ratio, where one is seen
  Eigen::VectorXd mu_height_;          // change of ln mu_max per column of the fit
  LeftOpen open_;                      // of mu_max; empty where other errors are larger
  Sensors sensors_;                    // by what is fitted and what is held out
};

}  // namespace

Answer diagnose(Request request) { return Run(std::move(request)).run(); }

}  // namespace beltgrip::diagnose
