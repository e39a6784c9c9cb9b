#include "tools/diagnose/report/plots.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>

#include "tools/diagnose/data/order_lines.h"
#include "tools/diagnose/infer/forward.h"
#include "tools/diagnose/report/finding_picture.h"

namespace beltgrip::diagnose {
namespace {

using Eigen::ArrayXd;
using report::Chart;
using report::Series;

constexpr int kExperimentsDrawn = 12;
constexpr std::size_t kPointsMax = 1500;  // per series

// The fit of both models to one experiment.
struct Fitted {
  const ExperimentData* data = nullptr;
  Residuals nominal, extended;
  Forward forward_nominal, forward_extended;
};

// How a forward signal is shown.
struct Shown {
  std::string_view name;
  const char* label;
  double unit;
};
constexpr std::array<Shown, 5> kShown{{{"secondary_speed", "secondary speed, rad/s", 1.0},
                                       {"primary_speed", "primary speed, rad/s", 1.0},
                                       {"slip", "slip by the configured ratio, %", 100.0},
                                       {"primary_torque", "primary torque, Nm", 1.0},
                                       {"secondary_torque", "secondary torque, Nm", 1.0}}};
const Shown& shown(std::string_view name) {
  return *std::find_if(kShown.begin(), kShown.end(),
                       [&](const Shown& each) { return each.name == name; });
}

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

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

std::string file_name(const std::string& path) { return path.substr(path.rfind('/') + 1); }

double sigmas(const Residuals& at, int k) { return at.value[kFrictionResidual][k]; }

// A line that breaks where the simulation pauses.
Series course(std::string name, const ArrayXd& t_s, const ArrayXd& y, const ExperimentData& data) {
  Series out{std::move(name), {}, {}, true};
  for (int k = 0; k < data.size(); ++k) {
    const bool usable = data.valid[static_cast<std::size_t>(k)] && std::isfinite(y[k]);
    out.x.push_back(t_s[k]);
    out.y.push_back(usable ? y[k] : kNaN);
  }
  thin(out);
  return out;
}

void draw_signals(const std::vector<Fitted>& all, bool with_extended, Plots& plots) {
  const std::size_t count = std::min<std::size_t>(all.size(), kExperimentsDrawn);
  for (std::size_t e = 0; e < count; ++e) {
    const ExperimentData& data = *all[e].data;
    const auto& nominal = all[e].forward_nominal.signals;
    const auto& extended = all[e].forward_extended.signals;
    for (std::size_t i = 0; i < nominal.size(); ++i) {
      const Shown& how = shown(nominal[i].name);
      Chart chart{file_name(data.name), "time, s", how.label, {}};
      const auto add = [&](const char* name, const ArrayXd& y) {
        chart.series.push_back(course(name, data.t_s, y * how.unit, data));
      };
      // The first series is drawn on top.
      if (with_extended) {
        add("simulated, extended", extended[i].simulated);
        chart.series.back().dashed = true;
      }
      add("simulated, as given", nominal[i].simulated);
      add("measured", nominal[i].measured);
      plots.signals.push_back(std::move(chart));
    }
  }
}

// A residual in units of its noise over anything.
struct Drawn {
  ResidualKind kind;
  const char* title;
};

using Abscissa = std::function<double(const Fitted&, int)>;

Chart residual_chart(const std::vector<Fitted>& all, const Drawn& what, const char* x_label,
                     bool with_extended, const Abscissa& x) {
  const std::string label = x_label;
  Chart out{what.title + (" over " + label.substr(0, label.find(','))),
            label,
            "residual, sigmas of its noise",
            {}};
  const auto add = [&](const char* name, Residuals Fitted::*at) {
    out.series.push_back(points(
        name, all, [&](const Fitted& each, int k) -> std::optional<std::pair<double, double>> {
          const Residuals& residuals = each.*at;
          // The balance is judged at every fifth sample.
          if (what.kind == kBalanceResidual && residuals.balance_weight[k] == 0.0) return {};
          return std::pair{x(each, k), residuals.value[static_cast<std::size_t>(what.kind)][k]};
        }));
  };
  add("model as given", &Fitted::nominal);
  if (with_extended) add("extended model", &Fitted::extended);
  return out;
}

void draw_residuals(const Campaign& campaign, const std::vector<Fitted>& all, bool with_extended,
                    Plots& plots) {
  std::vector<double> begins_s;
  double end_s = 0.0;
  for (const Fitted& each : all) {
    begins_s.push_back(end_s);
    end_s += each.data->t_s[each.data->size() - 1] + each.data->dt_s;
  }
  const auto index = [&](const Fitted& each) {
    return static_cast<std::size_t>(&each - all.data());
  };
  constexpr const char* kTime = "time, one experiment after the other, s";
  std::vector<Drawn> drawn{{kFrictionResidual, "Friction curve"}};
  if (campaign.has_balance) drawn.push_back({kBalanceResidual, "Torque in against torque out"});
  if (campaign.has_tracking) drawn.push_back({kTrackingResidual, "Pressure against its command"});
  for (const Drawn& each : drawn) {
    plots.over_time.push_back(residual_chart(
        all, each, kTime, with_extended,
        [&](const Fitted& run, int k) { return begins_s[index(run)] + run.data->t_s[k]; }));
  }
  for (std::size_t i = 0; i < all[0].forward_nominal.signals.size(); ++i) {
    const Shown& how = shown(all[0].forward_nominal.signals[i].name);
    Chart chart{"Forward simulation over time", kTime, std::string("error of ") + how.label, {}};
    const auto add = [&](const char* name, Forward Fitted::*forward) {
      chart.series.push_back(points(name, all, [&](const Fitted& each, int k) {
        const auto& signals = (each.*forward).signals;
        const double error =
            i < signals.size() ? signals[i].measured[k] - signals[i].simulated[k] : kNaN;
        return std::optional(
            std::pair{begins_s[index(each)] + each.data->t_s[k], error * how.unit});
      }));
    };
    add("model as given", &Fitted::forward_nominal);
    if (with_extended) add("extended model", &Fitted::forward_extended);
    plots.over_time.push_back(std::move(chart));
  }

  const std::vector<std::pair<const char*, Abscissa>> variables{
      {"primary speed, rad/s",
       [](const Fitted& each, int k) { return each.data->omega_p.value[k]; }},
      {"secondary pressure, bar",
       [](const Fitted& each, int k) { return 1e-5 * each.data->pressure.value[k]; }},
      {"torque, Nm", [](const Fitted& each, int k) { return each.data->torque.slow[k]; }},
      {"slip over slip at the peak",
       [](const Fitted& each, int k) { return std::abs(each.nominal.foot[k]); }},
      {"speed ratio",
       [](const Fitted& each, int k) {
         return each.data->omega_s.value[k] / each.data->omega_p.value[k];
       }},
      {"acceleration of the primary shaft, rad/s2",
       [](const Fitted& each, int k) { return each.data->omega_p.slow_slope[k]; }},
      {"rate of the secondary pressure, bar/s",
       [](const Fitted& each, int k) { return 1e-5 * each.data->pressure.slow_slope[k]; }},
      {"primary pressure, bar",
       [](const Fitted& each, int k) {
         return each.data->pressure_p.present ? 1e-5 * each.data->pressure_p.value[k] : kNaN;
       }},
      {"oil temperature, degC",
       [](const Fitted& each, int k) {
         return each.data->temperature.present ? each.data->temperature.value[k] : kNaN;
       }},
      {"time in the experiment, s", [](const Fitted& each, int k) { return each.data->t_s[k]; }},
      {"experiment",
       [&](const Fitted& each, int) { return static_cast<double>(index(each)) + 1.0; }}};
  for (const Drawn& each : drawn) {
    for (const auto& [label, x] : variables) {
      Chart chart = residual_chart(all, each, label, with_extended, x);
      if (!chart.series[0].x.empty()) plots.over_variables.push_back(std::move(chart));
    }
  }
}

void draw_friction(const std::vector<Fitted>& all, const ModelState& nominal,
                   const ModelState& extended, bool with_extended, Plots& plots) {
  for (const int stop : {kOverdriveStop, kLowStop}) {
    const auto part = [&](const Residuals& at, const ModelState& state, const Fitted& each, int k,
                          bool curve) -> std::optional<std::pair<double, double>> {
      if (each.data->stop[static_cast<std::size_t>(k)] != stop) return std::nullopt;
      const double mu_max = std::exp(state.nuisance[kLnMuMax]);
      const double torque_Nm = at.model_Nm[k] + (curve ? 0.0 : sigmas(at, k) / at.weight[k]);
      const double peak =
          std::exp(state.nuisance[stop == kLowStop ? kLnPeakSlipLow : kLnPeakSlipOverdrive]);
      return std::pair{100.0 * std::abs(curve ? at.foot[k] * peak : at.measured.slip_share[k]),
                       mu_max * std::abs(torque_Nm) / at.measured.capacity[k]};
    };
    Chart chart{stop == kLowStop ? "Low" : "Overdrive", "slip, %", "traction coefficient", {}};
    // The first series is drawn on top.
    chart.series.push_back(points(
        with_extended ? "curve of the extended model" : "curve of the model", all,
        [&](const Fitted& each, int k) { return part(each.extended, extended, each, k, true); }));
    chart.series.push_back(points(
        with_extended ? "measured, seen through the model as given" : "measured", all,
        [&](const Fitted& each, int k) { return part(each.nominal, nominal, each, k, false); }));
    if (with_extended) {
      chart.series.push_back(
          points("measured, seen through the extended model", all, [&](const Fitted& each, int k) {
            return part(each.extended, extended, each, k, false);
          }));
    }
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
                 const std::vector<SignalTable>& tables, const Diagnosis& found) {
  std::vector<Fitted> all;
  for (std::size_t e = 0; e < campaign.runs.size(); ++e) {
    if (campaign.runs[e].valid_count == 0) continue;
    const int run = static_cast<int>(e);
    all.push_back({&campaign.runs[e], residuals_of(campaign, run, nominal),
                   residuals_of(campaign, run, extended), run_forward(campaign, run, nominal),
                   run_forward(campaign, run, extended)});
  }
  Plots plots;
  if (all.empty()) return plots;
  const bool with_extended = (extended.effects.array() != 0.0).any() || !extended.learned.empty();
  plots.findings = pictures_of(campaign, extended, found.findings);
  plots.learned = points_of_learned(campaign, extended, found.learned);
  draw_signals(all, with_extended, plots);
  draw_residuals(campaign, all, with_extended, plots);
  draw_friction(all, nominal, extended, with_extended, plots);
  draw_orders(tables, plots);
  return plots;
}

}  // namespace beltgrip::diagnose
