#include "tools/diagnose/infer/slow_line.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "estimator/statistics/order.h"
#include "tools/diagnose/infer/cell_columns.h"
#include "tools/diagnose/infer/rounding_swing.h"

namespace beltgrip::diagnose {
namespace {

using Eigen::ArrayXd;

// Five turns of a slow ramp; above the second line_test.h looks. The level is known from a little
// beyond both.
constexpr double kPerHz = 40.0;  // steps: what 40 s resolve, and half a step between
constexpr int kLevelFrom = 7, kLowest = 8, kHighest = 28, kLevelTo = 38;  // steps
constexpr int kAround = 10;  // steps either way that tell the level
constexpr int kBeside = 1;   // steps either way that are the line itself
constexpr int kFrequencies = kLevelTo - kLevelFrom + 1;
constexpr int kTogether = 4;  // frequencies whose columns are multiplied at once

constexpr std::array kActsOn{Injection::kFriction, Injection::kRatio, Injection::kTorque,
                             Injection::kClampForce};

double hertz(int i) { return (kLevelFrom + i) / kPerHz; }

// The size of a swing, in units of the row, that rounding may leave.
double size_of_rounding(const Campaign& campaign, int run, const ModelState& state,
                        const Residuals& at, const InjectionRow& row) {
  const ResidualColumns unit =
      propagate(campaign, at, unit_change(state, at, row, ArrayXd::Ones(at.foot.size())));
  double own = 0.0, squares = 0.0;
  for (const ArrayXd& each : unit) own += each.square().sum();
  if (own == 0.0) return 0.0;
  for (const ResidualColumns& each : rounding_swings(campaign, run, at)) {
    double common = 0.0;
    for (std::size_t kind = 0; kind < kResidualKinds; ++kind) {
      if (each[kind].size() > 0 && unit[kind].size() > 0) {
        common += (each[kind] * unit[kind]).abs().sum();
      }
    }
    squares += common * common / (own * own);
  }
  return std::sqrt(squares);
}

// By how much twice the log likelihood of one experiment grows with a swing of any size and phase.
struct Gains {
  std::array<double, kFrequencies> of{};
  std::array<double, kFrequencies> size{};  // of that swing, in units of the row
};

Gains gains_of(const Engine& engine, int run, Residuals& at, const InjectionRow& row) {
  const Campaign& campaign = engine.campaign();
  const ModelState& state = engine.state();
  const ArrayXd& t_s = campaign.runs[static_cast<std::size_t>(run)].t_s;
  Gains out;
  for (int first = 0; first < kFrequencies; first += kTogether) {
    const int count = std::min(kTogether, kFrequencies - first);
    const ExtraColumns swings = [&](int, const Residuals& here) {
      std::vector<ResidualColumns> columns;
      for (int i = 0; i < count; ++i) {
        const ArrayXd turn = 2.0 * std::numbers::pi * hertz(first + i) * t_s;
        for (const ArrayXd& each : {ArrayXd(turn.cos()), ArrayXd(turn.sin())}) {
          columns.push_back(propagate(campaign, here, unit_change(state, here, row, each)));
        }
      }
      return columns;
    };
    const Summary sums = summarise(campaign, run, state, at, {}, {}, engine.whitening(), swings);
    Eigen::MatrixXd scatter = sums.uu;
    scatter.diagonal() += (1.0 / engine.scatter().variance).matrix();
    const Eigen::MatrixXd own = sums.aa - sums.ua.transpose() * solved_llt(scatter, sums.ua);
    for (int i = 0; i < count; ++i) {
      const Eigen::Index at_sine = Eigen::Index{2} * i;
      const Eigen::Vector2d score = own.col(Eigen::Index{2} * count).segment<2>(at_sine);
      Eigen::Matrix2d information = own.block<2, 2>(at_sine, at_sine);
      out.size[static_cast<std::size_t>(first) + static_cast<std::size_t>(i)] =
          (information.inverse() * score).norm();
      information.diagonal().array() += 1.0;  // of a usual size, and where nothing tells
      out.of[static_cast<std::size_t>(first) + static_cast<std::size_t>(i)] =
          score.dot(information.inverse() * score);
    }
  }
  return out;
}

// Of the frequencies about one.
double level_about(const Gains& gains, int i) {
  std::vector<double> near;
  for (int j = std::max(0, i - kAround); j <= std::min(kFrequencies - 1, i + kAround); ++j) {
    if (std::abs(j - i) > kBeside) near.push_back(gains.of[static_cast<std::size_t>(j)]);
  }
  return estimator::median(near);
}

// In sigmas of what the frequencies about it have, of so many experiments; 0: none has any.
double excess_at(const Gains& gains, int i, int runs) {
  const double level = level_about(gains, i);
  if (!(level > 0.0)) return 0.0;
  // Wilson and Hilferty: a sum of exponential variables as a normal one.
  const double n = runs;
  return (std::cbrt(gains.of[static_cast<std::size_t>(i)] / level) - (1.0 - 1.0 / (9.0 * n))) *
         3.0 * std::sqrt(n);
}

const InjectionRow& row_of(Injection injection) {
  return *std::find_if(kInjections.begin(), kInjections.end(),
                       [&](const InjectionRow& row) { return row.injection == injection; });
}

}  // namespace

SpectralLine slow_line(const Engine& engine) {
  std::array<Gains, kActsOn.size()> pools{};
  for (const int run : engine.used()) {
    Residuals at = residuals_of(engine.campaign(), run, engine.state());
    prepare_derivatives(engine.campaign(), run, engine.state(), at);
    const std::vector<bool> is_driven =
        driven(engine.campaign().runs[static_cast<std::size_t>(run)], kLevelTo - kLowest + 1,
               kLowest / kPerHz, kLevelTo / kPerHz);
    for (std::size_t p = 0; p < pools.size(); ++p) {
      const Gains own = gains_of(engine, run, at, row_of(kActsOn[p]));
      const double of_rounding =
          size_of_rounding(engine.campaign(), run, engine.state(), at, row_of(kActsOn[p]));
      for (int i = 0; i < kFrequencies; ++i) {
        const auto j = static_cast<std::size_t>(i);
        const bool is_driven_there =
            i >= kLowest - kLevelFrom && is_driven[j + kLevelFrom - kLowest];
        const bool is_told = own.size[j] > of_rounding && !is_driven_there;
        pools[p].of[j] += is_told ? own.of[j] : std::min(own.of[j], level_about(own, i));
      }
    }
  }
  const int runs = static_cast<int>(engine.used().size());
  SpectralLine out;
  double most = 0.0;
  int where = 0;
  for (const Gains& pool : pools) {
    for (int i = kLowest - kLevelFrom; i <= kHighest - kLevelFrom; ++i) {
      const double excess = excess_at(pool, i, runs);
      if (excess <= out.excess) continue;
      out.excess = excess;
      where = i;
    }
  }
  for (std::size_t p = 0; p < pools.size(); ++p) {
    const double gain = pools[p].of[static_cast<std::size_t>(where)];
    if (gain <= most) continue;
    most = gain;
    out.acts_on = row_of(kActsOn[p]).acts_on;
  }
  out.frequency_Hz = hertz(where);
  double misfit = 0.0;
  for (const Summary& each : engine.summaries())
    misfit += each.aa(each.aa.rows() - 1, each.aa.rows() - 1);
  out.share = misfit > 0.0 ? std::min(1.0, most / misfit) : 0.0;
  return out;
}

}  // namespace beltgrip::diagnose
