#include "tools/diagnose/html.h"

#include <cstdio>

#include "tools/diagnose/json.h"

namespace beltgrip::diagnose {
namespace {

using Rows = std::vector<std::vector<std::string>>;

std::string number(double value) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%.4g", value);
  return buffer;
}

std::string range(double low, double high) { return number(low) + " .. " + number(high); }

std::string probability(double value) { return value > 0.999 ? "> 0.999" : number(value); }

std::string joined(const std::vector<std::string>& words) {
  std::string out;
  for (const std::string& each : words) out += (out.empty() ? "" : ", ") + each;
  return out;
}

std::string sizes(const Finding& finding) {
  std::string out;
  const auto add = [&](const std::string& text) { out += (out.empty() ? "" : "; ") + text; };
  for (const auto& [name, value] : finding.parameters) {
    add(name + " = " + number(value.value) + " (" + range(value.low, value.high) + ")");
  }
  for (const auto& [name, value] : finding.fixed) add(name + " = " + number(value));
  return out;
}

std::string name_of(const Finding& finding) {
  return finding.effect + (finding.role.empty() ? "" : " of " + finding.role);
}

std::string sentence(const Finding& finding) {
  std::string out = name_of(finding) + ": " + finding.equation + ", " + sizes(finding) +
                    "; probability " + probability(finding.probability) + ".";
  if (!finding.aliases.empty()) {
    out += " These data cannot tell it from " + joined(finding.aliases) + ".";
  }
  return out;
}

void add_findings(report::HtmlPage& page, const Diagnosis& d) {
  if (d.findings.empty()) return;
  page.heading("What is wrong");
  Rows rows;
  for (const Finding& finding : d.findings) {
    rows.push_back({name_of(finding), finding.equation, sizes(finding),
                    probability(finding.probability), joined(finding.aliases),
                    finding.separate_by});
  }
  page.table({"effect", "equation", "size (95 %)", "probability", "these data cannot tell it from",
              "what would"},
             rows);
}

void add_tables(report::HtmlPage& page, const Diagnosis& d) {
  page.heading("The model as given against the data");
  Rows rows;
  for (const auto& [name, signal] : d.baseline) {
    std::string failed;
    for (const auto& [test, p] : signal.tests) {
      if (p < 0.001) failed += (failed.empty() ? "" : ", ") + test + " (p " + number(p) + ")";
    }
    rows.push_back({name, number(signal.rmse), number(signal.noise_floor),
                    number(100.0 * signal.unexplained_share) + " %",
                    failed.empty() ? "none" : failed});
  }
  page.table({"signal, SI", "error, rms", "noise", "unexplained", "its residual follows"}, rows);
  if (!d.held_out.empty()) {
    page.heading("Errors on experiments that were not used for the fit");
    rows.clear();
    for (const auto& [name, gain] : d.held_out) {
      rows.push_back({name, number(gain.before), number(gain.after), range(gain.low, gain.high)});
    }
    if (d.mu_max) {
      rows.push_back({"mu_max, relative", number(d.mu_max->before), number(d.mu_max->after),
                      range(d.mu_max->low, d.mu_max->high)});
    }
    page.table({"signal, SI", "before", "after", "difference (95 %)"}, rows);
  }
  if (!d.simulation.empty()) {
    page.heading("The simulation run forward");
    page.paragraph(
        "Integrated over each experiment, driven by what drives the machine there, up to the peak "
        "of friction, where it ends and begins anew once the belt grips. Before and after: "
        "experiments left out of the fit.");
    rows.clear();
    for (const auto& [name, signal] : d.simulation) {
      rows.push_back({name, number(signal.rmse), number(signal.noise_floor)});
      if (!signal.left_out) continue;
      const BeforeAfter& gain = *signal.left_out;
      for (const std::string& cell :
           {number(gain.before), number(gain.after), range(gain.low, gain.high)}) {
        rows.back().push_back(cell);
      }
    }
    page.table(
        {"signal, SI", "error as given, rms", "noise", "before", "after", "difference (95 %)"},
        rows);
  }
  if (!d.reruns.empty()) {
    page.heading("By the estimator, told the model before and after");
    std::vector<std::string> head{"experiment", "from, s"};
    for (const RerunFigure& figure : kRerunFigures) head.emplace_back(figure.heading);
    rows.clear();
    for (const Rerun& each : d.reruns) {
      char from[32];
      std::snprintf(from, sizeof from, "%.2f", each.start_s);
      rows.push_back({each.log, from});
      for (const RerunFigure& figure : kRerunFigures) {
        rows.back().push_back(figure_text(each, figure));
      }
    }
    page.table(head, rows);
  }
  if (!d.not_identifiable.empty()) {
    page.heading("What these experiments cannot show");
    rows.clear();
    for (const NotIdentifiable& each : d.not_identifiable) {
      std::string sizes;
      for (const auto& [name, value] : each.smallest_detectable) {
        sizes += name + " " + number(value) + " ";
      }
      rows.push_back({each.effect, sizes, each.reason});
    }
    page.table({"effect", "smallest size that would be seen", "why"}, rows);
  }
}

}  // namespace

std::string html_text(const Diagnosis& d, const Plots& plots) {
  report::HtmlPage page("BeltGrip: diagnosis");
  page.paragraph(headline(d));
  if (d.verdict == Verdict::kNothingWrong) {
    page.paragraph(
        "The model departs from these data by no more than noise and the scatter between "
        "experiments do.");
  }
  for (const Finding& finding : d.findings) page.paragraph(sentence(finding));
  if (d.unexplained) {
    page.paragraph("Something that is not in the library acts on " + d.unexplained->acts_on +
                   " and follows " + joined(d.unexplained->depends_on) + ".");
  }
  if (!d.next_experiment.empty()) page.paragraph("Next experiment: " + d.next_experiment + ".");
  add_findings(page, d);
  add_tables(page, d);
  const auto draw = [&](const char* heading, const std::vector<report::Chart>& charts) {
    if (charts.empty()) return;
    page.heading(heading);
    page.charts(charts);
  };
  draw("Measured and simulated", plots.signals);
  draw("Friction", plots.friction);
  draw("Residual over time", plots.over_time);
  draw("Residual over what it may depend on", plots.over_variables);
  draw("Order spectra", plots.orders);
  if (!d.notes.empty()) {
    page.heading("Notes");
    for (const std::string& note : d.notes) page.paragraph(note);
  }
  return page.text();
}

}  // namespace beltgrip::diagnose
