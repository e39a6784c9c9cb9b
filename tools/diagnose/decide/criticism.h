// What the model of the moment does not explain: the tests of its residuals, which decide the
// verdict.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tools/diagnose/data/diagnosis.h"
#include "tools/diagnose/decide/plausibility.h"
#include "tools/diagnose/infer/cells.h"
#include "tools/diagnose/infer/line_test.h"
#include "tools/diagnose/infer/scatter_base.h"

namespace beltgrip::diagnose {

struct JudgedTest {
  std::string name;  // law_cell, smooth_cell, line, whiteness, scatter_friction, ...
  double value = 0.0, limit = 0.0;
  bool passed() const { return !(value > limit); }
};

struct Criticism {
  std::vector<Cell> cells;  // the best first
  std::optional<Cell> own;  // of those that follow the same as a named effect, the best
  SpectralLine line, slow_line, channel_line, swing, slip_swing;
  double belt_Hz = 0.0;  // of the belt's passage, mean
  ScatterBase base;
  // Of each experiment with valid samples: friction (share), ratio (share), torque (Nm) and so on.
  std::vector<RandomVector> offsets;
  std::vector<JudgedTest> tests;
  bool passed() const;
  bool function_fails() const;  // one of the tests of the cells
  const JudgedTest& test(const std::string& name) const;
};

// What so many experiments may scatter by, over the usual, where healthy machines differ by as much
// as usual_most.
double scatter_limit(double usual_most, std::size_t experiments);
// What they may scatter by over a base that so many degrees of freedom tell: both are estimates.
double replicate_limit(std::size_t experiments, double degrees);

// What a cell of friction, ratio or clamp force explains, over what experiments hold or set: twice
// the log odds. 0: it is over time or acceleration, of a torque, or the curve's own form.
double held_gain(const Cell& cell);

// At the engine's state.
Criticism criticise(const Engine& engine);

// Whether an effect does what a function at this point does. Without the torque behind the belt
// friction, gain of the torque and clamp force are one.
bool acts_there(const EffectRow& row, std::string_view point, const Campaign& campaign);

// A function of what a named effect follows, beside it; the one with the largest gain. Where that
// is there still, the cause follows the same and is another. Null: no effect is named that follows
// what a cell does.
const Cell* own_shape(const Campaign& campaign, const std::vector<int>& accepted,
                      const std::vector<Cell>& cells);
// Something stands out that follows what changes within each experiment: no scatter between them.
bool repeats_within(const Criticism& criticism);
// Where the scatter between experiments fails: the cell may be what it is, for it acts where they
// scatter, and what it follows differs between them rather than within.
bool may_be_scatter(const Cell& cell, const Criticism& criticism, bool has_balance);
// Von Neumann's ratio of what the experiments differ by in that random effect, in the order of what
// the cell follows: half the mean square of what neighbours differ by, over the variance. About 1
// where it follows nothing, near 0 where it is a function.
double unlikeness(const Cell& cell, const std::vector<RandomVector>& offsets, Eigen::Index random);

// What is to be said of residuals that fail.
Unexplained what_is_left(const Criticism& criticism, bool has_balance);

}  // namespace beltgrip::diagnose
