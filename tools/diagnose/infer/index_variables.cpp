#include "tools/diagnose/infer/index_variables.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "tools/diagnose/model/learned.h"

namespace beltgrip::diagnose {
namespace {

using Eigen::ArrayXd;

constexpr double kVaried = 0.05;      // of its middle; less may be the channel's own noise
constexpr double kMovesShare = 0.06;  // of the span: an experiment that moves it less has one value
constexpr double kLevelShare = 0.03;  // of the span: means nearer than that are one level
// Chosen, of the span: what experiments cover of it on average. A fifth less or more: the same
// names and functions in ten campaigns of other make with a function of the pressure and a healthy
// one.
constexpr double kSwept = 0.5;
constexpr std::size_t kSamplesMin = 50;

using estimator::LearnedVariable;

// That of a shaft that is held is what the friction makes.
ArrayXd acceleration(const ExperimentData& run, int) {
  return shafts_move(run) ? ArrayXd(run.omega_p.slow_slope) : ArrayXd::Zero(run.size());
}

template <LearnedVariable which>
ArrayXd value_of(const ExperimentData& run, int) {
  return recorded(run, which);
}

constexpr std::array kAll{
    IndexVariable{"oil_temperature", value_of<LearnedVariable::kOilTemperature>,
                  LearnedVariable::kOilTemperature, "degC"},
    IndexVariable{"primary_speed", value_of<LearnedVariable::kPrimarySpeed>,
                  LearnedVariable::kPrimarySpeed, "rad/s"},
    IndexVariable{"secondary_pressure", value_of<LearnedVariable::kSecondaryPressure>,
                  LearnedVariable::kSecondaryPressure, "Pa"},
    IndexVariable{"primary_pressure", value_of<LearnedVariable::kPrimaryPressure>,
                  LearnedVariable::kPrimaryPressure, "Pa"},
    IndexVariable{"torque", value_of<LearnedVariable::kTorque>, LearnedVariable::kTorque, "Nm"},
    IndexVariable{"acceleration", acceleration, std::nullopt, ""},
    IndexVariable{"pressure_rate",
                  [](const ExperimentData& r, int) -> ArrayXd { return r.pressure.slow_slope; },
                  std::nullopt, ""},
    IndexVariable{"time", [](const ExperimentData& r, int) -> ArrayXd { return r.t_s; },
                  std::nullopt, ""},
    IndexVariable{"experiment",
                  [](const ExperimentData& r, int e) -> ArrayXd {
                    return ArrayXd::Constant(r.size(), static_cast<double>(e));
                  },
                  std::nullopt, ""},
};

std::vector<double> valid_values(const ExperimentData& run, const ArrayXd& in) {
  std::vector<double> out;
  for (int k = 0; k < run.size(); ++k) {
    if (run.valid[static_cast<std::size_t>(k)]) out.push_back(in[k]);
  }
  return out;
}

// apart: each experiment is a level of its own.
void number_levels(bool apart, Abscissa& out) {
  std::vector<std::size_t> order;
  for (std::size_t e = 0; e < out.x.size(); ++e) {
    if (out.x[e].size() > 0) order.push_back(e);
  }
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return out.mean[a] < out.mean[b]; });
  out.level.assign(out.x.size(), -1);
  double begun = 0.0;
  for (const std::size_t e : order) {
    if (apart || out.levels == 0 || out.mean[e] - begun > kLevelShare * (out.high - out.low)) {
      ++out.levels;
      begun = out.mean[e];
    }
    out.level[e] = out.levels - 1;
  }
}

}  // namespace

std::span<const IndexVariable> index_variables() { return kAll; }

std::optional<Abscissa> abscissa_of(const Campaign& campaign, const IndexVariable& variable) {
  Abscissa out;
  out.variable = &variable;
  std::vector<double> all;
  for (std::size_t e = 0; e < campaign.runs.size(); ++e) {
    const ExperimentData& run = campaign.runs[e];
    out.mean.push_back(0.0);
    out.x.emplace_back();
    if (run.valid_count == 0) continue;
    const ArrayXd value = variable.value(run, static_cast<int>(e));
    if (value.size() == 0 || !value.allFinite()) return std::nullopt;
    out.x.back() =
        variable.learnable ? regressor(run, *variable.learnable) : low_passed(value, run.dt_s);
    const std::vector<double> here = valid_values(run, out.x.back());
    out.mean.back() =
        std::accumulate(here.begin(), here.end(), 0.0) / static_cast<double>(here.size());
    all.insert(all.end(), here.begin(), here.end());
  }
  if (all.size() < kSamplesMin) return std::nullopt;
  std::sort(all.begin(), all.end());
  out.low = all[all.size() / 100];
  out.high = all[all.size() - 1 - all.size() / 100];
  const double span = out.high - out.low;
  if (!(span > kVaried * std::abs(all[all.size() / 2]) + 1e-12)) return std::nullopt;
  double covered = 0.0, used = 0.0;
  for (std::size_t e = 0; e < campaign.runs.size(); ++e) {
    if (out.x[e].size() == 0) continue;
    const std::vector<double> here = valid_values(campaign.runs[e], out.x[e]);
    const auto [least, most] = std::minmax_element(here.begin(), here.end());
    covered += *most - *least;
    used += 1.0;
    if (*most - *least < kMovesShare * span) out.x[e].setConstant(out.mean[e]);
    out.x[e] = ((out.x[e] - out.low) / span).max(0.0).min(1.0);
  }
  // What each experiment sweeps has as many levels as anybody asks for; left out are experiments.
  number_levels(covered > kSwept * span * used, out);
  return out;
}

}  // namespace beltgrip::diagnose
