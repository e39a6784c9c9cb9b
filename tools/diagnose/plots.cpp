#include "tools/diagnose/plots.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>

#include "tools/diagnose/order_lines.h"

namespace beltgrip::diagnose {
namespace {

using Eigen::ArrayXd;
using report::Chart;
using report::Series;

constexpr int kExperimentsDrawn = 12;
constexpr std::size_t kPointsMax = 1500;  // per series
constexpr double kBelow = 0.7;            // slip over slip at the peak: there torque decides slip

// The fit of both models to one experiment.
struct Fitted {
  const ExperimentData* data = nullptr;
  Residuals nominal, extended;
};

// Every so many points, so that a chart stays quick.
void thin(Series& series) {
  const std::size_t step = (series.x.size() + kPointsMax - 1) / kPointsMax;
  if (step <= 1) return;
  std::size_t kept = 0;
  for (std::size_t i = 0; i < series.x.size(); i += step, ++kept) {
    series.x[kept] = series.x[i];
    series.y[kept] = series.y[i];
  }
  series.x.resize(kept);
  series.y.resize(kept);
}

Series points(std::string name, const std::vector<Fitted>& all,
              const std::function<std::optional<std::pair<double, double>>(const Fitted&, int)>& at,
              bool line = false) {
  Series out{std::move(name), {}, {}, line};
  for (const Fitted& each : all) {
    for (int k = 0; k < each.data->size(); ++k) {
      if (!each.data->valid[static_cast<std::size_t>(k)]) continue;
      const auto point = at(each, k);
      if (!point || !std::isfinite(point->first) || !std::isfinite(point->second)) continue;
      out.x.push_back(point->first);
      out.y.push_back(point->second);
    }
  }
  thin(out);
  return out;
}

double sigmas(const Residuals& at, int k) { return at.value[kFrictionResidual][k]; }

void draw_signals(const std::vector<Fitted>& all, Plots& plots) {
  const std::size_t count = std::min<std::size_t>(all.size(), kExperimentsDrawn);
  for (std::size_t e = 0; e < count; ++e) {
    const std::vector<Fitted> one{all[e]};
    const ExperimentData& data = *one[0].data;
    Chart torque{data.name + ": torque", "time, s", "torque at the shaft, Nm", {}};
    Chart speed{data.name + ": secondary speed below the peak", "time, s", "speed, rad/s", {}};
    const auto torque_of = [](const Residuals* at) {
      return [at](const Fitted& each, int k) -> std::optional<std::pair<double, double>> {
        const double off = at == nullptr ? 0.0 : sigmas(*at, k) / at->weight[k];
        return std::pair{each.data->t_s[k], each.data->torque.value[k] - off};
      };
    };
    const auto speed_of = [](const Residuals* at) {
      return [at](const Fitted& each, int k) -> std::optional<std::pair<double, double>> {
        const Residuals& judge = at == nullptr ? each.nominal : *at;
        if (std::abs(judge.foot[k]) > kBelow || !(judge.slope[k] > 0.0)) return std::nullopt;
        const double off = at == nullptr ? 0.0 : sigmas(*at, k) / at->weight[k] / at->slope[k];
        return std::pair{each.data->t_s[k], each.data->omega_s.value[k] * (1.0 + off)};
      };
    };
    for (const auto& [name, at] : {std::pair<const char*, const Residuals*>{"measured", nullptr},
                                   {"simulated", &one[0].nominal},
                                   {"simulated, extended model", &one[0].extended}}) {
      torque.series.push_back(points(name, one, torque_of(at), true));
      speed.series.push_back(points(name, one, speed_of(at)));
    }
    plots.signals.push_back(std::move(torque));
    if (!speed.series[0].x.empty()) plots.signals.push_back(std::move(speed));
  }
}

void draw_residuals(const std::vector<Fitted>& all, Plots& plots) {
  const auto chart = [&](const std::string& title, const std::string& x_label,
                         const std::function<double(const Fitted&, int)>& x) {
    Chart out{title, x_label, "residual, sigmas of the noise", {}};
    out.series.push_back(points("model as given", all, [&](const Fitted& each, int k) {
      return std::optional(std::pair{x(each, k), sigmas(each.nominal, k)});
    }));
    out.series.push_back(points("extended model", all, [&](const Fitted& each, int k) {
      return std::optional(std::pair{x(each, k), sigmas(each.extended, k)});
    }));
    return out;
  };
  std::vector<double> begins_s;
  double end_s = 0.0;
  for (const Fitted& each : all) {
    begins_s.push_back(end_s);
    end_s += each.data->t_s[each.data->size() - 1] + each.data->dt_s;
  }
  const auto index = [&](const Fitted& each) {
    return static_cast<std::size_t>(&each - all.data());
  };
  plots.over_time.push_back(
      chart("All experiments, one after the other", "time, s",
            [&](const Fitted& each, int k) { return begins_s[index(each)] + each.data->t_s[k]; }));
  const auto over = [&](const char* label, const std::function<double(const Fitted&, int)>& x) {
    const std::string text = label;
    plots.over_variables.push_back(chart("Over " + text.substr(0, text.find(',')), text, x));
  };
  over("primary speed, rad/s",
       [](const Fitted& each, int k) { return each.data->omega_p.value[k]; });
  over("secondary pressure, bar",
       [](const Fitted& each, int k) { return 1e-5 * each.data->pressure.value[k]; });
  over("torque, Nm", [](const Fitted& each, int k) { return each.data->torque.slow[k]; });
  over("slip over slip at the peak",
       [](const Fitted& each, int k) { return std::abs(each.nominal.foot[k]); });
  over("acceleration of the primary shaft, rad/s2",
       [](const Fitted& each, int k) { return each.data->omega_p.slow_slope[k]; });
  over("rate of the secondary pressure, bar/s",
       [](const Fitted& each, int k) { return 1e-5 * each.data->pressure.slow_slope[k]; });
  const bool oil = std::any_of(all.begin(), all.end(),
                               [](const Fitted& each) { return each.data->temperature.present; });
  if (oil) {
    over("oil temperature, degC", [](const Fitted& each, int k) {
      return each.data->temperature.present ? each.data->temperature.value[k]
                                            : std::numeric_limits<double>::quiet_NaN();
    });
  }
  over("experiment",
       [&](const Fitted& each, int) { return static_cast<double>(index(each)) + 1.0; });
}

void draw_friction(const std::vector<Fitted>& all, const ModelState& nominal,
                   const ModelState& extended, Plots& plots) {
  for (const int stop : {kOverdriveStop, kLowStop}) {
    const auto part = [&](const Residuals& at, const ModelState& state, const Fitted& each, int k,
                          bool curve) -> std::optional<std::pair<double, double>> {
      if (each.data->stop[static_cast<std::size_t>(k)] != stop) return std::nullopt;
      const double mu_max = std::exp(state.nuisance[kLnMuMax]);
      const double torque_Nm = at.model_Nm[k] + (curve ? 0.0 : sigmas(at, k) / at.weight[k]);
      const double peak =
          std::exp(state.nuisance[stop == kLowStop ? kLnPeakSlipLow : kLnPeakSlipOverdrive]);
      return std::pair{100.0 * std::abs(curve ? at.foot[k] * peak : at.slip[k]),
                       mu_max * std::abs(torque_Nm) / at.capacity[k]};
    };
    Chart chart{stop == kLowStop ? "Low" : "Overdrive", "slip, %", "traction coefficient", {}};
    // The first series is drawn on top.
    chart.series.push_back(points(
        "curve of the extended model", all,
        [&](const Fitted& each, int k) { return part(each.extended, extended, each, k, true); }));
    chart.series.push_back(points(
        "measured, seen through the model as given", all,
        [&](const Fitted& each, int k) { return part(each.nominal, nominal, each, k, false); }));
    chart.series.push_back(points(
        "measured, seen through the extended model", all,
        [&](const Fitted& each, int k) { return part(each.extended, extended, each, k, false); }));
    if (!chart.series[0].x.empty()) plots.friction.push_back(std::move(chart));
  }
}

void draw_orders(const std::vector<SignalTable>& tables, Plots& plots) {
  for (const auto& [role, name] : {std::pair{Role::kPrimarySpeed, "Primary speed"},
                                   {Role::kSecondarySpeed, "Secondary speed"}}) {
    const OrderSpectrum spectrum = order_spectrum(tables, role);
    if (spectrum.order.empty()) continue;
    Series line{name, spectrum.order, {}, true};
    for (const double amplitude : spectrum.amplitude) line.y.push_back(1e3 * amplitude);
    plots.orders.push_back(
        {name, "cycles per revolution of that shaft", "amplitude, 1/1000 of the speed", {line}});
  }
}

}  // namespace

Plots make_plots(const Campaign& campaign, const ModelState& nominal, const ModelState& extended,
                 const std::vector<SignalTable>& tables) {
  std::vector<Fitted> all;
  for (std::size_t e = 0; e < campaign.runs.size(); ++e) {
    if (campaign.runs[e].valid_count == 0) continue;
    const int run = static_cast<int>(e);
    all.push_back({&campaign.runs[e], residuals_of(campaign, run, nominal),
                   residuals_of(campaign, run, extended)});
  }
  Plots plots;
  draw_signals(all, plots);
  draw_residuals(all, plots);
  draw_friction(all, nominal, extended, plots);
  draw_orders(tables, plots);
  return plots;
}

}  // namespace beltgrip::diagnose
