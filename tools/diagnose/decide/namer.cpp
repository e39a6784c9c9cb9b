#include "tools/diagnose/decide/namer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <set>

#include "estimator/statistics/distributions.h"
#include "tools/diagnose/decide/by_course.h"
#include "tools/diagnose/decide/rivals.h"
#include "tools/diagnose/decide/unknown.h"
#include "tools/diagnose/infer/conditions.h"
#include "tools/diagnose/infer/gain.h"
#include "tools/diagnose/infer/parallel.h"
#include "tools/diagnose/infer/scatter_base.h"
#include "tools/diagnose/infer/uncertainty.h"

namespace beltgrip::diagnose {
namespace {

// Chance of a name on data without an effect, and of an unknown cause.
constexpr double kFalseName = 0.005;
constexpr double kFalseUnknown = 0.005;
constexpr int kRefined = 9;           // candidates refitted per step
constexpr std::size_t kFromAfar = 5;  // of these, from afar
// Of these, fitted before what the next have to reach is asked. Chosen, for any number of threads:
// fewer keep fewer threads busy, more are fitted in vain. With 3 and 5 the bytes of 13 campaigns of
// other make are the same.
constexpr std::size_t kTogether = 4;
constexpr double kPlain = 2.0;      // times the threshold: no chance
constexpr double kFar = 1000.0;     // gain of a candidate: the machine alone is far from the data
constexpr double kGainMin = 4.0;    // chosen: of a candidate, two sigmas
constexpr double kNearShare = 0.4;  // chosen, of the linear loss, between kNear and kNearMax
constexpr double kNearMax = 400.0;
// Of the log evidence. Derived: e^-40 is a fiftieth of the last bit of a double (2^-52 = e^-36), so
// that what is less probable by so much adds nothing to a sum; a larger number adds nothing either.
// A fifth more or less: the same bytes in the 24 campaigns of tools/DIAGNOSE.md.
constexpr double kNothingBeside = 40.0;
constexpr std::size_t kNearest = 2;  // refitted however far: a shift is far from linear
constexpr double kNear = 40.0;       // linear loss within which a refit may still reach the best
constexpr int kEffectsMax = 3;
constexpr int kStepsMax = 4;
constexpr int kRounds = 3;
constexpr int kSettling = 20;     // steps of a fit whose effects are settled
constexpr int kGroupDegrees = 3;  // of a group of score_groups
constexpr double kPromotedOdds = 3.0;
constexpr int kPromotions = 2;
constexpr double kClassOdds = 200.0;  // worse by more: told apart; the class is to miss one in 100
// A further cause must matter beside those found: below this share of their evidence it is the
// difference between the found effect's equation and the machine.
constexpr double kShareOfFirst = 0.02;
// Of the gain: a name that explains as much is no such difference, be the first as large as it may.
constexpr double kOwnGain = 100.0, kOwnShare = 5e-4;
constexpr double kHeld = 0.5;
// Of what was stated of a sensor. As far as the gain of one torque against the other may be the
// sensors' own (kReach of the engine). A fifth less or more: the same in two healthy campaigns of
// other make that it is for (25, 174); more also in one whose spring is there (115).
constexpr double kStatedSigmas = 3.0;
constexpr double kOfConsequence = 0.1, kBelievable = 8.0;  // in usual sizes
// Log odds that what is of no consequence is there. How small it is says what it matters, not
// whether it is there; but what the form of the friction leaves in healthy machines is small as
// well. Measured, campaigns of other make: without it one of 102 healthy ones is named, at 5.9;
// nine that are there have 21 to 257. A fifth less or more lies between; not run.
constexpr double kSmallLnOdds = 12.0;
// Where something else is so much more probable that cannot be, for its size, neither is it.
constexpr double kUnlikely = 0.01;
constexpr double kDisagreement = 0.05;   // p of a size that experiments do not agree on
constexpr double kLeftOutMin = 0.0;      // of the log predictive density
constexpr double kLeftOutPlain = 200.0;  // the same: beyond doubt, however few experiments show it
// The same at the lower end of its interval over the experiments, nats. Derived: odds of 20 to 1,
// as of levels left out. A fifth less or more lies below what it was made for (16 and 17 nats in
// campaigns of other make).
constexpr double kLeftOutSure = 3.0;
// Chosen, times the threshold: sums of exponential variables have heavier tails than the normal.
constexpr double kRippleTail = 3.0;

constexpr std::array kConstants{
    kDeformationPerkN,     kDeformationPerkN2, kLossConstant_Nm,
    kLossPerSpeed_Nms,     kLossPerkN_Nm,      kLnRatioOverdrive,
    kLnRatioLow,           kSecondaryLoss_Nm,  kSecondaryLossPerSpeed_Nms,
    kSecondaryLossPerkN_Nm};

std::string_view id_of(const Engine& engine, int slot) {
  return engine.campaign().slots[static_cast<std::size_t>(slot)].row->id;
}

std::vector<int> plus(std::vector<int> set, int slot) {
  set.push_back(slot);
  return set;
}

// A ratio of friction hides in a curve at the low end stop that reaches its peak elsewhere, and no
// small step leads back from there: the state with the curve of the overdrive at both.
ModelState with_one_curve(const Engine& engine) {
  ModelState out = engine.state();
  Eigen::VectorXd& x = out.nuisance;
  const NuisanceTable& rows = engine.campaign().nuisances;
  x.segment(kShapeLow, kShapeKnots) = x.segment(kShapeOverdrive, kShapeKnots);
  x[kLnPeakSlipLow] =
      x[kLnPeakSlipOverdrive] + rows[kLnPeakSlipLow].nominal - rows[kLnPeakSlipOverdrive].nominal;
  return out;
}

// Where the curve is flat about its peak, both may have slid along it together: the state with the
// form that friction usually has and its peaks where they usually are.
ModelState with_usual_curve(const Engine& engine) {
  ModelState out = engine.state();
  for (const int p : engine.active_nuisances()) {
    const bool is_form = p >= kShapeOverdrive && p <= kEndOfShapes;
    if (is_form || p == kLnPeakSlipOverdrive || p == kLnPeakSlipLow) {
      out.nuisance[p] = engine.campaign().nuisances[static_cast<std::size_t>(p)].nominal;
    }
  }
  return out;
}

// The slots to refit: by gain and by significance, none that is barred.
std::vector<int> shortlist(const std::vector<Score>& scores, int count, double in_curve_max,
                           const std::vector<int>& barred) {
  std::vector<Score> by_gain = scores, by_chi2 = scores;
  std::sort(by_gain.begin(), by_gain.end(), [](auto& a, auto& b) { return a.gain > b.gain; });
  std::sort(by_chi2.begin(), by_chi2.end(), [](auto& a, auto& b) { return a.chi2 > b.chi2; });
  std::vector<int> out;
  for (std::size_t i = 0; i < scores.size() && static_cast<int>(out.size()) < count; ++i) {
    for (const Score* score : {&by_gain[i], &by_chi2[i]}) {
      if (score->gain > kGainMin && score->in_curve < in_curve_max &&
          std::find(barred.begin(), barred.end(), score->slot) == barred.end() &&
          std::find(out.begin(), out.end(), score->slot) == out.end()) {
        out.push_back(score->slot);
      }
    }
  }
  return out;
}

// By how much what a slot shifts in time may be late anyway; 0: it shifts nothing.
double age_of_shifted_s(const Campaign& campaign, const Slot& slot) {
  if (slot.row->unit != "s") return 0.0;
  double age_s = 0.0;
  for (const ExperimentData& run : campaign.runs) {
    const GridSignal& channel = slot.row->id == "torque_delay"   ? run.torque
                                : slot.role == "primary_speed"   ? run.omega_p
                                : slot.role == "secondary_speed" ? run.omega_s
                                : slot.role == "command"         ? run.command
                                                                 : run.pressure;
    age_s = std::max(age_s, channel.age_s);
  }
  return age_s;
}

// Half a step that the pressure rests on, in the unit of a slot that acts on pressure or force; 0:
// in another unit, or it rests on none. For as long as it rests, that is how far off the reading
// is.
double half_step(const Campaign& campaign, const Slot& slot) {
  double sigma_Pa = 0.0;
  for (const ExperimentData& run : campaign.runs) {
    sigma_Pa = std::max(sigma_Pa, run.rounding_pressure_Pa);
  }
  const double half_Pa = std::numbers::sqrt3 * sigma_Pa;
  return slot.row->unit == "Pa"  ? half_Pa
         : slot.row->unit == "N" ? campaign.variator.secondary_piston_area_m2 * half_Pa
                                 : 0.0;
}

// As much as a pressure that passes its steps is off by on the fastest ramp, in time: so late or
// early it may seem in all that pass the same steps. 0: it moves in none beyond its noise.
double late_of_passed_s(const Campaign& campaign) {
  double left_Pa = 0.0, fastest_Pa_s = 0.0;
  for (const ExperimentData& run : campaign.runs) {
    if (run.valid_count == 0) continue;
    left_Pa = std::max(left_Pa, run.left_of_rounding_Pa);
    fastest_Pa_s = std::max(fastest_Pa_s, conditions_of(run).rate_Pa_s);
  }
  return fastest_Pa_s > 0.0 ? left_Pa / fastest_Pa_s : 0.0;
}

bool shifts_pressure(const Slot& slot) {
  return slot.row->id == "hydraulic_lag" || slot.role == "secondary_pressure";
}

// What bends the machine out of its range only to make up for itself: a gain of the torque and a
// drag below zero, where the torque was never varied.
bool bends_machine(const Engine& engine, const Hypothesis& h) {
  constexpr double kTolerances = 3.5;
  const auto off = [&](const ModelState& state) {
    double squares = 0.0;
    for (const int p : kConstants) {
      const NuisanceRow& row = engine.campaign().nuisances[static_cast<std::size_t>(p)];
      squares += std::pow((state.nuisance[p] - row.nominal) / row.tolerance, 2.0);
    }
    return std::sqrt(squares);
  };
  return off(h.state) > std::max(kTolerances, off(engine.state()) + 1.0);
}

// The least clamp force of all samples that count, as configured.
double least_force_kN(const Campaign& campaign) {
  const estimator::VariatorParameters& variator = campaign.variator;
  double least_Pa = std::numeric_limits<double>::infinity();
  for (const ExperimentData& run : campaign.runs) {
    for (int k = 0; k < run.size(); ++k) {
      if (run.valid[static_cast<std::size_t>(k)]) {
        least_Pa = std::min(least_Pa, run.pressure.value[k]);
      }
    }
  }
  return 1e-3 * (variator.secondary_piston_area_m2 * least_Pa + variator.secondary_spring_force_N);
}

// Pulleys that open as the force falls are none: there the machine's own giving way, below zero,
// makes up for what the effect is said to be.
bool opens_with_less_force(const Engine& engine, const Hypothesis& h) {
  const Campaign& campaign = engine.campaign();
  double per_kN = h.state.nuisance[kDeformationPerkN];
  double per_kN2 = h.state.nuisance[kDeformationPerkN2];
  bool is_asked = false;
  for (const int slot : h.slots) {
    const EffectRow& row = *campaign.slots[static_cast<std::size_t>(slot)].row;
    if (row.id != "pulley_deformation") continue;
    is_asked = true;
    (row.parameter == "per_kN" ? per_kN : per_kN2) +=
        h.state.effects[slot] + campaign.switched_on[slot];
  }
  return is_asked && per_kN + 2.0 * per_kN2 * least_force_kN(campaign) < 0.0;
}

// A value that is held from one sample to the next is late by half the time between them, and one
// held from one step to the next is off by half a step: that much is no finding.
bool is_beyond_holding(const Engine& engine, int slot, double size) {
  const Slot& which = engine.campaign().slots[static_cast<std::size_t>(slot)];
  return std::abs(size) >= kHeld * age_of_shifted_s(engine.campaign(), which) &&
         std::abs(size) >= half_step(engine.campaign(), which) &&
         (!shifts_pressure(which) || std::abs(size) >= late_of_passed_s(engine.campaign()));
}

// One sigma of a constant error that was stated of the sensor whose error this slot is, in its
// unit; 0: nothing was.
double stated_sigma(const Campaign& campaign, const Slot& slot) {
  const auto of = [&](Role role) { return campaign.accuracies[static_cast<std::size_t>(role)]; };
  const std::string_view id = slot.row->id;
  if (id == "pressure_offset") return of(Role::kSecondaryPressure).bias;
  if (id == "spring_force") {
    return campaign.variator.secondary_piston_area_m2 * of(Role::kSecondaryPressure).bias;
  }
  if (id == "pressure_gain") return of(Role::kSecondaryPressure).gain;
  const bool is_engine = campaign.runs.size() > 0 && campaign.runs[0].torque_is_engine;
  const auto torque = of(is_engine ? Role::kEngineTorque : Role::kPrimaryTorque);
  if (id == "torque_bias") return torque.bias;
  // Against another torque the machine has a constant for it (kSecondaryTorqueGain).
  if (id == "torque_gain") return campaign.has_balance ? 0.0 : torque.gain;
  if (id == "speed_scale") {
    return of(slot.row->parameter == "primary" ? Role::kPrimarySpeed : Role::kSecondarySpeed).gain;
  }
  return 0.0;
}

// What a sensor may be off by, as stated, or any machine has, is no finding.
bool is_beyond_usual(const Engine& engine, int slot, double size) {
  const Slot& which = engine.campaign().slots[static_cast<std::size_t>(slot)];
  const double usual =
      which.is_play() ? kUsualPlay_N : kStatedSigmas * stated_sigma(engine.campaign(), which);
  return std::abs(size) >= usual;
}

bool is_of_consequence(const Engine& engine, int slot, double size) {
  const double typical = engine.campaign().slots[static_cast<std::size_t>(slot)].row->typical;
  return std::abs(size) > kOfConsequence * typical;
}

// Far below the usual size it has to stand out by more. ln_odds: that it is there.
bool is_worth_a_name(const Engine& engine, int slot, double size, double ln_odds) {
  return is_of_consequence(engine, slot, size) || ln_odds > kSmallLnOdds;
}

// A size that no machine has is one where the data do not hold the fit; no tilt shows at one
// torque, no delay of what is held.
bool credible(const Engine& engine, int slot, double size) {
  const Slot& which = engine.campaign().slots[static_cast<std::size_t>(slot)];
  const EffectRow& row = *which.row;
  if (!is_beyond_holding(engine, slot, size) || !is_beyond_usual(engine, slot, size)) return false;
  if (row.id == "radius_tilt" && !engine.campaign().torque_varies) return false;
  if (row.id == "torque_delay" && !engine.campaign().torque_moves) return false;
  const bool follows_pressure = which.is_play() || shifts_pressure(which);
  if (follows_pressure && !engine.campaign().pressure_moves) return false;
  const bool shifts_speed = row.id == "channel_skew" && !shifts_pressure(which);
  if (shifts_speed && !engine.campaign().speeds_move) return false;
  const double whole = engine.campaign().switched_on[slot] + size;
  const double least = least_size(engine.campaign(), slot);
  return std::abs(size) / row.typical < kBelievable && whole < row.high &&
         (whole > least || least == 0.0);
}

// Friction that falls from one experiment on and rises from another one on is no wear.
bool comes_back(const Engine& engine, const Hypothesis& h) {
  bool falls = false, rises = false;
  for (const int slot : h.slots) {
    if (!engine.campaign().slots[static_cast<std::size_t>(slot)].counts_experiments()) continue;
    (h.state.effects[slot] > 0.0 ? falls : rises) = true;
  }
  return falls && rises;
}

bool credible(const Engine& engine, const Hypothesis& h) {
  if (bends_machine(engine, h) || comes_back(engine, h) || opens_with_less_force(engine, h)) {
    return false;
  }
  return std::all_of(h.slots.begin(), h.slots.end(),
                     [&](int slot) { return credible(engine, slot, h.state.effects[slot]); });
}

double ln_sum(const std::vector<double>& ln_values) {
  const double top = *std::max_element(ln_values.begin(), ln_values.end());
  double sum = 0.0;
  for (const double v : ln_values) sum += std::exp(v - top);
  return top + std::log(sum);
}

// An effect's own dependence is no other cause: there its equation only has another shape.
bool is_own(const Engine& engine, const std::vector<int>& slots, const UnknownGroup& group) {
  return std::any_of(slots.begin(), slots.end(), [&](int slot) {
    const EffectRow& row = *engine.campaign().slots[static_cast<std::size_t>(slot)].row;
    return row.acts_on == group.acts_on &&
           row.depends_on.find(group.depends_on) != std::string_view::npos;
  });
}

// What follows the clamp force is tested and told, and no cause: in a ramp it is the friction curve
// by another name. Where all experiments are the same ramp, its time says no more than its force.
bool is_curve(const Campaign& campaign, const UnknownGroup& group) {
  return group.depends_on == "secondary_pressure" ||
         (group.depends_on == "time" && is_time_a_ramp(campaign));
}

// The group that explains what the best hypothesis cannot, if there is one.
std::optional<UnknownGroup> better_group(const Engine& engine, const Hypothesis& best, double gain,
                                         double threshold) {
  const double certainty = *std::min_element(best.chi2.begin(), best.chi2.end());
  for (UnknownGroup& group : score_groups(engine)) {  // by gain, falling
    group.limit = std::max(threshold, certainty);
    if (group.gain < gain + 2.0 * (kGroupDegrees - 1) + threshold + kShareOfFirst * gain) break;
    if (group.chi2 < group.limit || group.size < 1.0 || group.left_out_gain <= kLeftOutMin) {
      continue;
    }
    if (!is_curve(engine.campaign(), group) && !is_own(engine, best.slots, group)) return group;
  }
  return std::nullopt;
}

// The group explains something still when the best hypothesis is there, whose gain is more than the
// linear where the constants of the machine had made up for it.
bool outlasts(const Engine& engine, const Hypothesis& best, const UnknownGroup& group,
              double threshold) {
  Engine beside = engine;
  beside.accept(best);
  beside.update_noise();
  beside.accept(beside.refine(best.slots, kSettling));
  beside.update_noise();
  const std::vector<UnknownGroup> left = score_groups(beside);
  return std::any_of(left.begin(), left.end(), [&](const UnknownGroup& each) {
    return each.acts_on == group.acts_on && each.depends_on == group.depends_on &&
           each.gain > threshold && each.chi2 > threshold;
  });
}

// The better of both starts: the linear one may lead far along what the data hardly hold.
Hypothesis refine_replacement(const Engine& engine, const Engine::Replacement& start,
                              const std::vector<int>& slots, double worth) {
  Hypothesis linear = engine.refine_from(start.state, slots, Engine::kSteps, worth);
  Hypothesis beside = engine.refine_from(start.beside, slots, Engine::kSteps,
                                         std::max(worth, linear.log_likelihood));
  return linear.log_likelihood > beside.log_likelihood ? linear : beside;
}

// The runner-up that puts this slot beside the others; null: there is none.
const Hypothesis* runner_up(const Naming& naming, const std::vector<int>& others, int slot) {
  const auto found =
      std::find_if(naming.runners_up.begin(), naming.runners_up.end(), [&](const Hypothesis& each) {
        return each.slots.size() == others.size() + 1 && each.slots.back() == slot &&
               std::is_permutation(others.begin(), others.end(), each.slots.begin());
      });
  return found == naming.runners_up.end() ? nullptr : &*found;
}

// What the friction curve alone could do as well, however it runs, while it runs as friction does.
bool is_in_curve(const Naming& naming, int slot) {
  return Engine::curve_is_possible(naming.sharp.state) &&
         std::any_of(naming.last_screen.begin(), naming.last_screen.end(), [&](const Score& score) {
           return score.slot == slot && score.in_curve > kInCurveMax;
         });
}

// All experiments are the same ramp.
bool repeats_one(const Campaign& campaign) {
  const std::vector<int> groups = replicate_groups(campaign);
  for (std::size_t e = 0; e < groups.size(); ++e) {
    if (campaign.runs[e].valid_count > 0 && groups[e] != 0) return false;
  }
  return true;
}

// Whether the name `slot` stands beside this rival in its place. ln_odds: of the rival over
// nothing.
bool stands_beside(const Engine& engine, const Hypothesis& rival, int of_rival, bool in_curve,
                   double ln_odds, int slot) {
  const double size = rival.state.effects[of_rival];
  const Rival what{.is_no_name = in_curve || !is_beyond_holding(engine, of_rival, size) ||
                                 !is_beyond_usual(engine, of_rival, size) ||
                                 !is_worth_a_name(engine, of_rival, size, ln_odds),
                   .is_possible = credible(engine, rival),
                   .repeats_one = repeats_one(engine.campaign())};
  return stands_beside(what, [&] {
    const Hypothesis both = engine.refine_from(rival.state, plus(rival.slots, slot));
    return Beside{both.log_evidence - rival.log_evidence,
                  credible(engine, slot, both.state.effects[slot])};
  });
}

struct Promotion {
  Hypothesis hypothesis;
  double by_course;  // its log evidence, without what lies in no course of the residuals
  int slot, instead_of;
};

// Every accepted slot against every other slot in its place. What is more probable there by more
// than kPromotedOdds, if it is possible at all: it should have been accepted.
std::optional<Promotion> compare_classes(Engine& engine, Naming& naming,
                                         const std::function<bool()>& stop) {
  std::optional<Promotion> promoted;
  const std::vector<int>& set = engine.accepted();
  naming.accepted.clear();
  naming.hypothesis = engine.refine(set);
  const Hypothesis whole = naming.hypothesis;
  for (std::size_t j = 0; j < set.size(); ++j) {
    Accepted out;
    out.slot = set[j];
    out.chi2 = whole.chi2[j];
    out.left_out_gain = engine.left_out_gain(out.slot);
    std::vector<int> others = set;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(j));
    std::vector<std::pair<Engine::Replacement, int>> ranked;
    for (int slot = 0; slot < static_cast<int>(engine.campaign().slots.size()); ++slot) {
      if (std::find(set.begin(), set.end(), slot) == set.end()) ranked.push_back({{}, slot});
    }
    in_parallel(engine.jobs(), ranked.size(), [&](std::size_t i) {
      ranked[i].first = engine.replace(plus(others, ranked[i].second), out.slot);
    });
    std::sort(ranked.begin(), ranked.end(),
              [](const auto& a, const auto& b) { return a.first.gain > b.first.gain; });
    std::map<std::string_view, std::vector<double>> evidence;
    evidence[id_of(engine, out.slot)].push_back(whole.log_evidence);
    const Hypothesis without =
        refine_replacement(engine, engine.replace(others, out.slot), others, Engine::kAnyWorth);
    const double loss = std::max(0.0, whole.log_likelihood - without.log_likelihood) * 2.0;
    std::size_t near = 0;
    while (near < ranked.size() && near < kRefined &&
           (near < kNearest ||
            -ranked[near].first.gain <= std::clamp(kNearShare * loss, kNear, kNearMax))) {
      ++near;
    }
    // The way from the name's own optimum to that of another one may be barred by the curve's
    // bounds.
    for (std::size_t i = near; i < ranked.size(); ++i) {
      if (runner_up(naming, others, ranked[i].second)) std::swap(ranked[near++], ranked[i]);
    }
    std::vector<std::optional<Hypothesis>> rivals(near);
    in_parallel(engine.jobs(), near, [&](std::size_t i) {
      if (stop()) return;
      const std::vector<int> rival = plus(others, ranked[i].second);
      const double worth = whole.log_evidence - kNothingBeside;
      rivals[i] = refine_replacement(engine, ranked[i].first, rival, worth);
      if (const Hypothesis* known = runner_up(naming, others, ranked[i].second)) {
        Hypothesis again = engine.refine_from(known->state, rival, kSettling, worth);
        if (again.log_likelihood > rivals[i]->log_likelihood) rivals[i] = std::move(again);
      }
    });
    for (std::size_t i = 0; i < near; ++i) {
      const std::optional<Hypothesis>& rival = rivals[i];
      if (!rival || rival->is_given_up()) continue;
      const Hypothesis& other = *rival;
      if (parts_experiments(without.fit.scatter, other.fit.scatter)) continue;
      const bool in_curve = is_in_curve(naming, ranked[i].second);
      double by_course =
          other.log_evidence + ahead_by_noise(engine, out.slot, whole, ranked[i].second, other);
      // What the curve could do as well is no name, and leaves none in its place either way.
      if (in_curve) by_course = std::max(by_course, other.log_evidence);
      const double bar =
          promoted ? promoted->by_course : whole.log_evidence + std::log(kPromotedOdds);
      const double ln_odds = other.log_evidence - without.log_evidence;
      const bool stands =
          by_course > whole.log_evidence &&
          stands_beside(engine, other, ranked[i].second, in_curve, ln_odds, out.slot);
      if (by_course > bar && credible(engine, other) && !(in_curve && stands) &&
          is_worth_a_name(engine, ranked[i].second, other.state.effects[ranked[i].second],
                          ln_odds)) {
        promoted = Promotion{other, by_course, ranked[i].second, out.slot};
      }
      out.is_usual |=
          !is_beyond_usual(engine, ranked[i].second, other.state.effects[ranked[i].second]) &&
          by_course > whole.log_evidence - std::log(kClassOdds);
      if (stands) continue;
      evidence[id_of(engine, ranked[i].second)].push_back(by_course);
      if (id_of(engine, ranked[i].second) != id_of(engine, out.slot) &&
          by_course > whole.log_evidence - std::log(kClassOdds)) {
        out.aliases.push_back(ranked[i].second);
        if (credible(engine, other) && !in_curve) out.in_its_place.push_back(other);
      }
    }
    std::vector<double> all{without.log_evidence};
    for (const auto& [id, values] : evidence) all.push_back(ln_sum(values));
    out.ln_odds = whole.log_evidence - without.log_evidence;
    out.probability = std::exp(ln_sum(evidence[id_of(engine, out.slot)]) - ln_sum(all));
    naming.accepted.push_back(out);
  }
  return promoted;
}

// The fit of fewer slots. Where those that are gone had carried the machine's constants away, the
// way back leads from the nominal machine.
Hypothesis without_slot(const Engine& engine, const Naming& naming, const std::vector<int>& fewer) {
  ModelState start = naming.nominal.state;
  start.learned = engine.state().learned;
  for (const int kept : fewer) start.effects[kept] = engine.state().effects[kept];
  const Hypothesis from_here = engine.refine(fewer);
  const Hypothesis from_nominal =
      engine.refine_from(start, fewer, Engine::kSteps, from_here.log_likelihood);
  return from_here.log_likelihood > from_nominal.log_likelihood ? from_here : from_nominal;
}

// Takes a slot out again.
void drop(Engine& engine, const Naming& naming, int slot) {
  std::vector<int> fewer = engine.accepted();
  std::erase(fewer, slot);
  engine.accept(without_slot(engine, naming, fewer));
  engine.update_noise();
}

void find_classes(Engine& engine, Naming& naming, const std::function<bool()>& stop) {
  for (int i = 0; i < kPromotions; ++i) {
    const std::optional<Promotion> better = compare_classes(engine, naming, stop);
    if (!better || stop()) return;
    if (is_in_curve(naming, better->slot)) {
      naming.not_confirmed.push_back(better->instead_of);
      drop(engine, naming, better->instead_of);
    } else {
      engine.accept(better->hypothesis);
      engine.update_noise();
    }
  }
  compare_classes(engine, naming, stop);
}

void find_intervals(const Engine& engine, Naming& naming) {
  const Hypothesis& h = naming.hypothesis;
  const std::vector<Uncertainty> all = uncertainties(engine, h);
  for (Accepted& each : naming.accepted) {
    const auto at = std::find(h.slots.begin(), h.slots.end(), each.slot) - h.slots.begin();
    each.sigma = all[static_cast<std::size_t>(at)].sigma;
    each.degrees = all[static_cast<std::size_t>(at)].degrees;
    each.stability = all[static_cast<std::size_t>(at)].stability;
  }
}

// What the experiments do not agree on, or what is better left out, is no finding.
void drop_doubtful(Engine& engine, Naming& naming, const std::function<bool()>& stop) {
  while (!naming.accepted.empty() && !stop()) {
    const auto doubtful =
        std::find_if(naming.accepted.begin(), naming.accepted.end(), [&](const Accepted& each) {
          const double size = naming.hypothesis.state.effects[each.slot];
          // By the noise that it leaves, a name may be what chance gives.
          return each.chi2 < naming.threshold || each.ln_odds < std::log(kThereOdds) ||
                 each.is_usual || !credible(engine, each.slot, size) ||
                 !is_worth_a_name(engine, each.slot, size, each.ln_odds) ||
                 each.probability < kUnlikely ||
                 estimator::student_p(size / each.sigma, each.degrees) > kDisagreement;
        });
    if (doubtful == naming.accepted.end()) return;
    naming.not_confirmed.push_back(doubtful->slot);
    drop(engine, naming, doubtful->slot);
    find_classes(engine, naming, stop);
    find_intervals(engine, naming);
  }
}

// A constant of the machine by another name that fits better mostly by how it weighs the noise:
// null, none does.
std::optional<int> constant_by_noise(Engine& engine, const Naming& naming) {
  const std::vector<int>& set = engine.accepted();
  const Hypothesis whole = engine.refine(set, 3);
  for (const int slot : set) {
    if (!engine.is_constant(slot)) continue;
    std::vector<int> others = set;
    std::erase(others, slot);
    const Hypothesis without = without_slot(engine, naming, others);
    if (is_of_noise(engine, without, whole)) return slot;
  }
  return std::nullopt;
}

// An effect that does not help to predict experiments left out of the fit is none. One that is a
// constant of the machine under another name cannot help there: the constant's usual values alone
// tell it.
void drop_unconfirmed(Engine& engine, Naming& naming) {
  if (engine.summaries().size() < 3) return;
  for (;;) {
    if (const std::optional<int> slot = constant_by_noise(engine, naming)) {
      naming.not_confirmed.push_back(*slot);
      drop(engine, naming, *slot);
      continue;
    }
    const std::vector<int>& set = engine.accepted();
    std::vector<std::pair<double, int>> judged;  // gain of the log predictive density, slot
    for (const int slot : set) {
      if (!engine.is_constant(slot)) judged.emplace_back(engine.left_out_gain(slot), slot);
    }
    if (judged.empty()) return;
    const auto [density, slot] = *std::min_element(judged.begin(), judged.end());
    const Hypothesis whole = engine.refine(set, 3);
    const Gain gain = left_out_gain(engine, naming.sharp, whole.state, set);
    // A nominal curve that no friction has predicts as well as it was bent to; that it need not be
    // bent any more counts as much.
    const bool straightened =
        !Engine::curve_is_possible(naming.sharp.state) && Engine::curve_is_possible(whole.state);
    // What is small beside the scatter of each signal shows in none of them, and all the same in
    // all at once; of no consequence, it has to show in one. Where all experiments are the same
    // ramp, each stands in the others, with all that the machine misses, and where they differ by
    // more than they should, what is predicted is that: there this says nothing.
    const bool is_sure = gain.density && gain.density->low > kLeftOutSure &&
                         is_of_consequence(engine, slot, whole.state.effects[slot]) &&
                         !repeats_one(engine.campaign()) && !engine.scatters_unusually();
    // What shows in one or two experiments only is not beyond the chance of drawing them.
    const bool helps = gain.better() || straightened || is_sure || density > kLeftOutPlain;
    // One signal may be predicted a little worse where all at once are predicted better, beyond the
    // chance of drawing the experiments.
    const bool on_the_whole = gain.density && gain.density->low > 0.0;
    if (density > kLeftOutMin && helps &&
        (on_the_whole || !gain.worse(noise_floors(engine.campaign(), naming.sharp.state)))) {
      return;
    }
    naming.not_confirmed.push_back(slot);
    drop(engine, naming, slot);
  }
}

double worth_beside(double first_gain) {
  return std::min(kShareOfFirst * first_gain, kOwnGain + kOwnShare * first_gain);
}

// Members that the others, or what was learned, have made superfluous.
void drop_superfluous(Engine& engine, double threshold) {
  for (;;) {
    const Hypothesis whole = engine.refine(engine.accepted(), 3);
    const auto least = std::min_element(whole.chi2.begin(), whole.chi2.end());
    if (least == whole.chi2.end() || *least > threshold) return;
    std::vector<int> fewer = whole.slots;
    fewer.erase(fewer.begin() + (least - whole.chi2.begin()));
    engine.accept(engine.refine(fewer));
    engine.update_noise();
  }
}

// From the linear estimate, and where that leaves the range of the linear, from the present. What
// does not become worth it is given up.
Hypothesis fitted(Engine& engine, const std::vector<Score>& scores, const Hypothesis& base,
                  const std::vector<int>& candidate, bool afar, double worth) {
  const auto score = std::find_if(scores.begin(), scores.end(), [&](const Score& each) {
    return each.slot == candidate.back() && each.far;
  });
  std::optional<ModelState> begin;
  if (score != scores.end()) begin = score->far;
  Hypothesis h = engine.refine_from(begin ? *begin : engine.add(candidate).state, candidate,
                                    Engine::kSteps, worth);
  const auto or_better = [&](Hypothesis other) {
    if (other.log_likelihood > h.log_likelihood) h = std::move(other);
  };
  const auto better = [&] { return std::max(worth, h.log_likelihood); };
  if (h.log_likelihood < base.log_likelihood) {
    or_better(engine.refine(candidate, Engine::kSteps, better()));
  }
  if (afar) or_better(engine.refine_from_afar(candidate, better()));
  if (id_of(engine, candidate.back()) == "friction_ratio") {
    or_better(engine.refine_from(with_one_curve(engine), candidate, Engine::kSteps, better()));
    // Once, as it goes to its end: along a flat curve each step gains little.
    if (candidate.size() == 1) {
      or_better(engine.refine_from(with_usual_curve(engine), candidate, kSettling));
    }
  }
  return h;
}

// What the new one, the last, makes superfluous goes out.
Hypothesis without_superfluous(Engine& engine, Hypothesis fit, double threshold) {
  std::vector<int> left;
  for (std::size_t j = 0; j < fit.slots.size(); ++j) {
    if (fit.chi2[j] > threshold) left.push_back(fit.slots[j]);
  }
  const bool swaps = fit.chi2.back() > threshold && left.size() < fit.slots.size();
  return swaps ? engine.refine_from(fit.state, left, kSettling) : fit;
}

// What is refined at this step. scattered: experiments differ by more than replicates do.
std::vector<int> candidates_of(Engine& engine, const std::vector<Score>& scores,
                               double in_curve_max, bool scattered,
                               const std::vector<int>& not_confirmed) {
  std::vector<int> candidates = shortlist(scores, kRefined, in_curve_max, not_confirmed);
  // Whatever its derivative says.
  for (const Score& score : scores) {
    const auto is_here = [&](const std::vector<int>& slots) {
      return std::find(slots.begin(), slots.end(), score.slot) != slots.end();
    };
    if (id_of(engine, score.slot) == "friction_ratio" && !is_here(candidates) &&
        !is_here(not_confirmed)) {
      candidates.push_back(score.slot);
    }
  }
  if (scattered) {
    const std::vector<int> usual =
        shortlist(engine.screen_with_usual_scatter(), static_cast<int>(kFromAfar), in_curve_max,
                  not_confirmed);
    std::erase_if(candidates, [&](int slot) {
      return std::find(usual.begin(), usual.end(), slot) != usual.end();
    });
    candidates.insert(candidates.begin(), usual.begin(), usual.end());
  }
  return candidates;
}

// Pairs of different effects by their gain on the present matrices, the largest first.
std::vector<std::pair<double, std::vector<int>>> pairs_of(Engine& engine,
                                                          const std::vector<int>& candidates) {
  std::vector<std::pair<double, std::vector<int>>> pairs;
  for (std::size_t a = 0; a < candidates.size(); ++a) {
    for (std::size_t b = a + 1; b < candidates.size(); ++b) {
      if (id_of(engine, candidates[a]) == id_of(engine, candidates[b])) continue;
      const std::vector<int> pair{candidates[a], candidates[b]};
      pairs.emplace_back(engine.add(pair).gain, pair);
    }
  }
  std::sort(pairs.rbegin(), pairs.rend());
  return pairs;
}

// Adds to the accepted effects as long as any is there. first_gain: the largest so far.
void add_effects(Engine& engine, Naming& out, double& first_gain,
                 const std::function<bool()>& stop) {
  // A member may be dropped again: the number of steps is bounded, not only that of effects.
  for (int step = 0; step < kStepsMax && !stop(); ++step) {
    if (static_cast<int>(engine.accepted().size()) >= kEffectsMax) break;
    const std::vector<Score> scores = engine.screen();
    out.last_screen = scores;
    const std::vector<int> set = engine.accepted();
    const Hypothesis base = engine.refine(set, 3);
    // So far from the data, or with a curve that no friction has, the linear says little of where
    // an effect would lead.
    const bool possible = Engine::curve_is_possible(engine.state());
    // The same where experiments differ by more than replicates do.
    const bool scattered = engine.scatters_unusually();
    const bool far = !possible || scattered ||
                     std::any_of(scores.begin(), scores.end(),
                                 [](const Score& score) { return score.gain > kFar; });
    Hypothesis best;
    std::vector<Hypothesis> considered;
    bool found = false;
    const double gain_least = std::max(out.threshold, worth_beside(first_gain));
    const double worth = base.log_likelihood + 0.5 * gain_least;
    // What a curve could do that runs as friction does. A ratio of friction is none, whatever its
    // derivative says: the curve's form is one for both end stops.
    const auto is_of_curve = [&](int slot) {
      return possible && id_of(engine, slot) != "friction_ratio" &&
             std::any_of(scores.begin(), scores.end(), [&](const Score& score) {
               return score.slot == slot && score.in_curve >= kInCurveMax;
             });
    };
    const auto consider = [&](Hypothesis h) {
      const double gain = 2.0 * (h.log_likelihood - base.log_likelihood);
      for (const double chi2 : h.chi2) {
        if (!(chi2 > out.threshold)) return;
      }
      if (!credible(engine, h)) return;
      const int last = h.slots.back();
      if (!is_worth_a_name(engine, last, h.state.effects[last], h.log_evidence - base.log_evidence))
        return;
      if (parts_experiments(base.fit.scatter, h.fit.scatter)) return;
      if (gain < gain_least) return;
      if (is_of_curve(last) && !gathers_experiments(base.fit.scatter, h.fit.scatter)) return;
      considered.push_back(h);
      if (!found || h.log_evidence > best.log_evidence) {
        best = std::move(h);
        found = true;
      }
    };
    // Whatever it is, the friction curve is one for all experiments: it brings none together.
    const double in_curve_max = possible && !scattered ? kInCurveMax : 2.0;
    const std::vector<int> candidates =
        candidates_of(engine, scores, in_curve_max, scattered, out.not_confirmed);
    // What has less than the best by more than the odds of a class is no rival of it: a log
    // evidence is no more than the log likelihood, the sizes only cost. Beside accepted effects it
    // may be more once one of those has gone out (without_superfluous).
    const auto worth_now = [&] {
      return found && set.empty() ? std::max(worth, best.log_evidence - std::log(kClassOdds))
                                  : worth;
    };
    const auto consider_all = [&](bool from_afar) {
      for (std::size_t first = 0; first < candidates.size(); first += kTogether) {
        std::vector<std::optional<Hypothesis>> fits(std::min(kTogether, candidates.size() - first));
        const double reach = worth_now();
        in_parallel(engine.jobs(), fits.size(), [&](std::size_t i) {
          if (stop()) return;
          fits[i] = fitted(engine, scores, base, plus(set, candidates[first + i]),
                           from_afar && first + i < kFromAfar, reach);
        });
        for (std::optional<Hypothesis>& fit : fits) {
          if (!fit || fit->is_given_up()) continue;
          consider(without_superfluous(engine, std::move(*fit), out.threshold));
        }
      }
    };
    consider_all(far);
    // Something is there, but no way leads to it from here.
    const bool plain = std::any_of(scores.begin(), scores.end(), [&](const Score& score) {
      return score.chi2 > kPlain * out.threshold && (!possible || score.in_curve < kInCurveMax);
    });
    if (!found && !far && plain) consider_all(true);
    if (!found) break;
    // To its end, before anything is compared with it.
    best = engine.refine_from(best.state, best.slots, kSettling);
    // A pair whose sum a third effect imitates: all pairs, linear, on the present matrices.
    if (set.empty()) {
      const auto pairs = pairs_of(engine, candidates);
      const double single = 2.0 * (best.log_likelihood - base.log_likelihood);
      for (std::size_t i = 0; i < pairs.size() && i < 3 && !stop(); ++i) {
        if (pairs[i].first < single + out.threshold + worth_beside(single)) break;
        consider(fitted(engine, scores, base, pairs[i].second, false, worth));
      }
    }
    const double gain = 2.0 * (best.log_likelihood - base.log_likelihood);
    // A smooth dependence on a recorded variable that explains clearly more than any name is no
    // effect of the library: a name would be wrong, and so would those built on it.
    if (const auto better = better_group(engine, best, gain, out.threshold);
        better && outlasts(engine, best, *better, out.threshold)) {
      out.unknown = better;
      break;
    }
    first_gain = std::max(first_gain, gain);
    std::erase_if(considered, [&](const Hypothesis& each) {
      return each.log_evidence < best.log_evidence - std::log(kClassOdds) ||
             each.slots.back() == best.slots.back();
    });
    out.runners_up = std::move(considered);
    engine.accept(best);
    engine.update_noise();
    engine.accept(engine.refine(engine.accepted(), kSettling));
    engine.update_noise();
    if (engine.accepted().size() > 1) drop_superfluous(engine, out.threshold);
  }
}

}  // namespace

std::vector<Ripple> find_ripples(const Campaign& campaign, double threshold) {
  OrderLine primary, secondary;
  for (const ExperimentData& run : campaign.runs) {
    primary.add(run.line_p);
    secondary.add(run.line_s);
  }
  std::vector<Ripple> out;
  for (const auto& [shaft, line] : {std::pair{"primary", primary}, {"secondary", secondary}}) {
    // What the model knows of is no news, unless it is of another size.
    const auto known = campaign.known_ripples.find(shaft);
    const bool is_known = known != campaign.known_ripples.end();
    const double beyond = line.amplitude() - (is_known ? known->second : 0.0);
    // Some experiments may show a line that others do not: the amplitude's own scatter tells.
    const double sigmas = beyond / std::max(line.amplitude_sigma(), 1e-12);
    const double chi2 = is_known ? sigmas * sigmas : line.chi2();
    out.push_back({shaft, line.amplitude(), line.amplitude_sigma(), chi2,
                   std::min(chi2, sigmas * sigmas) > kRippleTail * threshold});
  }
  return out;
}

double chance_threshold(int candidates, double probability) {
  const double target = probability / std::max(candidates, 1);
  double low = 0.0, high = 200.0;
  for (int i = 0; i < 80; ++i) {
    const double middle = 0.5 * (low + high);
    (std::erfc(std::sqrt(middle / 2.0)) > target ? low : high) = middle;
  }
  return low;
}

namespace {
// Returns the largest gain of one.
double find_effects(Engine& engine, Naming& out, const std::function<bool()>& stop) {
  double first_gain = 0.0;
  // What left-out experiments do not confirm may have stood before what they would.
  for (int round = 0; round < kRounds && !stop(); ++round) {
    const std::size_t dropped = out.not_confirmed.size();
    first_gain = 0.0;
    add_effects(engine, out, first_gain, stop);
    if (!stop()) out.last_screen = engine.screen();
    drop_unconfirmed(engine, out);
    if (out.not_confirmed.size() == dropped || out.unknown) break;
  }
  find_classes(engine, out, stop);
  find_intervals(engine, out);
  drop_doubtful(engine, out, stop);
  return first_gain;
}
}  // namespace

void forget_names(Engine& engine, Naming& naming) {
  engine.bound_scatter(default_scatter().most);
  engine.accept(engine.refine_from(naming.sharp.state, {}, kSettling));
  engine.update_noise();
  naming.accepted.clear();
  naming.unknown.reset();
  naming.hypothesis = engine.refine({}, 3);
  naming.last_screen = engine.screen();
}

void forget_last(Engine& engine, Naming& naming, const std::function<bool()>& stop) {
  const int last = engine.accepted().back();
  naming.not_confirmed.push_back(last);
  drop(engine, naming, last);
  find_classes(engine, naming, stop);
  find_intervals(engine, naming);
  drop_doubtful(engine, naming, stop);
}

void name_anew(Engine& engine, Naming& naming, const std::function<bool()>& stop) {
  naming.unknown.reset();
  drop_superfluous(engine, naming.threshold);
  find_effects(engine, naming, stop);
}

Naming name_effects(Engine& engine, const std::function<bool()>& stop) {
  engine.fit_machine();
  return name_fitted(engine, stop);
}

Naming name_fitted(Engine& engine, const std::function<bool()>& stop) {
  Naming out;
  out.threshold = chance_threshold(static_cast<int>(engine.campaign().slots.size()), kFalseName);
  out.ripples = find_ripples(engine.campaign(), out.threshold);
  engine.update_noise();
  for (int i = 0; i < 2; ++i) {
    engine.accept(engine.refine({}, kSettling));
    engine.update_noise();
  }
  out.sharp = {engine.state(), engine.campaign().noise, true};
  out.nominal = engine.nominal_from(engine.state());
  out.nominal_groups = score_groups(engine);
  const double first_gain = find_effects(engine, out, stop);
  if (stop() || out.unknown) return out;

  // What is left: any cause? An effect that it makes superfluous was only its shadow.
  for (;;) {
    const std::vector<UnknownGroup> groups = score_groups(engine);
    const double bound = chance_threshold(static_cast<int>(groups.size()), kFalseUnknown);
    const auto left = std::find_if(groups.begin(), groups.end(), [&](const UnknownGroup& group) {
      return group.chi2 > bound && group.gain > bound && group.gain > kShareOfFirst * first_gain &&
             group.size > 1.0 && group.left_out_gain > kLeftOutMin &&
             !is_curve(engine.campaign(), group) && !is_own(engine, engine.accepted(), group);
    });
    if (left == groups.end()) return out;
    out.unknown = *left;
    out.unknown->limit = bound;
    const std::vector<int> set = engine.accepted();
    std::vector<int> kept;
    for (std::size_t i = 0; i < set.size(); ++i) {
      if (left->accepted_chi2[i] > out.threshold) kept.push_back(set[i]);
    }
    if (kept.size() == set.size() || stop()) return out;
    engine.accept(engine.refine(kept));
    engine.update_noise();
    find_classes(engine, out, stop);
    find_intervals(engine, out);
  }
}

}  // namespace beltgrip::diagnose
