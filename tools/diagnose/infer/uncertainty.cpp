#include "tools/diagnose/infer/uncertainty.h"

#include <algorithm>
#include <cmath>

#include "tools/diagnose/infer/gain.h"

namespace beltgrip::diagnose {
namespace {

using Eigen::Index;

// One sigma of what the equations themselves leave out (a grid of a tenth of a second, one form
// where nature has another), as a share of the size: no size is surer. A delay or a lag works on
// slow copies of signals: where these step, their steps are too gentle, and the delay seems longer.
constexpr double kEquationShare = 0.01, kDelayShare = 0.1;

}  // namespace

std::vector<Uncertainty> uncertainties(const Engine& engine, const Hypothesis& hypothesis) {
  const LeftOut left_out = leave_one_out(engine, hypothesis.state, hypothesis.slots);
  const double between = std::max(1.0, static_cast<double>(engine.summaries().size()) - 1.0);
  std::vector<Uncertainty> out;
  for (std::size_t i = 0; i < hypothesis.slots.size(); ++i) {
    const int slot = hypothesis.slots[i];
    const double scale = engine.scale(kNuisanceCount + slot);
    const auto column = static_cast<Index>(engine.active_nuisances().size() + i);
    // From the noise, or from how the size changes when an experiment is left out, whichever is
    // larger.
    const double noise =
        std::sqrt(std::max(hypothesis.fit.covariance(column, column), 0.0)) * scale;
    const bool disagree = left_out.spread[i] > noise;
    const double sampled = disagree ? left_out.spread[i] : noise;
    const double degrees =
        disagree ? std::min(hypothesis.degrees[i], between) : hypothesis.degrees[i];
    const bool is_time = engine.campaign().slots[static_cast<std::size_t>(slot)].row->unit == "s";
    const double equation =
        (is_time ? kDelayShare : kEquationShare) * hypothesis.state.effects[slot];
    const double variance = sampled * sampled + equation * equation;
    // Satterthwaite: only what is sampled has few degrees of freedom.
    const double share = sampled * sampled / std::max(variance, 1e-300);
    out.push_back(
        {std::sqrt(variance), degrees / std::max(share * share, 1e-9), left_out.stability[i]});
  }
  return out;
}

}  // namespace beltgrip::diagnose
