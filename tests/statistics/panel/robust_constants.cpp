// What each number of estimator/robust/thresholds.h decides: drawn traces, and traces that are
// disturbed, where no value is right, with each number a fifth smaller and a fifth larger.
// tests/vary runs it.
//   robust_constants [--write FILE]   the table; into FILE, below its heading
#include <cmath>
#include <string>
#include <vector>

#include "drawing.h"
#include "estimator/robust/thresholds.h"
#include "panel_figures.h"
#include "tests/statistics/varied_numbers.h"

namespace beltgrip::panel {
namespace {

const test::VariedNumber kNumbers[] = {
#include "varied_constants.inc"
};

constexpr std::uint64_t kFirst = 8200001, kFirstDisturbed = 8300001;
constexpr int kTraces = 180, kDisturbed = 45, kThreads = 2;
// What counts as changed.
constexpr double kValueMoves = 0.002, kStopMoves_s = 0.02;

struct Answers {
  std::vector<Judged> drawn;
  std::vector<DisturbedFigures> disturbed;
};

Answers answers() {
  Answers out;
  JudgeOptions options;
  options.paper = false;
  out.drawn = judge_many(draw_scenario, kFirst, kTraces, kThreads, options);
  for (int k = 1; k < kDisturbances; ++k) {
    options.disturbance = static_cast<Disturbance>(k);
    out.disturbed.push_back(disturbed_figures(
        judge_many(draw_scenario, kFirstDisturbed, kDisturbed, kThreads, options), std::nullopt));
  }
  return out;
}

bool alike(const DisturbedFigures& a, const DisturbedFigures& b) {
  return a.flagged == b.flagged && a.no_value == b.no_value && a.right == b.right &&
         a.wrong == b.wrong;
}

std::string changes(const Answers& before, const Answers& now) {
  int kinds = 0, values = 0, stops = 0, ends = 0;
  for (std::size_t i = 0; i < before.drawn.size(); ++i) {
    const Outcome& a = before.drawn[i].robust;
    const Outcome& b = now.drawn[i].robust;
    if (a.peak.kind != b.peak.kind) {
      ++kinds;
      continue;
    }
    values += std::abs(a.peak.mu_max - b.peak.mu_max) > kValueMoves * a.peak.mu_max ? 1 : 0;
    stops += std::abs(a.stop_s - b.stop_s) > kStopMoves_s ? 1 : 0;
  }
  for (std::size_t k = 0; k < before.disturbed.size(); ++k) {
    ends += alike(before.disturbed[k], now.disturbed[k]) ? 0 : 1;
  }
  return std::to_string(kinds) + " / " + std::to_string(values) + " / " + std::to_string(stops) +
         " / " + std::to_string(ends);
}

}  // namespace
}  // namespace beltgrip::panel

int main(int argc, char** argv) {
  using namespace beltgrip::panel;
  const Answers before = answers();
  const std::string introduction =
      "Each number of `robust/thresholds.h` a fifth smaller and larger, on " +
      std::to_string(kTraces) + " drawn traces and " + std::to_string(kDisturbances - 1) +
      " disturbances of " + std::to_string(kDisturbed) +
      ": results of another kind / values or bounds that move by 0.2 % / stops that move by 20 ms "
      "/ "
      "disturbances that end otherwise. `tests/vary estimator/robust/thresholds.h` writes it. "
      "Not on this panel: `stop = \"confidence\"`, where alone the forecast's numbers decide, and "
      "a pressure whose reading steps.";
  return beltgrip::test::write_varied(argc, argv, "## What a fifth of a constant changes\n",
                                      introduction, kNumbers,
                                      [&before] { return changes(before, answers()); });
}
