#include "tools/diagnose/run/search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "tools/diagnose/data/baseline_tests.h"
#include "tools/diagnose/decide/needed_scatter.h"
#include "tools/diagnose/decide/plausibility.h"
#include "tools/diagnose/decide/rivals.h"
#include "tools/diagnose/decide/thresholds.h"
#include "tools/diagnose/infer/gain.h"
#include "tools/diagnose/run/shown_gain.h"

namespace beltgrip::diagnose {
namespace {

constexpr std::size_t kLearningRunsMin = 6;  // fewer leave no level out
constexpr int kRoundsMax = 2;                // of learning and naming
// Of the share of their giving way that pulleys take speed by alone: nearer to all of it than to
// none. Derived; measured, 0.93 to 1.00 where it stays. A fifth less or more: the same verdicts in
// 16 campaigns.
constexpr double kStays = 0.5;

class Search {
 public:
  explicit Search(const SearchOptions& options) : options_(options) {}

  Found run(const Campaign& campaign) {
    Engine engine = fitted_machine(campaign);
    Naming naming = name_fitted(engine, options_.stop);
    if (is_no_belts(fitted_mu_max(naming)) && !options_.stop())
      name_with_usual_losses(campaign, engine, naming);
    options_.on_named();
    Learning learning = criticised(engine, naming);
    // Another machine has a constant or two more, a function one at each of its knots: it is asked
    // for first.
    std::vector<Found> others;
    const bool is_left = !learning.left.passed() && !options_.stop();
    if (is_left) {
      others = other_machines(campaign, engine, naming, learning);
      take_better_of(others, engine, naming, learning);
    }
    if (!is_left || !learning.left.passed()) {
      learn_what_is_left(engine, naming, learning);
      if (!is_left && things_in(engine, learning) > 0 && !options_.stop())
        others = other_machines(campaign, engine, naming, learning);
      for (Found& each : others) learn_what_is_left(each.engine, each.naming, each.learning);
      take_better_of(others, engine, naming, learning);
    }
    return {std::move(engine), std::move(naming), std::move(learning)};
  }

 private:
  static double fitted_mu_max(const Naming& naming) {
    return std::exp(naming.hypothesis.state.nuisance[kLnMuMax]);
  }
  // Where that leaves friction that belts have.
  void name_with_usual_losses(const Campaign& campaign, Engine& engine, Naming& naming) const {
    Engine usual(campaign, options_.jobs, Losses::kUsual, engine.torque_ratio());
    Naming other = name_effects(usual, options_.stop);
    if (options_.stop() || is_no_belts(fitted_mu_max(other))) return;
    engine = std::move(usual);
    naming = std::move(other);
  }

  // Causes that were named or learned, and one where something is left.
  static std::size_t things_in(const Engine& engine, const Learning& learning) {
    return engine.accepted().size() + learning.terms.size() + (learning.left.passed() ? 0 : 1);
  }

  // Pulleys that close as the force grows do not give way: there is nothing that stays.
  static bool ratio_stays(const ModelState& state) {
    return state.nuisance[kDeformationLost] > kStays && state.nuisance[kDeformationPerkN] > 0.0;
  }

  // The torque ratio is that which the data are more probable with, whatever may be wrong beside
  // it: on the wrong machine names take up what its ratio lacks, and do not give it back. The other
  // one is asked where something is left or named.
  Engine fitted_machine(const Campaign& campaign) {
    Engine follows(campaign, options_.jobs);
    follows.fit_machine();
    if (!campaign.has_balance || options_.stop()) return follows;
    Engine stays(campaign, options_.jobs, Losses::kAsFitted, TorqueRatio::kMayStay);
    stays.fit_machine();
    Engine by_follows = follows, by_stays = stays;
    by_follows.update_noise();
    by_stays.update_noise();
    const bool is_there = ratio_stays(stays.state()) && explain_more_than(by_follows, by_stays);
    other_ratio_ = is_there ? follows : stays;
    return is_there ? stays : follows;
  }

  // What may be there instead of causes, with the names that it has.
  std::vector<Found> other_machines(const Campaign& campaign, const Engine& engine,
                                    const Naming& naming, const Learning& learning) {
    std::vector<Found> out;
    const auto add = [&](Engine other) {
      if (options_.stop()) return;
      Naming named = name_fitted(other, options_.stop);
      Learning left = criticised(other, named);
      out.push_back({std::move(other), std::move(named), std::move(left)});
    };
    if (loses_unusually(campaign, naming)) {
      Engine usual(campaign, options_.jobs, Losses::kUsual, engine.torque_ratio());
      usual.fit_machine();
      add(std::move(usual));
    }
    if (!other_ratio_ || options_.stop()) return out;
    Engine noisy = *other_ratio_;
    noisy.update_noise();
    const bool has_it = engine.torque_ratio() == TorqueRatio::kMayStay;
    // Where the names leave little that stays, or where they leave much, the other machine is
    // there.
    const bool is_there =
        has_it ? !ratio_stays(engine.state())
               : ratio_stays(noisy.refine_from(engine.state(), engine.accepted()).state);
    const bool may_be_there = has_it || ratio_stays(other_ratio_->state());
    if (is_there || (may_be_there && !is_settled(engine, learning, noisy))) add(*other_ratio_);
    return out;
  }

  // Is it but another machine? Only where the tests then pass with fewer causes, which explain no
  // more.
  void take_better_of(std::vector<Found>& others, Engine& engine, Naming& naming,
                      Learning& learning) const {
    for (Found& other : others) {
      if (options_.stop()) return;
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
    for (int round = 0; round < kRoundsMax && !left.passed() && !options_.stop(); ++round) {
      const std::vector<int> before = engine.accepted();
      if (before.empty()) return;
      name_anew(engine, naming, options_.stop);
      if (engine.accepted() == before) return;
      left = criticise(engine);
    }
  }

  // Scatter that the data do not need goes first: it hides what they need.
  Criticism criticise_with_needed_scatter(Engine& engine, Naming& naming) {
    Criticism out = criticise(engine);
    // With less of it, what replicates scatter by is less too.
    for (int round = 0; round < kRoundsMax && !options_.stop(); ++round) {
      std::optional<Engine> bounded = without_needless_scatter(engine, out);
      if (!bounded) break;
      engine = std::move(*bounded);
      name_anew(engine, naming, options_.stop);
      out = criticise(engine);
    }
    return out;
  }

  // Where names leave something, the machine is wrong still, and by its misfit a further name may
  // gain much and stand for nothing: it is there if a test that fails without it passes with it,
  // and none fails that had passed. Else the misfit has only moved.
  void drop_what_heals_nothing(Engine& engine, Naming& naming, Criticism& left) const {
    while (!left.passed() && engine.accepted().size() > 1 && !options_.stop()) {
      Engine with_fewer = engine;
      Naming fewer = naming;
      forget_last(with_fewer, fewer, options_.stop);
      Criticism without = criticise(with_fewer);
      const bool heals = passes_any(without, left) && !passes_any(left, without);
      if (with_fewer.accepted().empty() || heals) return;
      engine = std::move(with_fewer);
      naming = std::move(fewer);
      left = std::move(without);
    }
  }

  // What names leave.
  Learning criticised(Engine& engine, Naming& naming) {
    Learning out;
    if (options_.stop()) return out;
    out.left = criticise_with_needed_scatter(engine, naming);
    name_until_settled(engine, naming, out.left);
    drop_what_heals_nothing(engine, naming, out.left);
    return out;
  }

  // What fails the tests is learned where it can be; with it the whole analysis anew, until nothing
  // changes.
  void learn_what_is_left(Engine& engine, Naming& naming, Learning& out) {
    if (out.left.passed() || options_.stop()) return;
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
    while (with_fewer.accepted().size() > 1 && !options_.stop()) {
      forget_last(with_fewer, fewer, options_.stop);
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
    const bool sensible = options_.may_learn && used_runs(engine.campaign()) >= kLearningRunsMin;
    for (int round = 0; round < kRoundsMax && sensible && !out.left.passed(); ++round) {
      Learning more = learn(
          engine, out.left, options_.stop,
          [&](const Engine& with, const LearnedFit& fit) { return predicts(with, naming, fit); });
      out.needs_levels = more.needs_levels;
      if (more.terms.empty()) break;
      out.left = std::move(more.left);
      for (Learned& each : more.terms) out.terms.push_back(std::move(each));
      const Engine before = engine;
      const Naming names_before = naming;
      const std::vector<Learned> terms_before = out.terms;
      name_anew(engine, naming, options_.stop);
      if (options_.stop() || engine.accepted() == before.accepted()) break;
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

  // A function that predicts what was left out of its fit clearly worse than none is none.
  static bool predicts(const Engine& engine, const Naming& naming, const LearnedFit& fit) {
    const auto shown = shown_by(left_out_gain(engine, naming.nominal, fit.folds, fit.is_inner),
                                fit.cell.injection->acts_on);
    if (!shown) return true;
    std::map<std::string, double> floors = noise_floors(engine.campaign(), naming.nominal.state);
    floors["mu_max"] = thresholds::kMuMaxTrifle;
    return !is_clearly_worse(shown->change, floors[shown->metric]);
  }

  const SearchOptions& options_;
  std::optional<Engine> other_ratio_;  // the machine with the other torque ratio, where one is seen
};

}  // namespace

std::size_t used_runs(const Campaign& campaign) {
  return static_cast<std::size_t>(
      std::count_if(campaign.runs.begin(), campaign.runs.end(),
                    [](const ExperimentData& run) { return run.valid_count > 0; }));
}

Found search(const Campaign& campaign, const SearchOptions& options) {
  return Search(options).run(campaign);
}

}  // namespace beltgrip::diagnose
