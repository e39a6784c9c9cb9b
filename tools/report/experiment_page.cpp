#include "tools/report/experiment_page.h"

#include <algorithm>

namespace beltgrip::report {
namespace {

constexpr std::size_t kPointsMax = 1500;  // per series: a browser stays quick

std::size_t stride_of(const ExperimentCourse& course) {
  return std::max<std::size_t>(1, (course.t_s.size() + kPointsMax - 1) / kPointsMax);
}

Series level(std::string name, double from, double to, double y) {
  return {std::move(name), {from, to}, {y, y}, true, true};
}

// The value and its interval across the chart.
void add_peak(const ExperimentCourse& course, double from, double to, Chart& chart) {
  if (!course.peak) return;
  chart.series.push_back(level("mu_max", from, to, course.peak->mu_max));
  chart.series.push_back(level("95 %, lower end", from, to, course.peak->low));
  chart.series.push_back(level("95 %, upper end", from, to, course.peak->high));
}

Chart over_time(const ExperimentCourse& course, const char* title, const char* y_label,
                const std::vector<double>& y) {
  Chart chart{title, "time, s", y_label, {}};
  Series line{"estimate", {}, {}, true};
  for (std::size_t i = 0; i < course.t_s.size(); i += stride_of(course)) {
    line.x.push_back(course.t_s[i]);
    line.y.push_back(y[i]);
  }
  if (course.stop_s && !line.y.empty()) {
    const auto [least, most] = std::minmax_element(line.y.begin(), line.y.end());
    chart.series.push_back({"stop", {*course.stop_s, *course.stop_s}, {*least, *most}, true, true});
  }
  chart.series.insert(chart.series.begin(), std::move(line));
  return chart;
}

void add_level(Chart& chart, const ExperimentCourse& course, const char* name, double y) {
  chart.series.push_back(level(name, course.t_s.front(), course.t_s.back(), y));
}

// What the method judged by, over time.
std::vector<Chart> courses(const ExperimentCourse& course,
                           const std::optional<PhaseThresholds>& thresholds) {
  Chart traction = over_time(course, "Traction coefficient mu*", "mu*", course.mu_star);
  add_peak(course, course.t_s.front(), course.t_s.back(), traction);
  Chart variance = over_time(course, "Slip variance", "(%)^2", course.slip_variance);
  Chart slope = over_time(course, "Friction slope", "1/%", course.friction_slope_per_percent);
  if (thresholds) {
    add_level(variance, course, "excited above", thresholds->excitation);
    add_level(slope, course, "peak below", thresholds->peak_slope);
    add_level(slope, course, "stop below", thresholds->stop_slope);
  }
  return {std::move(traction), over_time(course, "Slip sigma*", "%", course.sigma_star_percent),
          over_time(course, "Clamping force", "N", course.clamp_force_N), std::move(variance),
          std::move(slope)};
}

// The sample of the stop, on the curve.
void add_stop(const ExperimentCourse& course, Chart& chart) {
  if (!course.stop_s) return;
  const auto at = std::lower_bound(course.t_s.begin(), course.t_s.end(), *course.stop_s);
  if (at == course.t_s.end()) return;
  const auto i = static_cast<std::size_t>(at - course.t_s.begin());
  chart.series.push_back({"stop", {course.sigma_star_percent[i]}, {course.mu_star[i]}});
}

Chart traction_curve(const ExperimentCourse& course,
                     const std::array<std::string, kPhaseCount>& phase_names) {
  Chart chart{"Traction curve, by phase", "slip sigma*, %", "traction coefficient mu*", {}};
  double from = 0.0, to = 0.0;
  for (std::size_t phase = 0; phase < kPhaseCount; ++phase) {
    Series points{phase_names[phase], {}, {}};
    for (std::size_t i = 0; i < course.t_s.size(); i += stride_of(course)) {
      if (course.phase[i] != phase) continue;
      points.x.push_back(course.sigma_star_percent[i]);
      points.y.push_back(course.mu_star[i]);
      from = std::min(from, points.x.back());
      to = std::max(to, points.x.back());
    }
    if (!points.x.empty()) chart.series.push_back(std::move(points));
  }
  add_stop(course, chart);
  add_peak(course, from, to, chart);
  return chart;
}

}  // namespace

void add_experiments(HtmlPage& page, const std::vector<ExperimentCourse>& experiments,
                     const std::array<std::string, kPhaseCount>& phase_names,
                     const std::optional<PhaseThresholds>& thresholds) {
  std::vector<std::vector<std::string>> rows;
  rows.reserve(experiments.size());
  for (const ExperimentCourse& course : experiments) rows.push_back(course.verdict);
  page.table(kVerdictHeader, rows);
  for (const ExperimentCourse& course : experiments) {
    page.heading(course.name);
    if (course.t_s.empty()) {
      page.paragraph("No sample of it could be used.");
      continue;
    }
    std::vector<Chart> charts = courses(course, thresholds);
    charts.insert(charts.begin(), traction_curve(course, phase_names));
    page.charts(charts);
  }
}

}  // namespace beltgrip::report
