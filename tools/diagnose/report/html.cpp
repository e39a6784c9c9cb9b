#include "tools/diagnose/report/html.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "can_dbc/text/number_text.h"
#include "tools/diagnose/data/baseline_tests.h"
#include "tools/diagnose/report/finding_words.h"
#include "tools/diagnose/report/json.h"
#include "tools/text/joined.h"

namespace beltgrip::diagnose {
namespace {

using Rows = std::vector<std::vector<std::string>>;

std::string range(double low, double high) {
  return rounded_text(low) + " .. " + rounded_text(high);
}

std::string probability(double value) { return value > 0.999 ? "> 0.999" : rounded_text(value); }

std::string sizes(const Finding& finding) {
  std::string out;
  const auto add = [&](const std::string& text) { out += (out.empty() ? "" : "; ") + text; };
  for (const auto& [name, value] : finding.parameters) {
    const std::string unit(unit_of(finding.effect, name));
    add(name + " = " + rounded_text(value.value) + " (" + range(value.low, value.high) + ")" +
        (unit.empty() ? "" : " " + unit));
  }
  if (!finding.from_file.empty()) add("from " + finding.from_file + " on");
  return out;
}

std::string name_of(const Finding& finding) {
  return finding.effect + (finding.role.empty() ? "" : " (" + finding.role + ")");
}

std::string sentence(const Finding& finding) {
  std::string out = name_of(finding) + ": " + finding.equation + ", " + sizes(finding) +
                    "; probability " + probability(finding.probability) + ".";
  if (finding.stability) {
    out += " There in " + rounded_text(100.0 * *finding.stability) +
           " % of the fits without one experiment.";
  }
  if (!finding.aliases.empty()) {
    out += " These data cannot tell it from " + text::joined(finding.aliases) + ".";
  }
  return out;
}

void add_findings(report::HtmlPage& page, const Diagnosis& d,
                  const std::vector<report::Chart>& pictures) {
  if (d.findings.empty()) return;
  page.heading("What is wrong");
  Rows rows;
  for (const Finding& finding : d.findings) {
    rows.push_back({name_of(finding), finding.equation, sizes(finding),
                    probability(finding.probability), text::joined(finding.aliases),
                    finding.separate_by});
  }
  page.table({"effect", "equation", "size (95 %)", "probability", "these data cannot tell it from",
              "what would"},
             rows);
  if (pictures.empty()) return;
  page.paragraph(
      "Over what each follows: what the data ask for where it acts, what the finding gives, and "
      "what is left with it in the model. Each point stands for as many samples; the other "
      "findings "
      "and the machine's constants are as fitted.");
  page.charts(pictures);
}

void add_gain(std::vector<std::string>& row, const std::string& name, const BeforeAfter& gain) {
  constexpr int kDigits = 4;
  const Display shown = display_of(name);
  row.push_back(told(name, gain.before, kDigits));
  row.push_back(told(name, gain.after, kDigits));
  row.push_back(range(shown.per_SI * gain.low, shown.per_SI * gain.high) + " " +
                std::string(shown.unit));
}

// The function with its 95 % band over what it follows.
report::Chart picture_of(const LearnedFinding& learned, std::vector<report::Series> points) {
  constexpr double kBand = 1.96;
  const Display of_x = display_of(learned.depends_on.front()), of_y = display_of(learned.acts_on);
  report::Series mean{"as found", {}, {}, true, false};
  report::Series low{"", {}, {}, true, false, true}, high{"95 %", {}, {}, true, false, true};
  const std::size_t n = learned.knots.size();
  for (std::size_t i = 0; i < n; ++i) {
    const double half = kBand * std::sqrt(std::max(0.0, learned.covariance[i * n + i]));
    for (report::Series* series : {&mean, &low, &high}) {
      series->x.push_back(of_x.per_SI * learned.knots[i]);
    }
    mean.y.push_back(of_y.per_SI * learned.values[i]);
    low.y.push_back(of_y.per_SI * (learned.values[i] - half));
    high.y.push_back(of_y.per_SI * (learned.values[i] + half));
  }
  const std::string follows = text::joined(learned.depends_on);
  report::Chart out{learned.acts_on + " over " + follows,
                    follows + ", " + std::string(of_x.unit),
                    learned.acts_on + ", " + std::string(of_y.unit),
                    {low, high, mean}};
  for (report::Series& each : points) {
    for (double& x : each.x) x *= of_x.per_SI;
    for (double& y : each.y) y *= of_y.per_SI;
    if (!each.x.empty()) out.series.push_back(std::move(each));
  }
  return out;
}

void add_learned(report::HtmlPage& page, const Diagnosis& d,
                 const std::vector<std::vector<report::Series>>& points) {
  if (d.learned.empty()) return;
  page.heading("What was learned without a name");
  Rows rows;
  std::vector<report::Chart> charts;
  for (const LearnedFinding& each : d.learned) {
    page.paragraph(sentence(each) + ".");
    if (!each.aliases.empty()) {
      page.paragraph("These data cannot tell it from " + text::joined(each.aliases) + ".");
    }
    const auto place = static_cast<std::size_t>(&each - d.learned.data());
    charts.push_back(
        picture_of(each, place < points.size() ? points[place] : std::vector<report::Series>()));
    if (!each.at_left_out_values) continue;
    rows.push_back({each.name, each.metric});
    add_gain(rows.back(), each.metric, *each.at_left_out_values);
  }
  page.charts(charts);
  if (rows.empty()) return;
  page.paragraph("Errors at values of the variable that were left out of the fit, all of them:");
  page.table({"learned", "signal", "before", "after", "difference (95 %)"}, rows);
}

// p-values; what chance does in one of a thousand campaigns counts as a failure.
void add_tests(report::HtmlPage& page, const Diagnosis& d) {
  constexpr double kShown = 1e-12;
  const BaselineTests all = baseline_tests(d.baseline);
  if (all.count == 0) return;
  std::vector<std::string> head{"its residual"};
  std::map<std::string, std::vector<std::string>> cells;
  int failed = 0;
  for (const auto& [name, signal] : d.baseline) {
    for (const auto& [test, p] : signal.tests) {
      std::vector<std::string>& row = cells[test];
      row.resize(head.size() - 1);
      const bool fails = all.fails(p);
      row.push_back((fails ? "fails, p " : "p ") + (p < kShown ? "< 1e-12" : readable(p, 2)));
      if (fails) ++failed;
    }
    head.push_back(name);
  }
  const std::string least = "p " + readable(all.least_p, 2) + ", the smallest of " +
                            std::to_string(all.count) + ", chance gives in " +
                            readable(100.0 * all.by_chance(all.least_p), 2) +
                            " % of healthy campaigns";
  page.paragraph(
      "The scatter between experiments of a healthy machine lies beyond the noise, too. Tests of "
      "these residuals, with that scatter, the noise's autocorrelation and what healthy machines "
      "depart from any equation counted: " +
      (failed == 0
           ? "none fails (" + least + ")"
           : std::to_string(failed) + " of " + std::to_string(all.count) +
                 " fail beyond what chance does among so many in 0.1 % of healthy campaigns") +
      ". The verdict does not rest on them. An empty cell: these data cannot show it there.");
  Rows rows;
  for (auto& [test, row] : cells) {
    const bool plain = test == "whiteness" || test.starts_with("order_spectrum");
    row.resize(head.size() - 1);
    row.insert(row.begin(), (plain ? "" : "follows ") + test);
    rows.push_back(std::move(row));
  }
  page.table(head, rows);
}

// The tests that the verdict rests on, those that fail first.
void add_left(report::HtmlPage& page, const Diagnosis& d) {
  if (d.left.empty()) return;
  page.heading("Tests of what is left");
  Rows fail, pass;
  for (const auto& [test, left] : d.left) {
    const bool fails = left.value > left.limit;
    (fails ? fail : pass)
        .push_back({std::string(words_of_test(test)), fails ? "fails" : "passes",
                    readable(left.value, 2), readable(left.limit, 2)});
  }
  page.paragraph((fail.empty() ? "None" : std::to_string(fail.size())) + " of " +
                 std::to_string(d.left.size()) +
                 " fail with what was found in the model. The verdict rests on these. What "
                 "experiments differ by is judged against " +
                 base_words(d) + ".");
  fail.insert(fail.end(), pass.begin(), pass.end());
  page.table({"looked for", "", "value", "limit"}, fail);
}

void add_errors(report::HtmlPage& page, const Diagnosis& d) {
  if (d.baseline.empty()) return;
  page.heading("The model as given against the data");
  Rows rows;
  for (const auto& [name, signal] : d.baseline) {
    rows.push_back({name, told(name, signal.rmse, 4), told(name, signal.noise_floor, 4),
                    rounded_text(100.0 * signal.unexplained_share) + " %"});
  }
  page.table({"signal", "error, rms", "noise", "beyond the noise"}, rows);
  add_tests(page, d);
  if (!d.held_out.empty()) {
    page.heading("Errors on experiments that were not used for the fit");
    if (std::all_of(d.held_out.begin(), d.held_out.end(),
                    [](const auto& each) { return each.second.before == each.second.after; })) {
      page.paragraph(d.findings.empty()
                         ? "Nothing was found that would change them."
                         : "These signals are averaged over revolutions: what was found changes "
                           "nothing here, it stands in the order spectra.");
    }
    rows.clear();
    for (const auto& [name, gain] : d.held_out) {
      rows.push_back({name});
      add_gain(rows.back(), name, gain);
    }
    if (d.mu_max) {
      rows.push_back({"mu_max, relative"});
      add_gain(rows.back(), "mu_max",
               {d.mu_max->before, d.mu_max->after, d.mu_max->low, d.mu_max->high});
    }
    page.table({"signal", "before", "after", "difference (95 %)"}, rows);
  }
  if (d.simulation.empty()) return;
  page.heading("The simulation run forward");
  page.paragraph(
      "Integrated over each experiment, driven by what drives the machine there, up to the peak of "
      "friction, where it ends and begins anew once the belt grips. Before and after: on "
      "experiments "
      "that were not used for the fit.");
  std::vector<std::string> head{"signal", "error as given, rms", "noise"};
  if (d.simulation.begin()->second.left_out) {
    head.insert(head.end(), {"before", "after", "difference (95 %)"});
  }
  rows.clear();
  for (const auto& [name, signal] : d.simulation) {
    rows.push_back({name, told(name, signal.rmse, 4), told(name, signal.noise_floor, 4)});
    if (signal.left_out) add_gain(rows.back(), name, *signal.left_out);
    rows.back().resize(head.size());
  }
  page.table(head, rows);
}

void add_tables(report::HtmlPage& page, const Diagnosis& d) {
  Rows rows;
  if (!d.reruns.empty()) {
    page.heading("By the estimator, told the model before and after");
    std::vector<std::string> head{"experiment", "from, s"};
    for (const RerunFigure& figure : kRerunFigures) head.emplace_back(figure.heading);
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
        const std::string unit(unit_of(each.effect, name));
        sizes += (sizes.empty() ? "" : ", ") + name + " " + readable(value, 4) +
                 (unit.empty() ? "" : " " + unit);
      }
      rows.push_back({each.effect, sizes, each.reason});
    }
    page.table({"effect", "smallest size that would be seen", "why"}, rows);
  }
}

}  // namespace

std::string html_text(const Diagnosis& d, const Plots& plots, const PageFacts& facts) {
  report::HtmlPage page("BeltGrip: diagnosis");
  page.paragraph(headline(d));
  page.paragraph("Verdict: " + verdict_line(d) + ".");
  page.paragraph(
      "Made on " + facts.date + " by " + facts.program + ", configuration " + facts.configuration +
      ", " + (facts.model.empty() ? "no model file: the usual machine" : "model " + facts.model) +
      ".");
  if (d.verdict == Verdict::kNothingWrong) {
    page.paragraph(
        "Nothing stands out from noise and from the scatter between experiments. What these "
        "experiments could not have shown is listed below.");
  }
  for (const Finding& finding : d.findings) page.paragraph(sentence(finding));
  if (d.next_experiment) page.paragraph("Next experiment: " + d.next_experiment->text + ".");
  page.paragraph("In a plot the mouse draws the part to be seen, a double click shows all of it.");
  add_findings(page, d, plots.findings);
  add_learned(page, d, plots.learned);
  add_left(page, d);
  add_errors(page, d);
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
