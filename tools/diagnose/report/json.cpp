#include "tools/diagnose/report/json.h"

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <vector>

#include "can_dbc/text/number_text.h"
#include "tools/diagnose/report/finding_words.h"
#include "tools/text/joined.h"
#include "tools/text/json_writer.h"

namespace beltgrip::diagnose {
namespace {

const char* verdict_text(Verdict verdict) {
  switch (verdict) {
    case Verdict::kNone:
      return nullptr;
    case Verdict::kNothingWrong:
      return "nothing_wrong";
    case Verdict::kExplained:
      return "explained";
    case Verdict::kUnexplained:
      return "unexplained";
  }
  return nullptr;
}

void interval(text::JsonWriter& json, double low, double high) {
  json.key("ci95").begin_array().value(low).value(high).end_array();
}

const char* kind_text(MisfitKind kind) {
  switch (kind) {
    case MisfitKind::kFunction:
      return "function";
    case MisfitKind::kLine:
      return "line";
    case MisfitKind::kBetweenRuns:
      return "between_runs";
    case MisfitKind::kSlow:
      return "slow";
  }
  return "function";
}

void write_unexplained(text::JsonWriter& json, const std::optional<Unexplained>& left) {
  json.key("unexplained");
  if (!left) {
    json.null();
    return;
  }
  json.begin_object().field("acts_on", left->acts_on);
  json.key("depends_on").begin_array();
  for (const std::string& role : left->depends_on) json.value(role);
  json.end_array().field("share", left->share).field("kind", kind_text(left->kind));
  json.key("frequency_Hz");
  left->frequency_Hz ? json.value(*left->frequency_Hz) : json.null();
  json.end_object();
}

void write_next(text::JsonWriter& json, const std::optional<Recipe>& next) {
  json.key("next_experiment");
  if (!next) {
    json.null();
    return;
  }
  json.begin_object().field("text", next->text).field("scenario", next->scenario).end_object();
}

void write_words(text::JsonWriter& json, const char* key, const std::vector<std::string>& words) {
  json.key(key).begin_array();
  for (const std::string& each : words) json.value(each);
  json.end_array();
}

void write_change(text::JsonWriter& json, const BeforeAfter& change) {
  json.field("before", change.before).field("after", change.after);
  interval(json, change.low, change.high);
}

void write_learned(text::JsonWriter& json, const LearnedFinding& learned) {
  json.begin_object().field("name", learned.name).field("acts_on", learned.acts_on);
  write_words(json, "depends_on", learned.depends_on);
  json.key("law");
  learned.law.empty() ? json.null() : json.value(learned.law);
  write_words(json, "laws", learned.laws);
  write_words(json, "aliases", learned.aliases);
  json.field("levels", learned.levels);
  json.key("gain").begin_object();
  for (const auto& [metric, change] : learned.gain) {
    write_change(json.key(metric).begin_object(), change);
    json.end_object();
  }
  json.end_object().key("gain_at_left_out_values");
  if (learned.at_left_out_values) {
    write_change(json.begin_object().field("metric", learned.metric), *learned.at_left_out_values);
    json.end_object();
  } else {
    json.null();
  }
  json.key("box").begin_object();
  for (const auto& [role, range] : learned.box) {
    json.key(role).begin_array().value(range[0]).value(range[1]).end_array();
  }
  json.end_object().key("function").begin_array();
  for (std::size_t i = 0; i < learned.knots.size(); ++i) {
    json.begin_array().value(learned.knots[i]).value(learned.values[i]).end_array();
  }
  json.end_array().end_object();
}

void write_baseline(text::JsonWriter& json, const Diagnosis& d) {
  json.key("baseline").begin_object();
  for (const auto& [name, signal] : d.baseline) {
    json.key(name).begin_object();
    json.field("rmse", signal.rmse).field("noise_floor", signal.noise_floor);
    json.field("unexplained_share", signal.unexplained_share);
    json.key("tests").begin_object();
    for (const auto& [test, p] : signal.tests) json.field(test, p);
    json.end_object().end_object();
  }
  json.end_object();
  json.key("remaining").begin_object();
  for (const auto& [name, test] : d.left) {
    json.key(name).begin_object().field("value", test.value).field("limit", test.limit);
    json.end_object();
  }
  json.end_object();
}

void write_simulation(text::JsonWriter& json, const Diagnosis& d) {
  json.key("simulation").begin_object();
  for (const auto& [name, signal] : d.simulation) {
    json.key(name).begin_object();
    json.field("rmse", signal.rmse).field("noise_floor", signal.noise_floor);
    json.key("held_out");
    if (signal.left_out) {
      json.begin_object();
      json.field("rmse_before", signal.left_out->before);
      json.field("rmse_after", signal.left_out->after);
      interval(json, signal.left_out->low, signal.left_out->high);
      json.end_object();
    } else {
      json.null();
    }
    json.end_object();
  }
  json.end_object();
}

void write_finding(text::JsonWriter& json, const Finding& finding) {
  json.begin_object();
  json.field("effect", finding.effect);
  json.key("parameters").begin_object();
  for (const auto& [name, value] : finding.parameters) {
    json.key(name).begin_object().field("value", value.value);
    interval(json, value.low, value.high);
    json.end_object();
  }
  for (const auto& [name, value] : finding.fixed) {
    json.key(name).begin_object().field("value", value);
    interval(json, value, value);
    json.end_object();
  }
  json.end_object();
  if (!finding.role.empty()) json.field("role", finding.role);
  json.field("probability", finding.probability);
  if (finding.stability) json.field("stability", *finding.stability);
  write_words(json, "aliases", finding.aliases);
  json.key("separate_by");
  finding.separate_by.empty() ? json.null() : json.value(finding.separate_by);
  json.key("gain").begin_object();
  for (const auto& [name, gain] : finding.gain) {
    write_change(json.key(name).begin_object(), gain);
    json.end_object();
  }
  json.end_object().end_object();
}

void write_not_identifiable(text::JsonWriter& json, const std::vector<NotIdentifiable>& effects) {
  json.key("not_identifiable").begin_array();
  for (const NotIdentifiable& each : effects) {
    json.begin_object().field("effect", each.effect);
    json.key("smallest_detectable").begin_object();
    for (const auto& [name, value] : each.smallest_detectable) json.field(name, value);
    json.end_object().field("reason", each.reason).end_object();
  }
  json.end_array();
}

void write_held_out(text::JsonWriter& json, const Diagnosis& d) {
  json.key("held_out").begin_object();
  for (const auto& [name, gain] : d.held_out) {
    json.key(name).begin_object();
    json.field("rmse_before", gain.before).field("rmse_after", gain.after);
    interval(json, gain.low, gain.high);
    json.end_object();
  }
  if (d.mu_max) {
    json.key("mu_max").begin_object();
    json.field("error_before", d.mu_max->before).field("error_after", d.mu_max->after);
    interval(json, d.mu_max->low, d.mu_max->high);
    json.end_object();
  }
  json.end_object();
}

void write_reruns(text::JsonWriter& json, const std::vector<Rerun>& reruns) {
  json.key("reruns").begin_array();
  for (const Rerun& each : reruns) {
    json.begin_object().field("log", each.log).field("start_s", each.start_s);
    for (const RerunFigure& figure : kRerunFigures) {
      json.key(figure.key).begin_object();
      for (const auto& [when, side] : {std::pair{"before", &each.before}, {"after", &each.after}}) {
        json.key(when);
        *side ? json.value((**side).*figure.value) : json.null();
      }
      json.end_object();
    }
    json.end_object();
  }
  json.end_array();
}

void write_machine(text::JsonWriter& json, const Diagnosis& d) {
  json.key("machine").begin_object();
  for (const auto& [name, value] : d.machine) {
    json.key(name).begin_object().field("value", value.value);
    interval(json, value.low, value.high);
    json.end_object();
  }
  json.end_object();
}

}  // namespace

std::string sentence(const Unexplained& left) {
  constexpr double kToldShare = 5e-4;  // less reads as none
  const std::string share = rounded_text(100.0 * left.share) + " % of the misfit";
  switch (left.kind) {
    case MisfitKind::kFunction:
      return "something that has no name here acts on " + left.acts_on + " and follows " +
             text::joined(left.depends_on) + (left.share < kToldShare ? "" : " (" + share + ")");
    case MisfitKind::kLine:
      if (left.is_belt) {
        return "a line at the belt's passage (" + rounded_text(left.frequency_Hz.value_or(0.0)) +
               " Hz in the mean, with the speed): a place of the belt that runs otherwise";
      }
      return "a line at " + rounded_text(left.frequency_Hz.value_or(0.0)) + " Hz in " +
             left.acts_on +
             (left.depends_on.empty() ? "" : ", stronger with " + text::joined(left.depends_on));
    case MisfitKind::kBetweenRuns:
      return left.acts_on +
             " differs between experiments by more than it should and follows nothing recorded";
    case MisfitKind::kSlow:
      return left.acts_on +
             " departs within experiments for longer than noise does and follows nothing recorded";
  }
  return {};
}

std::string sentence(const LearnedFinding& learned) {
  const auto [least, most] = std::minmax_element(learned.values.begin(), learned.values.end());
  std::string out = "a cause without a name on " + learned.acts_on + " that follows " +
                    text::joined(learned.depends_on) + " (" + told(learned.acts_on, *least) +
                    " to " + told(learned.acts_on, *most) + ", learned at " +
                    std::to_string(learned.levels) + " levels";
  for (const auto& [role, range] : learned.box) {
    out += " from " + told(role, range[0], 3) + " to " + told(role, range[1], 3);
  }
  out += ")";
  if (!learned.law.empty()) out += ", " + learned.law;
  return out;
}

std::string base_words(const Diagnosis& d) {
  return d.scatter_from_replicates ? "what replicates differ by"
                                   : "what is usual, as none was repeated often enough";
}

std::string figure_text(const Rerun& rerun, const RerunFigure& figure) {
  const auto text = [&](const std::optional<Measured>& side) {
    return side ? rounded_text((*side).*figure.value) : std::string("none");
  };
  return text(rerun.before) + " -> " + text(rerun.after);
}

std::string json_text(const Diagnosis& d) {
  text::JsonWriter json;
  json.begin_object();
  const char* verdict = verdict_text(d.verdict);
  json.key("verdict");
  verdict == nullptr ? json.null() : json.value(verdict);
  json.field("headline", headline(d));
  json.field("complete", d.complete);
  json.field("experiments", d.experiments);
  json.field("usable_s", 0.1 * d.samples);
  write_baseline(json, d);
  write_simulation(json, d);
  json.key("findings").begin_array();
  for (const Finding& finding : d.findings) write_finding(json, finding);
  json.end_array();
  write_unexplained(json, d.unexplained);
  json.field("scatter_base", d.scatter_from_replicates ? "replicates" : "prior");
  json.key("learned").begin_array();
  for (const LearnedFinding& each : d.learned) write_learned(json, each);
  json.end_array();
  write_not_identifiable(json, d.not_identifiable);
  write_held_out(json, d);
  write_reruns(json, d.reruns);
  write_next(json, d.next_experiment);
  write_machine(json, d);
  write_words(json, "notes", d.notes);
  json.end_object();
  return json.take() + "\n";
}

std::string verdict_line(const Diagnosis& d) {
  std::string what;
  switch (d.verdict) {
    case Verdict::kNone:
      what = d.complete ? "nothing can be said" : "nothing found so far";
      break;
    case Verdict::kNothingWrong:
      what = "nothing wrong";
      break;
    case Verdict::kExplained:
      what = "explained";
      break;
    case Verdict::kUnexplained:
      what = "unexplained";
  }
  return what + " (" + std::to_string(d.experiments) +
         (d.experiments == 1 ? " experiment, " : " experiments, ") + rounded_text(0.1 * d.samples) +
         " s usable)" + (d.complete ? "" : ", stopped before the end");
}

namespace {

// Of what was wrong; whole percents.
std::string share_text(const Diagnosis& d) {
  if (!d.explained_share) return {};
  const long percent = std::lround(100.0 * *d.explained_share);
  return percent > 99 ? " more than 99 % of" : " " + std::to_string(percent) + " % of";
}

// By how much the error of mu_max falls, or of the signal that gains most.
std::string gain_text(const Diagnosis& d) {
  const auto is_told = [](double before, double after) {  // by the digits that are shown
    return rounded_text(after) != rounded_text(before) && after < before;
  };
  if (d.mu_max && is_told(d.mu_max->before, d.mu_max->after)) {
    return "; with it mu_max is off by " + told("mu_max", d.mu_max->after) + " instead of " +
           told("mu_max", d.mu_max->before);
  }
  const auto best =
      std::min_element(d.held_out.begin(), d.held_out.end(), [](const auto& a, const auto& b) {
        return a.second.after * b.second.before < b.second.after * a.second.before;
      });
  if (best == d.held_out.end() || !is_told(best->second.before, best->second.after)) return {};
  return "; with it " + best->first + " is off by " + told(best->first, best->second.after) +
         " instead of " + told(best->first, best->second.before);
}

// What may stand in the place of a finding. Chosen: the first three, so that the sentence is read
// to its end; all stand beside the finding below it. Another number changes the sentence alone.
std::string class_text(const Finding& finding) {
  constexpr std::size_t kMost = 3;
  std::string out;
  for (std::size_t i = 0; i < std::min(finding.aliases.size(), kMost); ++i) {
    out += (i == 0 ? ", or " : " or ") + finding.aliases[i];
  }
  if (out.empty()) return out;
  return out + (finding.aliases.size() > kMost ? " or others" : "") + " in its place,";
}

}  // namespace

std::string headline(const Diagnosis& d) {
  std::string found;
  const auto begun = [](std::string text) {
    if (!text.empty())
      text[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(text[0])));
    return text;
  };
  for (const Finding& finding : d.findings) {
    found += (found.empty() ? "" : " and ") + in_words(finding) + class_text(finding);
  }
  for (const LearnedFinding& each : d.learned) {
    found += (found.empty() ? "" : " and ") + sentence(each);
  }
  if (d.verdict == Verdict::kUnexplained && d.unexplained) {
    return (found.empty() ? "Unexplained: " : "Beside " + found + " is left: ") +
           sentence(*d.unexplained) + ".";
  }
  if (d.verdict == Verdict::kExplained) {
    return begun(found) + (d.findings.size() + d.learned.size() > 1 ? " explain" : " explains") +
           share_text(d) + " what was wrong" + gain_text(d) + ".";
  }
  if (d.verdict == Verdict::kNothingWrong) {
    return "Nothing stands out from noise and scatter in " + std::to_string(d.experiments) +
           (d.experiments == 1 ? " experiment." : " experiments.");
  }
  return "Stopped before the end: what is not named here may be there.";
}

std::string plain_text(const Diagnosis& d) {
  std::string out = "verdict: " + verdict_line(d) + "\n" + headline(d) + "\n";
  for (const auto& [name, signal] : d.baseline) {
    out += "  " + name + ": the simulation is off by " + told(name, signal.rmse, 4) +
           " rms, noise " + told(name, signal.noise_floor, 4) + "\n";
  }
  for (const Finding& finding : d.findings) {
    out += finding.effect + (finding.role.empty() ? "" : " (" + finding.role + ")") + ": " +
           finding.equation + "\n";
    for (const auto& [name, value] : finding.parameters) {
      const std::string unit(unit_of(finding.effect, name));
      out += "  " + name + " = " + rounded_text(value.value) + " [" + rounded_text(value.low) +
             ", " + rounded_text(value.high) + "]" + (unit.empty() ? "" : " " + unit) + "\n";
    }
    if (!finding.from_file.empty()) out += "  from " + finding.from_file + " on\n";
    out += "  probability " + rounded_text(finding.probability) + "\n";
    if (finding.stability) {
      out += "  there in " + rounded_text(100.0 * *finding.stability) +
             " % of the fits without one experiment\n";
    }
    if (!finding.aliases.empty()) {
      out += "  these data cannot tell it from:";
      for (const std::string& alias : finding.aliases) out += " " + alias;
      out += "\n  what would: " + finding.separate_by + "\n";
    }
  }
  for (const LearnedFinding& each : d.learned) {
    out += "learned: " + sentence(each) + "\n";
    if (!each.aliases.empty())
      out += "  these data cannot tell it from: " + text::joined(each.aliases) + "\n";
    if (const auto& change = each.at_left_out_values) {
      out += "  " + each.metric + " at values of " + text::joined(each.depends_on) +
             " that were left out: off by " +
             told_change(each.metric, change->before, change->after, change->low, change->high) +
             "\n";
    }
  }
  if (d.unexplained) out += "unexplained: " + sentence(*d.unexplained) + "\n";
  if (!d.left.empty())
    out += "what experiments differ by is judged against " + base_words(d) + "\n";
  if (!d.held_out.empty()) {
    out += "on experiments not used for the fit (before -> after, 95 % of the difference):\n";
  }
  for (const auto& [name, gain] : d.held_out) {
    out +=
        "  " + name + ": " + told_change(name, gain.before, gain.after, gain.low, gain.high) + "\n";
  }
  for (const auto& [name, signal] : d.simulation) {
    if (!signal.left_out) continue;
    const BeforeAfter& gain = *signal.left_out;
    out += "  " + name + ", simulated forward: " +
           told_change(name, gain.before, gain.after, gain.low, gain.high) + "\n";
  }
  if (d.mu_max) {
    out += "  mu_max, relative error: " +
           told_change("mu_max", d.mu_max->before, d.mu_max->after, d.mu_max->low, d.mu_max->high) +
           "\n";
  }
  if (!d.reruns.empty()) {
    out += "by the estimator, told the model before -> after (";
    for (const RerunFigure& figure : kRerunFigures) {
      out += (&figure == kRerunFigures.data() ? "" : "; ") + std::string(figure.heading);
    }
    out += "):\n";
  }
  for (const Rerun& each : d.reruns) {
    char from[32];
    std::snprintf(from, sizeof from, ", from %.2f s:", each.start_s);
    out += "  " + each.log + from;
    for (const RerunFigure& figure : kRerunFigures) {
      out += (&figure == kRerunFigures.data() ? " " : "; ") + figure_text(each, figure);
    }
    out += "\n";
  }
  if (!d.not_identifiable.empty()) {
    out += "not to be seen in these data:";
    for (const NotIdentifiable& each : d.not_identifiable) out += " " + each.effect;
    out += "\n";
  }
  if (d.next_experiment) out += "next experiment: " + d.next_experiment->text + "\n";
  for (const std::string& note : d.notes) out += "note: " + note + "\n";
  return out;
}

}  // namespace beltgrip::diagnose
