#include "tools/diagnose/decide/criticism.h"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "estimator/statistics/distributions.h"
#include "tools/diagnose/decide/thresholds.h"
#include "tools/diagnose/infer/residual_tests.h"
#include "tools/diagnose/infer/slow_line.h"

namespace beltgrip::diagnose {
namespace {

// The order of the experiments last, unless it explains clearly more than all else.
void demote_order(std::vector<Cell>& cells) {
  const auto is_order = [](const Cell& cell) {
    return std::string_view(cell.abscissa.variable->name) == "experiment";
  };
  const auto other = std::find_if_not(cells.begin(), cells.end(), is_order);
  if (other == cells.end() || other == cells.begin()) return;
  if (cells.front().gain() > other->gain() + thresholds::kOrderAhead) return;
  std::stable_partition(cells.begin(), cells.end(),
                        [&](const Cell& cell) { return !is_order(cell); });
}

// Of the residuals that wander by as much as matters, in decades of chance.
double redness(const Engine& engine) {
  const auto by_kind = wander(engine, engine.state());
  const auto wanders = [&](const std::string& acts_on) {
    const ResidualKind kind = acts_on == "torque"        ? kBalanceResidual
                              : acts_on == "clamp force" ? kTrackingResidual
                                                         : kFrictionResidual;
    return by_kind[static_cast<std::size_t>(kind)] > thresholds::kWander;
  };
  double most = 0.0;
  for (const ResidualTest& each : test_residuals(engine, engine.state())) {
    if (each.name == "whiteness" && wanders(each.acts_on)) most = std::max(most, each.decades);
  }
  return most;
}

// The line at the belt's passage, of the speed and the order that show it best, in sigmas; Hz:
// mean.
double belt_line(const Campaign& campaign, double& frequency_Hz) {
  double most = 0.0, cycles = 0.0, pieces = 0.0;
  for (const auto lines : {&ExperimentData::belt_p, &ExperimentData::belt_s}) {
    for (std::size_t i = 0; i < kBeltOrders.size(); ++i) {
      OrderLine all;
      for (const ExperimentData& run : campaign.runs) all.add((run.*lines)[i]);
      const double sigmas = all.amplitude() / std::max(all.amplitude_sigma(), 1e-12);
      most = std::max(most, std::min(sigmas, std::sqrt(all.chi2())));
    }
  }
  for (const ExperimentData& run : campaign.runs) {
    cycles += run.belt_Hz * run.belt_p.front().pieces;
    pieces += run.belt_p.front().pieces;
  }
  frequency_Hz = cycles / std::max(pieces, 1.0);
  return most;
}

// The strongest line in a torque as it was sampled; nothing where it carries little.
SpectralLine channel_line(const Campaign& campaign) {
  SpectralLine out;
  for (const auto spectrum :
       {&ExperimentData::torque_spectrum, &ExperimentData::torque_s_spectrum}) {
    PooledSpectrum all;
    for (const ExperimentData& run : campaign.runs) all.add(run.*spectrum);
    const NarrowLine line = narrow_line(all);
    if (line.share < thresholds::kLineShare || line.over_level <= out.excess) continue;
    out = {"torque", line.frequency_Hz, line.over_level, line.share};
  }
  return out;
}

SpectralLine swing(const Campaign& campaign) {
  PooledSpectrum all;
  for (const ExperimentData& run : campaign.runs) all.add(run.unbalanced_spectrum);
  const Hump hump = strongest_hump(all);
  return {"torque", hump.frequency_Hz, hump.excess, hump.share};
}

SpectralLine swing_of_slip(const Campaign& campaign) {
  SlipSpectra all;
  PooledSpectrum torque, torque_s;
  for (const ExperimentData& run : campaign.runs) {
    all.add(run.slip_spectra);
    torque.add(run.torque_spectrum);
    torque_s.add(run.torque_s_spectrum);
  }
  const Hump hump = slip_swing(all, torque, torque_s);
  return {"ratio", hump.frequency_Hz, hump.excess, hump.share};
}

}  // namespace

double scatter_limit(double usual_most, std::size_t experiments) {
  const double degrees = std::max(static_cast<double>(experiments) - 1.0, 1.0);
  return usual_most * (1.0 + thresholds::kScatterSigmas / std::sqrt(2.0 * degrees));
}

double replicate_limit(std::size_t experiments, double degrees) {
  const double own = std::max(static_cast<double>(experiments) - 1.0, 1.0);
  double low = 1.0, high = 1e3;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (estimator::f_p(middle, own, degrees) > thresholds::kScatterChance ? low : high) = middle;
  }
  return std::sqrt(low);
}

bool acts_there(const EffectRow& row, std::string_view point, const Campaign& campaign) {
  const bool is_friction = row.acts_on == "friction", is_force = row.acts_on == "clamp force";
  const bool is_torque = row.acts_on == "torque";
  const bool is_grip = point == "friction" || point == "clamp_force" || point == "torque_gain";
  if (!campaign.has_balance && is_grip && (is_friction || is_force || row.id == "torque_gain")) {
    return true;
  }
  if (point == "torque" || point == "torque_gain") return is_torque;
  if (point == "ratio") return row.acts_on == "ratio" || row.acts_on == "speed";
  return point == "friction" ? is_friction : is_force;
}

const Cell* own_shape(const Campaign& campaign, const std::vector<int>& accepted,
                      const std::vector<Cell>& cells) {
  const Cell* out = nullptr;
  for (const Cell& cell : cells) {
    // The friction curve follows pressure and torque too, and what it leaves is nothing of the
    // effect's.
    const std::string_view follows = cell.abscissa.variable->name;
    if (follows == "secondary_pressure") continue;
    const bool is_own = std::any_of(accepted.begin(), accepted.end(), [&](int slot) {
      const EffectRow& row = *campaign.slots[static_cast<std::size_t>(slot)].row;
      return row.depends_on == follows &&
             (follows != "torque" || acts_there(row, cell.injection->acts_on, campaign));
    });
    if (is_own && (out == nullptr || cell.gain() > out->gain())) out = &cell;
  }
  return out;
}

double held_gain(const Cell& cell) {
  const std::string_view follows = cell.abscissa.variable->name;
  const Injection point = cell.injection->injection;
  const bool moves = follows == "time" || follows == "acceleration";
  const bool is_of_balance = point == Injection::kTorque || point == Injection::kTorqueGain;
  if (cell.is_told_by_form || moves || is_of_balance) return 0.0;
  return cell.smooth_gain > thresholds::kSmoothBeside ? cell.gain() : cell.smooth_gain;
}

bool Criticism::passed() const {
  return std::all_of(tests.begin(), tests.end(),
                     [](const JudgedTest& each) { return each.passed(); });
}

bool Criticism::function_fails() const {
  return std::any_of(tests.begin(), tests.end(), [](const JudgedTest& each) {
    return each.name.ends_with("_cell") && !each.passed();
  });
}

const JudgedTest& Criticism::test(const std::string& name) const {
  return *std::find_if(tests.begin(), tests.end(),
                       [&](const JudgedTest& each) { return each.name == name; });
}

Criticism criticise(const Engine& engine) {
  Criticism out;
  out.cells = score_cells(engine);
  demote_order(out.cells);
  out.line = strongest_line(engine.campaign(), engine.state());
  out.slow_line = slow_line(engine);
  out.channel_line = channel_line(engine.campaign());
  out.swing = swing(engine.campaign());
  out.slip_swing = swing_of_slip(engine.campaign());
  out.base = scatter_base(engine);
  out.offsets = engine.offsets();
  double law = 0.0, smooth = 0.0;
  const auto first = std::find_if(out.cells.begin(), out.cells.end(),
                                  [](const Cell& cell) { return !cell.is_told_by_form; });
  const double held = first == out.cells.end() ? 0.0 : held_gain(*first);
  for (const Cell& cell : out.cells) {
    if (cell.is_told_by_form) continue;
    // A step that a smooth function sees nothing of rests on a moment of one experiment.
    if (cell.smooth_gain > thresholds::kSmoothBeside) law = std::max(law, cell.law_gain);
    smooth = std::max(smooth, cell.smooth_gain);
  }
  if (const Cell* own = own_shape(engine.campaign(), engine.accepted(), out.cells)) out.own = *own;
  const ScatterRatios ratio = scatter_ratios(engine, out.base.scatter);
  const ScatterRatios unusual = scatter_ratios(engine, default_scatter());
  const auto unusual_limit = [&](double usual_most) {
    return scatter_limit(usual_most, engine.summaries().size());
  };
  const auto limit = [&](double of_many, double usual_most) {
    return out.base.from_replicates
               ? std::max(of_many, replicate_limit(engine.summaries().size(), out.base.degrees))
               : unusual_limit(usual_most);
  };
  using namespace thresholds;
  out.tests = {
      {"law_cell", law, kLawCell},
      {"smooth_cell", smooth, kSmoothCell},
      {"held_cell", held, kHeldCell},
      {"own_shape", out.own ? out.own->gain() : 0.0, kOwnShape},
      {"line", out.line.excess, kLine},
      {"slow_line", out.slow_line.excess, kSlowLine},
      {"channel_line", out.channel_line.excess, kChannelLine},
      {"torque_swing", out.swing.excess, kSwing},
      {"slip_swing", out.slip_swing.excess, kSlipSwing},
      {"belt_passage", belt_line(engine.campaign(), out.belt_Hz), kBeltLine},
      {"whiteness", redness(engine), -std::log10(kWhiteness)},
      {"scatter_friction", ratio.friction, limit(kScatterFriction, kUsualMostFriction)},
      {"scatter_ratio", ratio.ratio, limit(kScatterRatio, kUsualMostRatio)},
      {"scatter_torque", ratio.torque, limit(kScatterTorque, kUsualMostTorque)},
      {"unusual_scatter", std::max(unusual.friction, unusual.torque), kUnusualScatter},
      {"unusual_ratio", unusual.ratio, unusual_limit(kUsualMostRatio)},
      {"unusual_friction", unusual.friction, unusual_limit(kUsualMostFriction)},
  };
  return out;
}

namespace {

// Chosen, of the span: what the means of the experiments cover at least, or one of them. A fifth
// less or more: the same answers of twelve campaigns of other make in which scatter fails.
constexpr double kBetween = 0.5;

// What is followed differs between experiments rather than within each of them.
bool differs_between(const Abscissa& abscissa) {
  double least = abscissa.high, most = abscissa.low;
  for (std::size_t e = 0; e < abscissa.x.size(); ++e) {
    if (abscissa.x[e].size() == 0) continue;
    least = std::min(least, abscissa.mean[e]);
    most = std::max(most, abscissa.mean[e]);
  }
  return most - least >= kBetween * (abscissa.high - abscissa.low);
}

// As much as that within one experiment or another.
bool changes_within(const Abscissa& abscissa) {
  return std::any_of(abscissa.x.begin(), abscissa.x.end(), [&](const Eigen::ArrayXd& x) {
    return x.size() > 0 && x.maxCoeff() - x.minCoeff() >= kBetween;
  });
}

}  // namespace

bool repeats_within(const Criticism& criticism) {
  return !criticism.cells.empty() && criticism.function_fails() &&
         (!differs_between(criticism.cells.front().abscissa) ||
          changes_within(criticism.cells.front().abscissa));
}

bool may_be_scatter(const Cell& cell, const Criticism& criticism, bool has_balance) {
  if (!differs_between(cell.abscissa)) return false;
  if (cell.gain() <= thresholds::kCellBesideScatter) return false;
  const auto fails = [&](const char* name) { return !criticism.test(name).passed(); };
  const bool any = fails("unusual_scatter");  // does not say of what
  const bool friction = fails("scatter_friction") || fails("unusual_friction");
  switch (cell.injection->injection) {
    case Injection::kFriction:
    case Injection::kClampForce:
      return any || friction;
    case Injection::kTorqueGain:
      return any || fails("scatter_torque") || (!has_balance && friction);
    case Injection::kTorque:
      return any || fails("scatter_torque");
    case Injection::kRatio:
      return fails("scatter_ratio") || fails("unusual_ratio");
  }
  return false;
}

double unlikeness(const Cell& cell, const std::vector<RandomVector>& offsets, Eigen::Index random) {
  std::vector<std::pair<double, double>> by_mean;
  for (std::size_t e = 0; e < cell.abscissa.x.size() && by_mean.size() < offsets.size(); ++e) {
    if (cell.abscissa.x[e].size() == 0) continue;
    by_mean.emplace_back(cell.abscissa.mean[e], offsets[by_mean.size()][random]);
  }
  std::sort(by_mean.begin(), by_mean.end());
  double mean = 0.0, variance = 0.0, apart = 0.0;
  for (const auto& [x, off] : by_mean) mean += off / static_cast<double>(by_mean.size());
  for (std::size_t i = 0; i < by_mean.size(); ++i) {
    variance += std::pow(by_mean[i].second - mean, 2.0);
    if (i > 0) apart += 0.5 * std::pow(by_mean[i].second - by_mean[i - 1].second, 2.0);
  }
  return variance > 0.0 ? apart / variance : 1.0;
}

namespace {

// Of what scatters too much, neighbours are more alike than those of a scatter are.
bool is_followed(const Cell& cell, const Criticism& criticism) {
  const auto fails = [&](const char* name) { return !criticism.test(name).passed(); };
  const bool any = fails("unusual_scatter");  // does not say of what
  const std::array<bool, 3> scatters{any || fails("scatter_friction") || fails("unusual_friction"),
                                     fails("scatter_ratio") || fails("unusual_ratio"),
                                     any || fails("scatter_torque")};
  const auto n = static_cast<double>(criticism.offsets.size());
  const double sigma = std::sqrt(std::max(n - 2.0, 0.0) / std::max(n * n - 1.0, 1.0));
  for (std::size_t random = 0; random < scatters.size(); ++random) {
    const auto of = static_cast<Eigen::Index>(random);
    if (scatters[random] &&
        unlikeness(cell, criticism.offsets, of) < 1.0 - thresholds::kAlikeSigmas * sigma) {
      return true;
    }
  }
  return false;
}

}  // namespace

Unexplained what_is_left(const Criticism& criticism, bool has_balance) {
  const auto fails = [&](const char* name) { return !criticism.test(name).passed(); };
  Unexplained out;
  if (fails("belt_passage")) {
    out.acts_on = "ratio";
    out.kind = MisfitKind::kLine;
    out.frequency_Hz = criticism.belt_Hz;
    out.is_belt = true;
    return out;
  }
  if (fails("channel_line") || fails("torque_swing") || fails("slip_swing")) {
    const SpectralLine& line = fails("channel_line")   ? criticism.channel_line
                               : fails("torque_swing") ? criticism.swing
                                                       : criticism.slip_swing;
    out = {line.acts_on, {}, line.share, MisfitKind::kLine, line.frequency_Hz};
    return out;
  }
  const Cell* best = criticism.cells.empty() ? nullptr : &criticism.cells.front();
  // A function of something that sweeps leaves a weak line as well, and a slow one.
  const bool is_function = best != nullptr && criticism.function_fails();
  const bool is_line =
      fails("line") && (!is_function || criticism.line.share > thresholds::kLineShare);
  if (is_line || (fails("slow_line") && !is_function)) {
    const SpectralLine& line = is_line ? criticism.line : criticism.slow_line;
    out.acts_on = line.acts_on;
    out.kind = MisfitKind::kLine;
    out.frequency_Hz = line.frequency_Hz;
    out.share = line.share;
    if (is_function) {
      out.depends_on = {best->abscissa.variable->name};
    }
    return out;
  }
  const bool scatters = fails("scatter_friction") || fails("scatter_ratio") ||
                        fails("scatter_torque") || fails("unusual_scatter") ||
                        fails("unusual_ratio") || fails("unusual_friction");
  const bool stands_out = criticism.function_fails();
  if (!stands_out) {
    const auto found =
        std::find_if(criticism.cells.begin(), criticism.cells.end(), [&](const Cell& cell) {
          return may_be_scatter(cell, criticism, has_balance) && is_followed(cell, criticism);
        });
    best = found == criticism.cells.end() ? nullptr : &*found;
  }
  if (!stands_out && best == nullptr && criticism.own && fails("own_shape")) best = &*criticism.own;
  if (stands_out || ((scatters || fails("own_shape")) && best != nullptr)) {
    out.acts_on = best->injection->acts_on;
    out.depends_on = {best->abscissa.variable->name};
    out.share = best->share;
  } else if (scatters) {
    const auto over = [&](const char* name) {
      return criticism.test(name).value / criticism.test(name).limit;
    };
    const double friction = std::max(over("scatter_friction"), over("unusual_friction"));
    const double ratio = std::max(over("scatter_ratio"), over("unusual_ratio"));
    const double torque = over("scatter_torque");
    out.acts_on = friction >= std::max(ratio, torque) ? "friction"
                  : ratio >= torque                   ? "ratio"
                                                      : "torque";
    out.kind = MisfitKind::kBetweenRuns;
    double times = criticism.test("scatter_" + out.acts_on).value;
    if (out.acts_on != "torque")
      times = std::max(times, criticism.test("unusual_" + out.acts_on).value);
    out.share = std::max(0.0, 1.0 - 1.0 / std::max(times * times, 1.0));
  } else {
    out.acts_on = "friction";
    out.kind = MisfitKind::kSlow;
    out.share = best != nullptr ? best->share : 0.0;
  }
  return out;
}

}  // namespace beltgrip::diagnose
