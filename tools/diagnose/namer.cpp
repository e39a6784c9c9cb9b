#include "tools/diagnose/namer.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>

#include "tools/diagnose/unknown.h"

namespace beltgrip::diagnose {
namespace {

// Chance of a name on data without an effect, and of an unknown cause.
constexpr double kFalseName = 0.005;
constexpr double kFalseUnknown = 0.005;
constexpr int kRefined = 14;  // candidates refitted per step
constexpr int kEffectsMax = 3;
constexpr double kClassOdds = 20.0;  // worse by more: told apart
// A further cause must matter beside those found: below this share of their evidence it is the
// difference between the found effect's equation and the machine.
constexpr double kShareOfFirst = 0.02;

std::string_view id_of(const Engine& engine, int slot) {
  return engine.campaign().slots[static_cast<std::size_t>(slot)].row->id;
}

std::vector<int> plus(std::vector<int> set, int slot) {
  set.push_back(slot);
  return set;
}

// The slots to refit: by gain and by significance.
std::vector<int> shortlist(const std::vector<Score>& scores, int count) {
  std::vector<Score> by_gain = scores, by_chi2 = scores;
  std::sort(by_gain.begin(), by_gain.end(), [](auto& a, auto& b) { return a.gain > b.gain; });
  std::sort(by_chi2.begin(), by_chi2.end(), [](auto& a, auto& b) { return a.chi2 > b.chi2; });
  std::vector<int> out;
  for (std::size_t i = 0; i < scores.size() && static_cast<int>(out.size()) < count; ++i) {
    for (const Score* score : {&by_gain[i], &by_chi2[i]}) {
      if (score->gain > 4.0 && std::find(out.begin(), out.end(), score->slot) == out.end()) {
        out.push_back(score->slot);
      }
    }
  }
  return out;
}

double ln_sum(const std::vector<double>& ln_values) {
  const double top = *std::max_element(ln_values.begin(), ln_values.end());
  double sum = 0.0;
  for (const double v : ln_values) sum += std::exp(v - top);
  return top + std::log(sum);
}

// Every accepted slot against every other slot in its place.
void find_classes(Engine& engine, Naming& naming, const std::function<bool()>& stop) {
  const std::vector<int>& set = engine.accepted();
  naming.accepted.clear();
  naming.hypothesis = engine.refine(set);
  const Hypothesis whole = naming.hypothesis;
  for (std::size_t j = 0; j < set.size(); ++j) {
    Accepted out;
    out.slot = set[j];
    out.chi2 = whole.chi2[j];
    std::vector<int> others = set;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(j));
    std::vector<std::pair<Engine::Replacement, int>> ranked;
    for (int slot = 0; slot < static_cast<int>(engine.campaign().slots.size()); ++slot) {
      if (std::find(set.begin(), set.end(), slot) != set.end()) continue;
      ranked.emplace_back(engine.replace(plus(others, slot), out.slot), slot);
    }
    std::sort(ranked.begin(), ranked.end(),
              [](const auto& a, const auto& b) { return a.first.gain > b.first.gain; });
    std::map<std::string_view, std::vector<double>> evidence;
    evidence[id_of(engine, out.slot)].push_back(whole.log_evidence);
    const Hypothesis without = engine.refine_from(engine.replace(others, out.slot).state, others);
    for (std::size_t i = 0; i < ranked.size() && i < kRefined && !stop(); ++i) {
      const Hypothesis other =
          engine.refine_from(ranked[i].first.state, plus(others, ranked[i].second));
      evidence[id_of(engine, ranked[i].second)].push_back(other.log_evidence);
      if (id_of(engine, ranked[i].second) != id_of(engine, out.slot) &&
          other.log_evidence > whole.log_evidence - std::log(kClassOdds)) {
        out.aliases.push_back(ranked[i].second);
      }
    }
    std::vector<double> all{without.log_evidence};
    for (const auto& [id, values] : evidence) all.push_back(ln_sum(values));
    out.probability = std::exp(ln_sum(evidence[id_of(engine, out.slot)]) - ln_sum(all));
    naming.accepted.push_back(out);
  }
}

}  // namespace

double chance_threshold(int candidates, double probability) {
  const double target = probability / std::max(candidates, 1);
  double low = 0.0, high = 200.0;
  for (int i = 0; i < 80; ++i) {
    const double middle = 0.5 * (low + high);
    (std::erfc(std::sqrt(middle / 2.0)) > target ? low : high) = middle;
  }
  return low;
}

Naming name_effects(Engine& engine, const std::function<bool()>& stop) {
  Naming out;
  out.threshold = chance_threshold(static_cast<int>(engine.campaign().slots.size()), kFalseName);
  engine.fit_machine();
  engine.update_noise();
  for (int i = 0; i < 2; ++i) {
    engine.accept(engine.refine({}));
    engine.update_noise();
  }
  out.nominal = engine.state();
  out.nominal_groups = score_groups(engine);
  double first_gain = 0.0;
  while (static_cast<int>(engine.accepted().size()) < kEffectsMax && !stop()) {
    const std::vector<Score> scores = engine.screen();
    out.last_screen = scores;
    const std::vector<int> set = engine.accepted();
    const Hypothesis base = engine.refine(set, 3);
    Hypothesis best;
    bool found = false;
    const auto consider = [&](const std::vector<int>& candidate) {
      Hypothesis h = engine.refine(candidate);
      const double gain = 2.0 * (h.log_likelihood - base.log_likelihood);
      for (const double chi2 : h.chi2) {
        if (!(chi2 > out.threshold)) return;
      }
      if (gain < out.threshold || (first_gain > 0.0 && gain < kShareOfFirst * first_gain)) return;
      if (!found || h.log_evidence > best.log_evidence) {
        best = std::move(h);
        found = true;
      }
    };
    const std::vector<int> candidates = shortlist(scores, kRefined);
    for (const int slot : candidates) {
      if (stop()) break;
      consider(plus(set, slot));
    }
    if (!found) break;
    // A pair whose sum a third effect imitates: all pairs, linear, on the present matrices.
    if (set.empty()) {
      std::vector<std::pair<double, std::vector<int>>> pairs;
      for (std::size_t a = 0; a < candidates.size(); ++a) {
        for (std::size_t b = a + 1; b < candidates.size(); ++b) {
          if (id_of(engine, candidates[a]) == id_of(engine, candidates[b])) continue;
          const std::vector<int> pair{candidates[a], candidates[b]};
          pairs.emplace_back(engine.linear_gain(pair), pair);
        }
      }
      std::sort(pairs.rbegin(), pairs.rend());
      const double single = 2.0 * (best.log_likelihood - base.log_likelihood);
      for (std::size_t i = 0; i < pairs.size() && i < 3 && !stop(); ++i) {
        if (pairs[i].first < single + out.threshold + kShareOfFirst * single) break;
        consider(pairs[i].second);
      }
    }
    const double gain = 2.0 * (best.log_likelihood - base.log_likelihood);
    first_gain = std::max(first_gain, gain);
    engine.accept(best);
    engine.update_noise();
    engine.accept(engine.refine(engine.accepted()));
    engine.update_noise();
    // Members that the others have made superfluous.
    bool removed = true;
    while (removed && engine.accepted().size() > 1) {
      removed = false;
      const Hypothesis whole = engine.refine(engine.accepted(), 3);
      for (std::size_t j = 0; j < whole.slots.size(); ++j) {
        if (whole.chi2[j] > out.threshold) continue;
        std::vector<int> fewer = whole.slots;
        fewer.erase(fewer.begin() + static_cast<std::ptrdiff_t>(j));
        engine.accept(engine.refine(fewer));
        engine.update_noise();
        removed = true;
        break;
      }
    }
  }
  if (!stop()) out.last_screen = engine.screen();
  find_classes(engine, out, stop);
  if (stop()) return out;

  // What is left: any cause?
  const std::vector<UnknownGroup> groups = score_groups(engine);
  const double bound = chance_threshold(static_cast<int>(groups.size()), kFalseUnknown);
  for (const UnknownGroup& group : groups) {
    if (group.chi2 > bound && group.gain > bound && group.gain > kShareOfFirst * first_gain &&
        group.size > 1.0) {
      out.unknown = group;
      break;
    }
  }
  return out;
}

}  // namespace beltgrip::diagnose
