#include "tools/diagnose/decide/criticism.h"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "tools/diagnose/decide/thresholds.h"
#include "tools/diagnose/infer/residual_tests.h"

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

double least_whiteness(const Engine& engine) {
  double least = 1.0;
  for (const ResidualTest& each : test_residuals(engine, engine.state())) {
    if (each.name == "whiteness") least = std::min(least, each.p);
  }
  return least;
}

// The line at the belt's passage, of the speed and the order that show it best, in sigmas; Hz:
// mean.
double belt_line(const Campaign& campaign, double& frequency_Hz) {
  constexpr double kAmplitudeMin = 1e-4;  // of the speed: less is of no consequence for slip
  double most = 0.0, cycles = 0.0, pieces = 0.0;
  for (const auto lines : {&ExperimentData::belt_p, &ExperimentData::belt_s}) {
    for (std::size_t i = 0; i < kBeltOrders.size(); ++i) {
      OrderLine all;
      for (const ExperimentData& run : campaign.runs) all.add((run.*lines)[i]);
      const double sigmas = all.amplitude() / std::max(all.amplitude_sigma(), 1e-12);
      if (all.amplitude() > kAmplitudeMin) {
        most = std::max(most, std::min(sigmas, std::sqrt(all.chi2())));
      }
    }
  }
  for (const ExperimentData& run : campaign.runs) {
    cycles += run.belt_Hz * run.belt_p.front().pieces;
    pieces += run.belt_p.front().pieces;
  }
  frequency_Hz = cycles / std::max(pieces, 1.0);
  return most;
}

double decades(double p) { return -std::log10(std::max(p, 1e-300)); }

}  // namespace

bool Criticism::passed() const {
  return std::all_of(tests.begin(), tests.end(),
                     [](const JudgedTest& each) { return each.passed(); });
}

const JudgedTest& Criticism::test(const std::string& name) const {
  return *std::find_if(tests.begin(), tests.end(),
                       [&](const JudgedTest& each) { return each.name == name; });
}

Criticism criticise(const Engine& engine, Steps steps) {
  Criticism out;
  out.cells = score_cells(engine);
  demote_order(out.cells);
  out.line = strongest_line(engine.campaign(), engine.state());
  out.base = scatter_base(engine);
  double law = 0.0, smooth = 0.0;
  for (const Cell& cell : out.cells) {
    // A step that a smooth function sees nothing of rests on a moment of one experiment.
    if (cell.smooth_gain > thresholds::kSmoothBeside) law = std::max(law, cell.law_gain);
    smooth = std::max(smooth, cell.smooth_gain);
  }
  const ScatterRatios ratio = scatter_ratios(engine, out.base.scatter);
  const ScatterRatios unusual = scatter_ratios(engine, default_scatter());
  using namespace thresholds;
  const double times = steps == Steps::kCoarse ? kCoarse : 1.0;
  const bool fine = steps == Steps::kFine;
  out.tests = {
      {"law_cell", law, times * kLawCell},
      {"smooth_cell", smooth, times * kSmoothCell},
      {"line", fine ? out.line.excess : 0.0, kLine},
      {"belt_passage", belt_line(engine.campaign(), out.belt_Hz), kBeltLine},
      {"whiteness", fine ? decades(least_whiteness(engine)) : 0.0, decades(kWhiteness)},
      {"scatter_friction", ratio.friction, kScatterFriction},
      {"scatter_ratio", ratio.ratio, kScatterRatio},
      {"scatter_torque", ratio.torque, kScatterTorque},
      {"unusual_scatter", std::max({unusual.friction, unusual.ratio, unusual.torque}),
       kUnusualScatter},
  };
  return out;
}

Unexplained what_is_left(const Criticism& criticism) {
  const auto fails = [&](const char* name) { return !criticism.test(name).passed(); };
  Unexplained out;
  if (fails("belt_passage")) {
    out.acts_on = "ratio";
    out.kind = MisfitKind::kLine;
    out.frequency_Hz = criticism.belt_Hz;
    out.is_belt = true;
    return out;
  }
  const Cell* best = criticism.cells.empty() ? nullptr : &criticism.cells.front();
  // A function of something that sweeps leaves a weak line as well.
  const bool is_line =
      fails("line") && (best == nullptr || criticism.line.share > thresholds::kLineShare ||
                        (!fails("law_cell") && !fails("smooth_cell")));
  if (is_line) {
    out.acts_on = criticism.line.acts_on;
    out.kind = MisfitKind::kLine;
    out.frequency_Hz = criticism.line.frequency_Hz;
    out.share = criticism.line.share;
    if (best != nullptr && (fails("law_cell") || fails("smooth_cell"))) {
      out.depends_on = {best->abscissa.variable->name};
    }
    return out;
  }
  const bool scatters = fails("scatter_friction") || fails("scatter_ratio") ||
                        fails("scatter_torque") || fails("unusual_scatter");
  const bool follows =
      fails("law_cell") || fails("smooth_cell") ||
      (scatters && best != nullptr && best->gain() > thresholds::kCellBesideScatter);
  if (follows) {
    out.acts_on = best->injection->acts_on;
    out.depends_on = {best->abscissa.variable->name};
    out.share = best->share;
  } else if (scatters) {
    const auto over = [&](const char* name) {
      return criticism.test(name).value / criticism.test(name).limit;
    };
    const double friction = over("scatter_friction"), ratio = over("scatter_ratio"),
                 torque = over("scatter_torque");
    out.acts_on = friction >= std::max(ratio, torque) ? "friction"
                  : ratio >= torque                   ? "ratio"
                                                      : "torque";
    out.kind = MisfitKind::kBetweenRuns;
    const double times = criticism.test("scatter_" + out.acts_on).value;
    out.share = std::max(0.0, 1.0 - 1.0 / std::max(times * times, 1.0));
  } else {
    out.acts_on = "friction";
    out.kind = MisfitKind::kSlow;
    out.share = best != nullptr ? best->share : 0.0;
  }
  return out;
}

}  // namespace beltgrip::diagnose
