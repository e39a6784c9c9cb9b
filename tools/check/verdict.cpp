#include "tools/check/verdict.h"

#include <algorithm>
#include <array>
#include <bit>

#include "tools/check/judge_across.h"
#include "tools/check/text.h"

namespace beltgrip::check {

namespace {

// What a request for force needs beyond what observing does (daemon/core/config demands them where
// experiment.control is "command").
constexpr std::array kForCommand{Role::kExperimentPermitted, Role::kAcceleratorPedal,
                                 Role::kBrakePressed,        Role::kLockupClosed,
                                 Role::kOilTemperature,      Role::kVehicleSpeed};

std::string first_wrong(const Findings& findings) {
  for (const Finding& each : findings) {
    if (each.weight == Weight::kWrong) return each.text;
  }
  return {};
}

bool is_bound(Role role, const daemon::Config& config) {
  return std::any_of(config.roles.begin(), config.roles.end(),
                     [role](const daemon::RoleBinding& each) { return each.role == role; });
}

void missing_for_command(const daemon::Config& config, std::vector<std::string>& missing) {
  std::string roles;
  for (const Role role : kForCommand) {
    if (!is_bound(role, config))
      roles += (roles.empty() ? "" : ", ") + std::string(daemon::role_name(role));
  }
  if (!roles.empty()) missing.push_back("to command: signals for " + roles);
  if (config.variator.primary_inertia_kg_m2 <= 0.0) {
    missing.push_back("to command: variator.primary_inertia_kg_m2");
  }
  if (config.control != daemon::Control::kCommand && !config.table) {
    missing.push_back("to command: experiment.control = \"command\"");
  }
}

}  // namespace

daemon::Reason reason_of(daemon::Inhibit inhibit, const Prospects& prospects) {
  return daemon::reason_of(inhibit, prospects.figures[static_cast<std::size_t>(inhibit)]);
}

namespace {

// Without the remedy: a sentence goes on behind it.
std::string cause_of(daemon::Inhibit inhibit, const Prospects& prospects) {
  daemon::Reason reason = reason_of(inhibit, prospects);
  reason.remedy.clear();
  return daemon::reason_text(reason);
}

}  // namespace

std::string reach_text(const Prospects& prospects, const daemon::Config& config) {
  if (!prospects.judged || !prospects.best) return {};
  const Opportunity& best = *prospects.best;
  const bool coast = config.trigger == daemon::Trigger::kCoastDown;
  return "force floor " + grouped(best.floor_N) + " N: the peak (friction " +
         format("%.3g", config.experiment.friction_expected) + ") is reached from " +
         grouped(best.needed_Nm) + " Nm on; this drive " + (coast ? "coasts" : "drives") +
         " with " + grouped(best.torque_Nm) + " Nm";
}

namespace {

// What the car is not ready for.
struct Lacks {
  bool observing = false;
  bool commanding = false;
  void both() { observing = commanding = true; }
};

Finding pauses_of(const RoleWatch& watch) {
  return {Weight::kNote,
          format("no frame at all came %llu time%s, for %s s at the longest: the car slept, or the "
                 "recorder was stopped",
                 static_cast<unsigned long long>(watch.pauses()), watch.pauses() == 1 ? "" : "s",
                 grouped(watch.longest_pause_s()).c_str())};
}

// Of a log the configuration demands them; a table has the columns that it has.
void missing_columns(const daemon::Config& config, std::vector<std::string>& missing,
                     Lacks& lacks) {
  for (std::size_t i = 0; i < daemon::kRoleCount; ++i) {
    const auto role = static_cast<Role>(i);
    if (is_bound(role, config) || !is_required(role, config)) continue;
    lacks.both();
    missing.push_back(std::string(daemon::role_name(role)) + ": no column of it");
  }
}

// Of a log without one frame there is no verdict.
std::string no_message(const RoleWatch& watch) {
  if (watch.frames() == 0) {
    return "no frame came: is the ignition on, the interface up, the bit rate right?";
  }
  return "no message of any role is in " + grouped(static_cast<double>(watch.frames())) +
         " frames: the log of another car, or another bus?";
}

void missing_by_findings(const daemon::Config& config, Verdict& verdict, Lacks& lacks) {
  for (std::size_t i = 0; i < verdict.roles.size(); ++i) {
    const std::string text = first_wrong(verdict.roles[i]);
    if (text.empty()) continue;
    const Role role = config.roles[i].role;
    verdict.missing.push_back(std::string(daemon::role_name(role)) + ": " + text);
    lacks.commanding = true;
    if (is_required(role, config)) lacks.observing = true;
  }
  for (const Finding& each : verdict.across) {
    if (each.weight != Weight::kWrong) continue;
    verdict.missing.push_back(each.text);
    lacks.both();
  }
}

bool never_in_reach(const Prospects& prospects) {
  return prospects.judged && prospects.opportunities > 0 && prospects.in_reach == 0;
}

// Why no experiment may run though the peak is in reach; else `reach`.
std::string forbidden_text(const Prospects& prospects, const std::string& reach) {
  if (!prospects.best || prospects.best->forbidden == 0) return reach;
  const auto limit = static_cast<daemon::Inhibit>(std::countr_zero(prospects.best->forbidden));
  if (limit == daemon::Inhibit::kUnreachable) return reach;
  return "with " + grouped(prospects.best->torque_Nm) +
         " Nm the peak is in reach, but kept away by " + cause_of(limit, prospects);
}

// What kept experiments away most often, of a drive that had no opportunity for one.
std::string most_forbidding(const Prospects& prospects) {
  const std::uint64_t most =
      *std::max_element(prospects.forbidden_by.begin(), prospects.forbidden_by.end());
  std::string why;
  for (std::size_t i = 0; most > 0 && i < prospects.forbidden_by.size(); ++i) {
    if (prospects.forbidden_by[i] < most) continue;
    why += (why.empty() ? "; kept away by " : ", and by ") +
           cause_of(static_cast<daemon::Inhibit>(i), prospects);
  }
  return why;
}

// `wrong`: how many of what is missing keep from observing as well.
std::string sentence_of(const Verdict& verdict, std::size_t wrong, const Prospects& prospects,
                        const daemon::Config& config, bool seen) {
  const std::string reach = seen ? reach_text(prospects, config) : std::string();
  const std::string only_configuration = seen ? "" : " by the configuration alone";
  std::string out;
  switch (verdict.ready) {
    case Ready::kNone:
      out = "Not ready: " + verdict.missing.front();
      if (wrong > 1) out += "; and " + std::to_string(wrong - 1) + " more, see above";
      break;
    case Ready::kObserve:
      out = "Ready to observe" + only_configuration;
      if (seen && never_in_reach(prospects)) {
        out += ", not to command: " + forbidden_text(prospects, reach);
        break;
      }
      if (!reach.empty()) out += "; " + reach;
      for (const std::string& each : verdict.missing) {
        constexpr std::string_view kCommand = "to command: ";
        if (!each.starts_with(kCommand)) continue;
        out += ". To command, this is missing: " + each.substr(kCommand.size());
        break;
      }
      break;
    case Ready::kCommand:
      out = "Ready to command" + only_configuration;
      if (!reach.empty()) {
        out += "; " + reach;
      } else if (seen && prospects.judged) {
        out += "; this drive had no opportunity for an experiment" + most_forbidding(prospects);
      }
      break;
  }
  if (!out.ends_with('?')) out += '.';
  return out;
}

}  // namespace

Verdict judge(const RoleWatch& watch, const std::vector<Window>& windows,
              const Prospects& prospects, const daemon::Config& config, const DbcUnits& units,
              bool seen) {
  Verdict verdict;
  Lacks lacks;
  bool none_seen = seen && !config.roles.empty();
  for (const RoleCourse& course : watch.roles()) {
    verdict.roles.push_back(judge_role(course, watch, config, units));
    if (course.frames > 0) none_seen = false;
  }
  verdict.across = judge_across(windows, config);
  if (watch.pauses() > 0) verdict.across.push_back(pauses_of(watch));
  missing_columns(config, verdict.missing, lacks);
  if (none_seen) {
    lacks.both();
    verdict.missing.push_back(no_message(watch));
  } else {
    missing_by_findings(config, verdict, lacks);
  }
  const std::size_t wrong = verdict.missing.size();
  missing_for_command(config, verdict.missing);
  if (seen && !none_seen && never_in_reach(prospects)) {
    verdict.missing.push_back("to command: a drive in which an experiment may run; in none of " +
                              std::to_string(prospects.opportunities) + " it may");
  }
  lacks.commanding |= verdict.missing.size() > wrong;
  if (!seen) verdict.missing.push_back("a log or a bus: nothing of the car has been seen");
  verdict.ready = lacks.observing    ? Ready::kNone
                  : lacks.commanding ? Ready::kObserve
                                     : Ready::kCommand;
  verdict.sentence = sentence_of(verdict, wrong, prospects, config, seen);
  return verdict;
}

void summarize_doubts(Verdict& verdict) {
  std::size_t doubts = 0;
  const auto add = [&doubts](const Findings& findings) {
    doubts += static_cast<std::size_t>(
        std::count_if(findings.begin(), findings.end(),
                      [](const Finding& each) { return each.weight == Weight::kDoubt; }));
  };
  for (const Findings& each : verdict.roles) add(each);
  add(verdict.across);
  if (doubts == 0 || verdict.ready == Ready::kNone) return;
  const std::string look =
      doubts == 1 ? "first look at the \"may be\" above."
                  : "first look at the " + std::to_string(doubts) + " \"may be\" above.";
  // A clamp is not lowered by signals that may be others.
  constexpr std::string_view kReady = "Ready to command";
  if (verdict.ready == Ready::kCommand && verdict.sentence.starts_with(kReady)) {
    verdict.ready = Ready::kObserve;
    verdict.sentence.replace(0, kReady.size(), "Ready to observe");
    verdict.missing.push_back("to command: " + look);
    verdict.sentence += " To command, " + look;
    return;
  }
  verdict.sentence += " But " + look;
}

}  // namespace beltgrip::check
