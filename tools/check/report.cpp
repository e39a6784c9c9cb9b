#include "tools/check/report.h"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "daemon/core/config/load/load_config.h"
#include "tools/check/text.h"
#include "tools/text/json_writer.h"

namespace beltgrip::check {

namespace {

using text::JsonWriter;
using text::kJsonNull;

constexpr std::size_t kColumns = 100;

// Broken at blanks; the first line after `head`, all others as far in.
std::string wrapped(const std::string& head, const std::string& text) {
  std::string out = head, line;
  const std::size_t indent = head.size(), width = kColumns - indent;
  std::size_t at = 0;
  bool first = true;
  const auto flush = [&] {
    if (!first) out += std::string(indent, ' ');
    out += line + "\n";
    first = false;
    line.clear();
  };
  while (at < text.size()) {
    const std::size_t end = std::min(text.find(' ', at), text.size());
    const std::string word = text.substr(at, end - at);
    if (!line.empty() && line.size() + 1 + word.size() > width) flush();
    line += (line.empty() ? "" : " ") + word;
    at = end + 1;
  }
  flush();
  return out;
}

const char* mark(Weight weight) {
  switch (weight) {
    case Weight::kWrong:
      return "  wrong:  ";
    case Weight::kDoubt:
      return "  may be: ";
    default:
      return "  note:   ";
  }
}

std::string padded(std::string text, std::size_t width) {
  if (text.size() < width) text.append(width - text.size(), ' ');
  return text;
}

// To the right of a column.
std::string cell(const std::string& text, std::size_t width) {
  return (text.size() < width ? std::string(width - text.size(), ' ') : " ") + text;
}

constexpr std::size_t kRoleColumn = 26;

std::string header() {
  return padded("role", kRoleColumn) + cell("rate/Hz", 9) + cell("gap/ms", 9) + cell("now", 10) +
         padded("", 6) + cell("least", 10) + cell("largest", 10) + cell("step", 9) +
         cell("noise", 9) + "\n";
}

std::string role_line(const RoleCourse& course) {
  const InUnit in(*course.binding);
  const std::string line =
      padded(std::string(daemon::role_name(course.binding->role)), kRoleColumn);
  if (course.frames == 0) return line + "  not seen";
  if (course.in_range == 0) {
    return line + "  " + grouped(static_cast<double>(course.frames)) + " frames, no value";
  }
  const double least = in.value(course.least), largest = in.value(course.largest);
  // What the arithmetic leaves of nothing is none.
  const bool flag = daemon::role_dimension(course.binding->role) == can::Dimension::kNone;
  const double nothing = std::max(
      1e-3 * course.step, 1e-9 * std::max(std::abs(course.least), std::abs(course.largest)));
  const double noise = course.noise() > nothing ? in.difference(course.noise()) : 0.0;
  return line + cell(format("%.1f", course.rate_Hz()), 9) +
         cell(grouped(1e3 * course.longest_gap_s), 9) + cell(number(in.value(course.value)), 10) +
         padded(" " + course.binding->unit, 6) + cell(number(std::min(least, largest)), 10) +
         cell(number(std::max(least, largest)), 10) +
         cell(course.step > 0.0 && !flag ? number(in.difference(course.step)) : "-", 9) +
         cell(noise > 0.0 && !flag ? format("%.2g", noise) : "-", 9);
}

std::string experiments_text(const Prospects& prospects, const daemon::Config& config) {
  if (!prospects.judged) {
    std::string text = std::to_string(prospects.experiments) +
                       (prospects.experiments == 1 ? " experiment ran" : " experiments ran");
    if (prospects.carried_most > 0.0) {
      text +=
          format("; the highest friction that was carried in them: %.3f", prospects.carried_most);
    }
    return text;
  }
  const bool coast = config.trigger == daemon::Trigger::kCoastDown;
  if (prospects.opportunities == 0) {
    return std::string("this drive never ") + (coast ? "coasted" : "drove steadily") +
           " as an experiment needs it";
  }
  std::string text = std::to_string(prospects.opportunities) +
                     (prospects.opportunities == 1 ? " time" : " times") + " this drive " +
                     (coast ? "coasted" : "drove steadily") + " as an experiment needs it, in " +
                     std::to_string(prospects.in_reach) + " of them it may run";
  return text;
}

}  // namespace

std::string text(const Checked& checked) {
  std::string out;
  const RoleWatch& watch = checked.watch;
  const bool seen = !checked.what.empty();
  if (seen) {
    const bool table = checked.config.table != nullptr;
    out += wrapped("", checked.what + ": " + grouped(static_cast<double>(watch.frames())) +
                           format(" %s in %.1f s, ", table ? "values" : "frames", watch.span_s()) +
                           std::to_string(watch.census().size()) +
                           (table ? " columns" : " identifiers"));
    out += "\n" + header();
  }
  std::vector<std::string> told;
  for (std::size_t i = 0; i < watch.roles().size(); ++i) {
    const RoleCourse& course = watch.roles()[i];
    if (seen) {
      out += role_line(course) + "\n";
    } else {
      out +=
          padded(std::string(daemon::role_name(course.binding->role)), 26) + " " +
          (course.binding->uds ? "diagnostics of " + id_text(course.binding->uds->response)
                               : course.binding->message_name + "." + course.binding->signal_name +
                                     ", " + id_text(course.binding->id)) +
          (course.binding->unit.empty() ? "" : ", " + course.binding->unit) + "\n";
    }
    for (const Finding& finding : checked.verdict.roles[i]) {
      // What is said of a message stands at its first role.
      if (std::find(told.begin(), told.end(), finding.text) != told.end()) continue;
      told.push_back(finding.text);
      out += wrapped(mark(finding.weight), finding.text);
    }
  }
  if (!checked.verdict.across.empty()) {
    out += "\nRoles against each other\n";
    for (const Finding& finding : checked.verdict.across) {
      out += wrapped(mark(finding.weight), finding.text);
    }
  }
  if (seen) {
    out += "\nExperiments\n";
    out += wrapped("  ", experiments_text(checked.prospects, checked.config));
    for (std::size_t i = 0; i < checked.prospects.forbidden_by.size(); ++i) {
      const std::uint64_t times = checked.prospects.forbidden_by[i];
      if (times == 0) continue;
      out += wrapped(
          format("  kept away %llu time%s: ", static_cast<unsigned long long>(times),
                 times == 1 ? "" : "s"),
          daemon::reason_text(reason_of(static_cast<daemon::Inhibit>(i), checked.prospects)));
    }
    const std::string reach = reach_text(checked.prospects, checked.config);
    if (!reach.empty()) out += wrapped("  ", reach);
  }
  if (!checked.config.assumed.empty()) {
    out += "\n" + wrapped("", daemon::assumed_text(checked.config));
  }
  if (!checked.verdict.missing.empty()) {
    out += "\nMissing\n";
    for (const std::string& each : checked.verdict.missing) out += wrapped("  - ", each);
  }
  return out + "\n" + wrapped("", checked.verdict.sentence);
}

std::string json(const Checked& checked) {
  JsonWriter json;
  constexpr std::string_view kReady[] = {"none", "observe", "command"};
  const auto texts = [&json](const std::vector<std::string>& all) {
    json.begin_array();
    for (const std::string& each : all) json.value(each);
    json.end_array();
  };
  const auto findings = [&json](const Findings& all) {
    constexpr std::string_view kWeight[] = {"note: ", "may be: ", "wrong: "};
    json.begin_array();
    for (const Finding& each : all) {
      json.value(std::string(kWeight[static_cast<int>(each.weight)]) + each.text);
    }
    json.end_array();
  };
  json.begin_object().field("ready", kReady[static_cast<int>(checked.verdict.ready)]);
  json.key("missing");
  texts(checked.verdict.missing);
  json.key("assumed");
  texts(checked.config.assumed);
  json.key("roles").begin_object();
  for (std::size_t i = 0; i < checked.watch.roles().size(); ++i) {
    const RoleCourse& course = checked.watch.roles()[i];
    const daemon::RoleBinding& binding = *course.binding;
    const InUnit in(binding);
    const bool known = course.in_range > 0;
    const auto value = [&](double si) { return known ? in.value(si) : kJsonNull; };
    json.key(daemon::role_name(binding.role)).begin_object();
    json.field("message", binding.uds ? id_text(binding.uds->response) : binding.message_name);
    json.field("signal", binding.uds ? format("0x%04X", unsigned{binding.uds->identifier})
                                     : binding.signal_name);
    json.field("seen", course.frames > 0).field("frames", course.frames);
    json.field("crc_bad", course.crc_bad).field("rate_Hz", course.rate_Hz());
    json.field("longest_gap_s", course.longest_gap_s);
    json.field("in_range_share", course.values > 0 ? static_cast<double>(course.in_range) /
                                                         static_cast<double>(course.values)
                                                   : kJsonNull);
    const double least = value(course.least), largest = value(course.largest);
    json.field("value", value(course.value));
    json.field("least", std::min(least, largest)).field("largest", std::max(least, largest));
    json.field("noise", known ? in.difference(course.noise()) : kJsonNull);
    json.field("step", known ? in.difference(course.step) : kJsonNull);
    json.field("stuck_s", course.stuck_s).field("unit", binding.unit);
    if (binding.uds) {
      const double every_s = quantile(course.asked_every_s.values(), 0.5);
      const double answer_s = quantile(course.answers_s.values(), 0.5);
      json.field("requests", course.requests);
      json.field("request_Hz", every_s > 0.0 ? 1.0 / every_s : kJsonNull);
      json.field("answer_s", std::isfinite(answer_s) ? answer_s : kJsonNull);
    }
    json.key("findings");
    findings(checked.verdict.roles[i]);
    json.end_object();
  }
  json.end_object().key("across");
  findings(checked.verdict.across);
  const Prospects& prospects = checked.prospects;
  json.key("experiments").begin_object();
  json.field("opportunities", prospects.judged ? prospects.opportunities : prospects.experiments);
  json.field("in_reach", prospects.in_reach).key("forbidden_by").begin_object();
  for (std::size_t i = 0; i < prospects.forbidden_by.size(); ++i) {
    if (prospects.forbidden_by[i] > 0) {
      json.field(daemon::kInhibits[i].name, prospects.forbidden_by[i]);
    }
  }
  json.end_object();
  if (prospects.best) {
    json.field("floor_N", prospects.best->floor_N).field("needed_Nm", prospects.best->needed_Nm);
    json.field("torque_Nm", prospects.best->torque_Nm);
  }
  json.end_object().field("sentence", checked.verdict.sentence).end_object();
  return json.take() + "\n";
}

}  // namespace beltgrip::check
