#include "tools/diagnose/decide/needed_scatter.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <string>
#include <string_view>

#include "tools/diagnose/decide/namer.h"
#include "tools/diagnose/decide/thresholds.h"

namespace beltgrip::diagnose {
namespace {

// Chosen: of a fit that is compared. A fifth less or more: the same verdicts in eleven campaigns of
// other make that come here.
constexpr int kSteps = 20;

struct Kind {
  std::string_view over_base;  // its test against the base
  std::string_view unusual;    // against what is usual; empty: it has none of its own
  bool is_in_unusual_scatter;  // it is one of those of that test
  double usual_most;
};
// In the order of the random effects.
std::array<Kind, 3> kinds() {
  return {Kind{"scatter_friction", "unusual_friction", true, thresholds::kUsualMostFriction},
          Kind{"scatter_ratio", "unusual_ratio", false, thresholds::kUsualMostRatio},
          Kind{"scatter_torque", "", true, thresholds::kUsualMostTorque}};
}

// Variances that a healthy machine may have; of what passes not less than it has, for one takes
// over what another is denied. Nothing where all pass.
std::optional<RandomVector> bounds(const Engine& engine, const Criticism& criticism) {
  const auto fails = [&](std::string_view name) {
    return !name.empty() && !criticism.test(std::string(name)).passed();
  };
  const Scatter usual = default_scatter();
  const auto runs = static_cast<double>(engine.used().size());
  const ScatterRatios unusual = scatter_ratios(engine, usual);
  const std::array ratio{unusual.friction, unusual.ratio, unusual.torque};
  RandomVector out = engine.first_scatter().most;
  bool any = false;
  const auto all = kinds();
  for (std::size_t i = 0; i < all.size(); ++i) {
    const auto kind = static_cast<Eigen::Index>(i);
    const auto within = [&](const Scatter& base) {
      const double most = all[i].usual_most * all[i].usual_most;
      return scatter_variance(most * base.variance, runs)[kind];
    };
    const bool is_unusual = fails(all[i].unusual) || (all[i].is_in_unusual_scatter &&
                                                      ratio[i] > thresholds::kUnusualScatter);
    const bool is_more = fails(all[i].over_base);
    any = any || is_more || is_unusual;
    double least = within(usual);
    if (is_more) least = std::min(least, within(criticism.base.scatter));
    if (!is_more && !is_unusual) least = std::max(least, engine.scatter().variance[kind]);
    out[kind] = std::min(out[kind], least);
  }
  if (!any) return {};
  return out;
}

// Log likelihood, the constants of the machine integrated out.
double marginal(const Hypothesis& fit) {
  return fit.log_likelihood +
         0.5 * fit.fit.covariance.ldlt().vectorD().array().max(1e-300).log().sum();
}

struct Bounded {
  Engine engine;      // not yet at what was fitted
  Hypothesis within;  // of the effects that are accepted
};

std::optional<Bounded> bounded_fit(const Engine& engine, const Criticism& criticism) {
  const std::optional<RandomVector> most = bounds(engine, criticism);
  if (!most || !(*most < engine.scatter().variance).any()) return {};
  Bounded out{engine, {}};
  out.engine.bound_scatter(*most);
  out.within = out.engine.refine(engine.accepted(), kSteps);
  return out;
}

}  // namespace

std::optional<Engine> within_healthy_scatter(const Engine& engine, const Criticism& criticism) {
  std::optional<Bounded> out = bounded_fit(engine, criticism);
  if (!out) return {};
  out->engine.accept(out->within);
  return std::move(out->engine);
}

std::optional<Engine> without_needless_scatter(const Engine& engine, const Criticism& criticism) {
  std::optional<Bounded> fit = bounded_fit(engine, criticism);
  if (!fit) return {};
  auto& [bounded, within] = *fit;
  const std::vector<int>& slots = engine.accepted();
  const double beyond = std::max(marginal(engine.refine(slots, kSteps)),
                                 marginal(engine.refine_from(within.state, slots, kSteps)));
  // Of one variance at its bound: half of the chances are below.
  const double chance = chance_threshold(1, 2.0 * thresholds::kScatterChance);
  if (2.0 * (beyond - marginal(within)) > chance) return {};
  bounded.accept(within);
  bounded.update_noise();
  bounded.accept(bounded.refine(slots, kSteps));
  bounded.update_noise();
  return std::move(bounded);
}

}  // namespace beltgrip::diagnose
