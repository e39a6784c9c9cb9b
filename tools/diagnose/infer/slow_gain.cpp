#include "tools/diagnose/infer/slow_gain.h"

#include <algorithm>
#include <cmath>

namespace beltgrip::diagnose {
namespace {

// Chosen: a constant of the machine does nothing faster. A fifth less names one of two healthy
// campaigns of other make again (111), a fifth more none; 24 of our own answer the same either way.
constexpr double kSlow_s = 2.0;

ResidualEnergy energy_over_runs(const Engine& engine, const Hypothesis& h, const Scatter& scatter) {
  const Campaign& campaign = engine.campaign();
  ResidualEnergy out;
  for (const int run : engine.used()) {
    const ExperimentData& data = campaign.runs[static_cast<std::size_t>(run)];
    const auto block = static_cast<Eigen::Index>(std::lround(kSlow_s / data.dt_s));
    for (const Eigen::VectorXd& white :
         white_residuals(campaign, run, h.state, engine.whitening(), scatter)) {
      if (white.size() == 0) continue;
      Eigen::Index row = 0;
      for (const auto& [begin, end] : data.stretches) {
        const ResidualEnergy each = diagnose::energy_of(white, row, row + end - begin, block);
        row += end - begin;
        out.whole += each.whole;
        out.slow += each.slow;
      }
    }
  }
  return out;
}

}  // namespace

ResidualEnergy energy_of(const Eigen::VectorXd& white, Eigen::Index from, Eigen::Index to,
                         Eigen::Index block) {
  ResidualEnergy out;
  for (Eigen::Index begin = from; begin < to; begin += block) {
    const auto here = white.segment(begin, std::min(block, to - begin)).array();
    const double count = static_cast<double>((here != 0.0).count());
    out.whole += here.square().sum();
    if (count > 0.0) out.slow += here.sum() * here.sum() / count;
  }
  return out;
}

double gain_of_noise(const Engine& engine, const Hypothesis& without, const Hypothesis& with) {
  const ResidualEnergy before = energy_over_runs(engine, without, with.fit.scatter);
  const ResidualEnergy after = energy_over_runs(engine, with, with.fit.scatter);
  return (before.whole - after.whole) - (before.slow - after.slow);
}

bool mends_machine(const Hypothesis& without, const Hypothesis& with) {
  const bool straightens =
      !Engine::curve_is_possible(without.state) && Engine::curve_is_possible(with.state);
  return straightens || gathers_experiments(without.fit.scatter, with.fit.scatter);
}

}  // namespace beltgrip::diagnose
