#include "tools/diagnose/run/next_experiment.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "can_dbc/text/number_text.h"
#include "tools/diagnose/decide/next_ramp.h"
#include "tools/diagnose/decide/recipe.h"
#include "tools/diagnose/decide/thresholds.h"
#include "tools/diagnose/infer/conditions.h"

namespace beltgrip::diagnose {
namespace {

constexpr std::size_t kRivalsMost = 3;  // chosen: the most probable of a class
constexpr std::size_t kWantedMost = 6;  // chosen: of what these data do not show
constexpr int kRepeatsAsked = 3;        // of the first experiment, beside it
constexpr double kOddsTold = 1000.0;    // more are told as so many

class Proposal {
 public:
  Proposal(const Engine& engine, const Naming& naming, const Learning& learning, const Diagnosis& d,
           const LeftOpen& open)
      : engine_(engine), naming_(naming), learning_(learning), d_(d), open_(open) {}

  std::optional<Recipe> made() const {
    if (auto told = of_a_class()) return told;
    if (auto told = of_laws()) return told;
    if (d_.unexplained) return of_the_unexplained(*d_.unexplained);
    if (engine_.campaign().runs.size() < kExperimentsMin) {
      return like_first(Varied::kRepeat,
                        "repeat the reference three times: how experiments scatter is not known");
    }
    return of_the_unseen();
  }

 private:
  Recipe told(const Ramp& ramp, const std::string& why) const {
    return recipe(engine_.campaign().variator, ramp, why);
  }
  Recipe like_first(Varied varied, const std::string& why) const {
    return told(ramp_like_first(engine_.campaign(), naming_.hypothesis.state, varied), why);
  }
  std::string_view id_of(int slot) const {
    return engine_.campaign().slots[static_cast<std::size_t>(slot)].row->id;
  }

  // Between a name and what fits as well in its place.
  std::optional<Recipe> of_a_class() const {
    for (const Accepted& each : naming_.accepted) {
      const std::string_view name = id_of(each.slot);
      const bool is_told = std::any_of(d_.findings.begin(), d_.findings.end(),
                                       [&](const Finding& f) { return f.effect == name; });
      if (!is_told || each.in_its_place.empty()) continue;
      std::vector<Hypothesis> rivals{naming_.hypothesis};
      rivals.insert(rivals.end(), each.in_its_place.begin(), each.in_its_place.end());
      std::sort(rivals.begin() + 1, rivals.end(), [](const Hypothesis& a, const Hypothesis& b) {
        return a.log_evidence > b.log_evidence;
      });
      rivals.resize(std::min(rivals.size(), kRivalsMost));
      const auto next = tell_apart(engine_, rivals);
      if (!next) continue;
      const double odds = std::min(std::exp(next->nats), kOddsTold);
      return told(next->ramp,
                  "to tell " + std::string(name) + " from " + others(rivals) + " (odds of " +
                      (odds < kOddsTold ? rounded_text(odds, 2) : "a thousand and more") +
                      " to 1 are expected)");
    }
    return std::nullopt;
  }

  // What the rivals behind the first have that it has not.
  std::string others(const std::vector<Hypothesis>& rivals) const {
    std::vector<std::string> names;
    const std::vector<int>& first = rivals.front().slots;
    for (std::size_t i = 1; i < rivals.size(); ++i) {
      for (const int slot : rivals[i].slots) {
        const std::string name(id_of(slot));
        if (std::find(first.begin(), first.end(), slot) == first.end() &&
            std::find(names.begin(), names.end(), name) == names.end()) {
          names.push_back(name);
        }
      }
    }
    std::string out;
    for (const std::string& name : names) out += (out.empty() ? "" : " and ") + name;
    return out;
  }

  // Of a function that several laws fit: one more level tells most of them.
  std::optional<Recipe> of_laws() const {
    for (const LearnedFinding& each : d_.learned) {
      if (each.laws.size() < 2 || each.depends_on.empty()) continue;
      return like_first(varied_by(each.depends_on.front()),
                        "to tell " + each.laws[0] + " from " + each.laws[1] +
                            ": a further level of " + each.depends_on.front());
    }
    return std::nullopt;
  }

  Recipe of_the_unexplained(const Unexplained& left) const {
    if (!learning_.needs_levels.empty()) {
      return like_first(varied_by(learning_.needs_levels),
                        "a further level of " + learning_.needs_levels +
                            ", of which nothing is learned below " +
                            std::to_string(thresholds::kLevelsMin));
    }
    if (left.kind == MisfitKind::kFunction && !left.depends_on.empty()) {
      const std::string& follows = left.depends_on.front();
      const Varied varied = varied_by(follows);
      if (follows.starts_with("direction of ")) {
        return like_first(varied,
                          "down and up once more, by another rate: it follows the " + follows);
      }
      // Nobody sets the time, nor which experiment it is.
      return like_first(varied, varied == Varied::kRepeat
                                    ? "repeat the reference: does it follow " + follows + " again"
                                    : "a further level of " + follows);
    }
    if (repeats_of_first(engine_.campaign()) <= kRepeatsAsked) {
      return like_first(Varied::kRepeat, "repeat the reference: is it the same every time");
    }
    return like_first(least_varied(engine_.campaign()),
                      "the reference was repeated: does it change with this");
  }

  // What these data do not show, by what it would be worth to mu_max, or else by itself.
  std::optional<Recipe> of_the_unseen() const {
    std::vector<WantedSlot> wanted;
    for (const Score& score : naming_.last_screen) {
      const std::string_view id = id_of(score.slot);
      double weight = 0.0;
      for (const LeftOpen::Share& each : open_.by_effect) {
        if (each.effect == id) weight = each.variance / open_.by_effect.front().variance;
      }
      const bool is_unseen =
          std::any_of(d_.not_identifiable.begin(), d_.not_identifiable.end(),
                      [&](const NotIdentifiable& each) { return each.effect == id; });
      if (open_.by_effect.empty() && is_unseen) weight = 1.0;
      if (weight > 0.0) wanted.push_back({score.slot, weight});
    }
    std::stable_sort(wanted.begin(), wanted.end(),
                     [](const WantedSlot& a, const WantedSlot& b) { return a.weight > b.weight; });
    wanted.resize(std::min(wanted.size(), kWantedMost));
    const auto next = look_for(engine_, wanted);
    if (open_.by_effect.empty()) {
      if (next) return told(next->ramp, "to see " + std::string(id_of(next->slot)));
    } else {
      const std::string first(open_.by_effect.front().effect);
      const std::string most =
          open_share(open_.by_effect.front()) + ", which leaves most of mu_max open";
      // What a free form of the curve could be as well: no matrix says what shows it.
      if (!next) return like_first(varied_by(follows(first)), "to see " + most);
      const std::string shown(id_of(next->slot));
      return told(next->ramp, "to see " + (shown == first ? "" : shown + " and ") + most);
    }
    if (has_one_stop() &&
        std::any_of(d_.not_identifiable.begin(), d_.not_identifiable.end(),
                    [](const NotIdentifiable& each) { return follows(each.effect) == "ratio"; })) {
      return like_first(Varied::kEndStop, "to see what differs at the other end stop");
    }
    return std::nullopt;
  }

  static std::string_view follows(const std::string& effect) {
    const auto row = std::find_if(effect_rows().begin(), effect_rows().end(),
                                  [&](const EffectRow& each) { return each.id == effect; });
    return row == effect_rows().end() ? std::string_view() : row->depends_on;
  }

  bool has_one_stop() const {
    std::array<bool, kStops> seen{};
    for (const ExperimentData& run : engine_.campaign().runs) {
      if (run.valid_count == 0) continue;
      const int stop = conditions_of(run).stop;
      if (stop != kNoStop) seen[static_cast<std::size_t>(stop)] = true;
    }
    return seen[kOverdriveStop] != seen[kLowStop];
  }

  const Engine& engine_;
  const Naming& naming_;
  const Learning& learning_;
  const Diagnosis& d_;
  const LeftOpen& open_;
};

}  // namespace

std::optional<Recipe> next_experiment(const Engine& engine, const Naming& naming,
                                      const Learning& learning, const Diagnosis& d,
                                      const LeftOpen& open) {
  return Proposal(engine, naming, learning, d, open).made();
}

}  // namespace beltgrip::diagnose
