#include "tools/report/experiment_page.h"

#include <algorithm>

namespace beltgrip::report {
namespace {

constexpr std::size_t kPointsMax = 1500;  // of a curve: a browser stays quick

std::size_t stride_of(const ExperimentCourse& course) {
  return std::max<std::size_t>(1, (course.t_s.size() + kPointsMax - 1) / kPointsMax);
}

// What the method judged by, over time: the paper's Figure 6.
Courses over_time(const ExperimentCourse& course,
                  const std::optional<PhaseThresholds>& thresholds) {
  Panel traction{"traction coefficient", {{"mu*", course.mu_star}}, {}, {}, {}};
  if (course.peak) {
    traction.levels = {{"mu_max", course.peak->mu_max}};
    traction.band = {course.peak->low, course.peak->high};
  }
  Panel slip{"slip, %", {{"sigma*", course.sigma_star_percent}}, {}, {}, {}};
  Panel force{"clamping force, N", {{"force", course.clamp_force_N}}, {}, {}, {}};
  Panel variance{"slip variance, (%)^2", {{"variance", course.slip_variance}}, {}, {}, {}};
  Panel slope{"friction slope, 1/%", {{"slope", course.friction_slope_per_percent}}, {}, {}, {}};
  if (thresholds) {
    variance.levels = {{"excited above", thresholds->excitation}};
    slope.levels = {{"peak below", thresholds->peak_slope}, {"stop below", thresholds->stop_slope}};
  }
  Courses courses;
  courses.t_s = course.t_s;
  courses.period_s = course.period_s;
  courses.panels = {std::move(traction), std::move(slip), std::move(force), std::move(variance),
                    std::move(slope)};
  if (course.stop_s) courses.marks = {{*course.stop_s, "stop"}};
  return courses;
}

// The sample of the stop, on the curve.
void add_stop(const ExperimentCourse& course, Chart& chart) {
  if (!course.stop_s) return;
  const auto at = std::lower_bound(course.t_s.begin(), course.t_s.end(), *course.stop_s);
  if (at == course.t_s.end()) return;
  const auto i = static_cast<std::size_t>(at - course.t_s.begin());
  chart.series.push_back({"stop", {course.sigma_star_percent[i]}, {course.mu_star[i]}});
}

// The value and its interval across the chart.
void add_peak(const ExperimentCourse& course, double from, double to, Chart& chart) {
  if (!course.peak) return;
  const auto [mu_max, low, high] = *course.peak;
  chart.series.push_back({"mu_max", {from, to}, {mu_max, mu_max}, true, true});
  chart.series.push_back({"", {from, to}, {low, low}, true, false, true});
  chart.series.push_back({"95 % interval", {from, to}, {high, high}, true, false, true});
}

// The paper's Figure 7.
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
  if (experiments.empty()) return;
  page.heading("Experiments");
  std::vector<std::vector<std::string>> rows;
  rows.reserve(experiments.size());
  for (const ExperimentCourse& course : experiments) rows.push_back(course.verdict);
  page.table(kVerdictHeader, rows);
  if (!thresholds) {
    page.paragraph(
        "Method robust: its phases and its stop follow from what it finds probable, not from "
        "thresholds of slip variance and slope; with method paper these are drawn.");
  }
  for (const ExperimentCourse& course : experiments) {
    page.heading(course.name);
    if (course.t_s.empty()) {
      page.paragraph("No sample of it could be used.");
      continue;
    }
    page.beside({traction_curve(course, phase_names)}, over_time(course, thresholds));
  }
}

}  // namespace beltgrip::report
