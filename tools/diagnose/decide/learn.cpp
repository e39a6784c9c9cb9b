#include "tools/diagnose/decide/learn.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string_view>

#include "tools/diagnose/decide/needed_scatter.h"
#include "tools/diagnose/decide/thresholds.h"

namespace beltgrip::diagnose {
namespace {

using thresholds::kLearnedBound;

bool stands_out(const Cell& cell, const Criticism& failed, bool has_balance) {
  using namespace thresholds;
  if (cell.smooth_gain > failed.test("smooth_cell").limit) return true;
  if (cell.law_gain > failed.test("law_cell").limit && cell.smooth_gain > kSmoothBeside) {
    return true;
  }
  if (&cell == &failed.cells.front() && held_gain(cell) > failed.test("held_cell").limit) {
    return true;
  }
  return may_be_scatter(cell, failed, has_balance);
}

// The cells to try, the best first. What follows something that no model file can name, far better,
// is none of them.
std::vector<const Cell*> candidates(const Criticism& failed, bool has_balance, Learning& out) {
  std::vector<const Cell*> tried;
  for (const Cell& cell : failed.cells) {
    if (tried.size() >= thresholds::kTermsTried) break;
    if (cell.gain() < thresholds::kNearBest * failed.cells.front().gain()) break;
    if (!cell.abscissa.variable->learnable || !stands_out(cell, failed, has_balance)) continue;
    if (cell.abscissa.levels < thresholds::kLevelsMin) {
      if (tried.empty() && out.needs_levels.empty()) {
        out.needs_levels = cell.abscissa.variable->name;
      }
      continue;
    }
    // At each variable the point that explains most.
    const bool again = std::any_of(tried.begin(), tried.end(), [&](const Cell* other) {
      return other->abscissa.variable == cell.abscissa.variable;
    });
    if (!again) tried.push_back(&cell);
  }
  return tried;
}

// Where the experiments scatter by more than healthy ones, also what stands out with no more than
// that: the scatter takes a function of what differs between them for its own.
std::vector<const Cell*> candidates_of(const Criticism& failed, const Criticism& unscattered,
                                       const Campaign& campaign, Learning& out) {
  std::vector<const Cell*> tried = candidates(failed, campaign.has_balance, out);
  for (const Cell* cell : candidates(unscattered, campaign.has_balance, out)) {
    const bool again = std::any_of(tried.begin(), tried.end(), [&](const Cell* other) {
      return other->abscissa.variable == cell->abscissa.variable &&
             other->injection == cell->injection;
    });
    if (!again) tried.push_back(cell);
  }
  return tried;
}

std::vector<std::string> aliases_of(const Campaign& campaign, const Criticism& failed,
                                    const Cell& best) {
  std::vector<std::string> out;
  for (const Cell& each : failed.cells) {
    if (&each == &best || each.gain() < best.gain() - 2.0 * thresholds::kSameNats) continue;
    out.push_back(std::string(each.injection->acts_on) + " over " +
                  role_of(campaign, *each.abscissa.variable));
  }
  // Without the torque behind the belt nothing tells these from friction.
  if (!campaign.has_balance && best.injection->injection == Injection::kFriction) {
    for (const Injection same : {Injection::kTorqueGain, Injection::kClampForce}) {
      out.push_back(std::string(estimator::kLearnedPoints[static_cast<std::size_t>(same)]) +
                    " over " + role_of(campaign, *best.abscissa.variable));
    }
  }
  return out;
}

// What the function can do as well: an effect at the same point over the same variable, or a
// constant of what the machine has no constant for.
bool is_superseded(const EffectRow& row, const Cell& cell) {
  const std::string_view variable = cell.abscissa.variable->name;
  switch (cell.injection->injection) {
    case Injection::kFriction:
      return row.stage == Stage::kFriction && row.depends_on == variable;
    case Injection::kTorqueGain:
      return row.id == "torque_gain";
    case Injection::kTorque:
      return row.id == "torque_loss" && row.depends_on == variable;
    case Injection::kClampForce:
      return row.id == "spring_force";
    case Injection::kRatio:
      break;
  }
  return false;
}

void drop_superseded(Engine& engine, const Cell& cell) {
  std::vector<int> kept = engine.accepted();
  std::erase_if(kept, [&](int slot) {
    return is_superseded(*engine.campaign().slots[static_cast<std::size_t>(slot)].row, cell);
  });
  if (kept.size() == engine.accepted().size()) return;
  engine.accept(engine.refine(kept));
  engine.update_noise();
}

// Which random effect a function at this point could be.
std::string_view scatter_of(Injection injection) {
  if (injection == Injection::kTorque) return "torque";
  return injection == Injection::kRatio ? "ratio" : "friction";
}

struct Trial {
  Engine engine;
  Learned learned;
  Criticism after;
  double excess = 0.0;
};

// Nothing where the function is not kept.
std::optional<Trial> tried(const Engine& engine, const Criticism& before, const Cell& cell,
                           const std::function<bool(const Engine&, const LearnedFit&)>& holds) {
  Trial out{engine, {}, {}, 0.0};
  drop_superseded(out.engine, cell);
  out.learned.fit = fit_learned(out.engine, *cell.injection, cell.abscissa);
  const LearnedFit& fit = out.learned.fit;
  if (fit.left_out_gain < thresholds::kLeftOutLevels || !is_possible(fit)) return {};
  if (!holds(out.engine, fit)) return {};
  out.after = criticise(out.engine);
  out.excess = excess_left(before, out.after,
                           lesser_scatter(before, scatter_of(cell.injection->injection),
                                          cell.gain(), engine.used().size()));
  if (out.excess > 1.0 - thresholds::kHealed) return {};
  out.learned.aliases = aliases_of(engine.campaign(), before, cell);
  return out;
}

}  // namespace

bool is_possible(const LearnedFit& fit) {
  const auto point = static_cast<std::size_t>(fit.cell.injection->injection);
  const double most = *std::max_element(
      fit.term.value.begin(), fit.term.value.begin() + static_cast<std::ptrdiff_t>(fit.term.count),
      [](double a, double b) { return std::abs(a) < std::abs(b); });
  return std::abs(most) < kLearnedBound[point];
}

std::string role_of(const Campaign& campaign, const IndexVariable& variable) {
  if (std::string_view(variable.name) != "torque") return variable.name;
  const auto used = std::find_if(campaign.runs.begin(), campaign.runs.end(),
                                 [](const ExperimentData& run) { return run.valid_count > 0; });
  return used != campaign.runs.end() && used->torque_is_engine ? "engine_torque" : "primary_torque";
}

std::vector<LawEvidence> possible_laws(const LearnedFit& fit) {
  std::vector<LawEvidence> out = fit.laws;
  std::sort(out.begin(), out.end(), [](const LawEvidence& a, const LawEvidence& b) {
    return a.log_evidence > b.log_evidence;
  });
  if (out.empty()) return out;
  const double least = out.front().log_evidence - thresholds::kSameNats;
  std::erase_if(out, [&](const LawEvidence& each) { return each.log_evidence < least; });
  return out;
}

const LawEvidence* named_law(const LearnedFit& fit, const std::vector<LawEvidence>& possible) {
  const bool stands = possible.size() == 1 &&
                      possible.front().left_out_gain >= fit.left_out_gain - thresholds::kLawWorse;
  return stands ? &possible.front() : nullptr;
}

bool is_shadowed(const Campaign& campaign, const std::vector<int>& accepted,
                 const Criticism& without, const Criticism& with) {
  if (accepted.empty() || excess_left(without, with) <= 1.0 - thresholds::kHealed) return false;
  const Unexplained still = what_is_left(with, campaign.has_balance);
  // A line is no function's shadow, and no function takes it away.
  if (still.kind == MisfitKind::kLine) return false;
  // By what experiments differ, nothing repeats within each of them.
  if (still.kind == MisfitKind::kBetweenRuns && repeats_within(without)) return false;
  const std::string& left = still.acts_on;
  return std::any_of(accepted.begin(), accepted.end(), [&](int slot) {
    return acts_there(*campaign.slots[static_cast<std::size_t>(slot)].row, left, campaign);
  });
}

std::vector<std::string> lesser_scatter(const Criticism& criticism, std::string_view point,
                                        double gain, std::size_t experiments) {
  std::vector<std::string> out;
  for (const JudgedTest& each : criticism.tests) {
    const bool is_scatter = each.name.starts_with("scatter_") ||
                            (each.name.starts_with("unusual_") && each.name != "unusual_scatter");
    if (each.passed() || !is_scatter || each.name.ends_with(point)) continue;
    // Of normal variables whose deviation is so many times the usual one.
    const double worth = static_cast<double>(experiments) *
                         (each.value * each.value - 1.0 - 2.0 * std::log(each.value));
    if (worth < gain) out.push_back(each.name);
  }
  return out;
}

double excess_left(const Criticism& before, const Criticism& after,
                   const std::vector<std::string>& apart) {
  std::vector<JudgedTest> failed;
  for (const JudgedTest& each : before.tests) {
    if (each.passed() || std::find(apart.begin(), apart.end(), each.name) != apart.end()) continue;
    failed.push_back(each);
  }
  // It says how regular a course is, and not how large: a tenth of one follows from itself as the
  // whole does.
  if (failed.size() > 1) {
    std::erase_if(failed, [](const JudgedTest& each) { return each.name == "whiteness"; });
  }
  double most = 0.0;
  for (const JudgedTest& each : failed) {
    const JudgedTest& now = after.test(each.name);
    // What hardly failed is healed by chance, or not.
    const double failed_by = std::max(each.value - each.limit, thresholds::kTrifle * each.limit);
    most = std::max(most, (now.value - now.limit) / failed_by);
  }
  return most;
}

bool passes_any(const Criticism& before, const Criticism& after) {
  return std::any_of(before.tests.begin(), before.tests.end(), [&](const JudgedTest& each) {
    return !each.passed() && after.test(each.name).passed();
  });
}

Learning learn(Engine& engine, const Criticism& failed, const std::function<bool()>& stop,
               const std::function<bool(const Engine&, const LearnedFit&)>& holds) {
  Learning out;
  out.left = failed;
  for (std::size_t round = 0; round < thresholds::kTermsMax && !out.left.passed(); ++round) {
    const Criticism before = out.left;
    Criticism unscattered = before;
    unscattered.cells.clear();
    // What repeats within experiments and goes with the function is more than they differ by.
    if (repeats_within(before)) {
      if (const auto bounded = within_healthy_scatter(engine, before)) {
        unscattered.cells = score_cells(*bounded);
      }
    }
    std::optional<Trial> best;
    for (const Cell* cell : candidates_of(before, unscattered, engine.campaign(), out)) {
      if (stop()) return out;
      std::optional<Trial> trial = tried(engine, before, *cell, holds);
      if (trial && (!best || trial->excess < best->excess)) best = std::move(trial);
      if (best && best->after.passed()) break;
    }
    if (!best) break;
    out.terms.push_back(std::move(best->learned));
    out.left = std::move(best->after);
    engine = std::move(best->engine);
  }
  return out;
}

}  // namespace beltgrip::diagnose
