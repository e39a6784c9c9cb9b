#include "tools/cli/history_page.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "can_dbc/text/format.h"
#include "daemon/core/publish/names.h"
#include "tools/report/html_page.h"
#include "tools/text/snake_case.h"

namespace beltgrip::cli {

namespace {

using estimator::PeakKind;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

std::string number(const char* pattern, double value) {
  return std::isfinite(value) ? format(pattern, value) : "";
}

bool belongs(const daemon::HistoryRow& row, estimator::Direction direction,
             estimator::EndStop end_stop) {
  return row.result.direction == direction && row.result.end_stop == end_stop;
}

// The values of one direction at one end stop, one place for each row of the history.
report::Panel panel_of(const History& history, estimator::Direction direction,
                       estimator::EndStop end_stop) {
  const std::size_t n = history.rows.size();
  const auto course = [n](const char* name, report::Style style) {
    return report::Course{name, std::vector<double>(n, kNone), style};
  };
  report::Course value = course("value", report::Style::kWhiskers),
                 low = course("95 % from", report::Style::kHidden),
                 high = course("95 % to", report::Style::kHidden),
                 bound = course("at least", report::Style::kPoints),
                 other = course("under another configuration", report::Style::kPoints);
  for (std::size_t i = 0; i < n; ++i) {
    const daemon::HistoryRow& row = history.rows[i];
    const estimator::PeakEstimate& peak = row.result.peak;
    if (!belongs(row, direction, end_stop) || peak.kind == PeakKind::kNone) continue;
    if (peak.kind == PeakKind::kLowerBound) {
      bound.value[i] = peak.mu_max;
    } else if (row.fingerprint != history.fingerprint) {
      other.value[i] = peak.mu_max;
    } else {
      value.value[i] = peak.mu_max;
      low.value[i] = peak.ci95_low;
      high.value[i] = peak.ci95_high;
    }
  }
  const std::string where = text::snake_case(daemon::direction_name(direction)) + ", " +
                            text::snake_case(daemon::end_stop_name(end_stop));
  report::Panel panel{"mu_max, " + where, {}, {}, {}, {}};
  const auto add = [&](const report::Course& shown, const std::vector<report::Course>& with) {
    const bool any = std::any_of(shown.value.begin(), shown.value.end(),
                                 [](double each) { return std::isfinite(each); });
    if (!any) return;
    panel.courses.push_back(shown);
    panel.courses.insert(panel.courses.end(), with.begin(), with.end());
  };
  add(value, {low, high});
  add(bound, {});
  add(other, {});
  return panel;
}

report::Courses trend(const History& history) {
  report::Courses courses;
  courses.label = "experiment";
  for (const daemon::HistoryRow& row : history.rows) {
    courses.t_s.push_back(static_cast<double>(row.id));
    courses.names.push_back("experiment " + std::to_string(row.id) + ", " + utc(row.time_s));
  }
  for (const auto direction : {estimator::Direction::kDrive, estimator::Direction::kOverrun}) {
    for (const auto end_stop : {estimator::EndStop::kOverdrive, estimator::EndStop::kLow}) {
      const bool any =
          std::any_of(history.rows.begin(), history.rows.end(), [&](const daemon::HistoryRow& row) {
            return belongs(row, direction, end_stop) && row.result.peak.kind != PeakKind::kNone;
          });
      if (!any) continue;
      report::Panel& panel = courses.panels.emplace_back(panel_of(history, direction, end_stop));
      for (const HistoryGroup& group : history.groups) {
        if (group.direction != direction || group.end_stop != end_stop) continue;
        panel.levels = {{"together", group.fused.mu_max}};
        panel.band = {group.fused.ci95_low, group.fused.ci95_high};
        if (group.wear.found && group.since != nullptr) {
          courses.marks.push_back({static_cast<double>(group.since->id),
                                   "worn, " + number("%+.1f %%", group.wear.change_percent)});
        }
      }
    }
  }
  return courses;
}

void add_lines(report::HtmlPage& page, const std::string& lines) {
  for (std::size_t from = 0, to; (to = lines.find('\n', from)) != std::string::npos;
       from = to + 1) {
    page.paragraph(lines.substr(from, to - from));
  }
}

void add_table(report::HtmlPage& page, const History& history) {
  std::vector<std::vector<std::string>> rows;
  for (const daemon::HistoryRow& row : history.rows) {
    const daemon::ExperimentResult& result = row.result;
    const estimator::PeakEstimate& peak = result.peak;
    const bool value = peak.kind == PeakKind::kValue;
    const std::string mu_max = value ? number("%.4f", peak.mu_max)
                               : peak.kind == PeakKind::kLowerBound
                                   ? number("at least %.4f", peak.mu_max)
                                   : "";
    std::string notes = notes_text(row.notes, ", ");
    if (row.fingerprint != history.fingerprint) {
      notes += notes.empty() ? "other configuration" : ", other configuration";
    }
    rows.push_back({std::to_string(row.id), utc(row.time_s),
                    text::snake_case(daemon::outcome_name(result.outcome)) + ", " +
                        text::snake_case(daemon::stop_reason_name(result.stop_reason)),
                    text::snake_case(daemon::direction_name(result.direction)),
                    text::snake_case(daemon::end_stop_name(result.end_stop)), mu_max,
                    value ? number("%.4f", peak.ci95_low) + number(" .. %.4f", peak.ci95_high) : "",
                    number("%.2f", result.sigma_stop_percent), number("%.0f", result.torque_Nm),
                    number("%.0f", result.clamp_force_N), number("%.0f", result.oil_degC), notes});
  }
  page.table({"experiment", "time (UTC)", "outcome", "torque", "ratio", "mu_max", "95 % interval",
              "slip at the stop, %", "torque, Nm", "clamping force, N", "oil, degC", "notes"},
             rows);
}

}  // namespace

std::string history_page(const History& history) {
  report::HtmlPage page("BeltGrip: the belt's history");
  page.paragraph(history.path);
  if (history.rows.empty()) {
    page.paragraph("No experiment yet.");
    return page.text();
  }
  page.heading("mu_max over the belt's life");
  const report::Courses courses = trend(history);
  if (courses.panels.empty()) {
    page.paragraph("No experiment gave a value or a bound.");
  } else {
    page.courses(courses);
  }
  for (const HistoryGroup& group : history.groups) add_lines(page, fused_text(group));
  add_lines(page, carried_lines(history));
  page.heading("Experiments");
  add_table(page, history);
  return page.text();
}

}  // namespace beltgrip::cli
