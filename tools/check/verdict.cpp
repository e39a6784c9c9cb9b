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

void missing_for_command(const daemon::Config& config, std::vector<std::string>& missing) {
  std::string roles;
  for (const Role role : kForCommand) {
    const bool bound =
        std::any_of(config.roles.begin(), config.roles.end(),
                    [role](const daemon::RoleBinding& each) { return each.role == role; });
    if (!bound) roles += (roles.empty() ? "" : ", ") + std::string(daemon::role_name(role));
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

Verdict judge(const RoleWatch& watch, const std::vector<Window>& windows,
              const Prospects& prospects, const daemon::Config& config, const DbcUnits& units,
              bool seen) {
  Verdict verdict;
  bool observes = true, commands = true;
  bool none_seen = seen && !config.roles.empty();
  for (const RoleCourse& course : watch.roles()) {
    verdict.roles.push_back(judge_role(course, watch, config, units));
    if (course.frames > 0) none_seen = false;
  }
  verdict.across = judge_across(windows, config);
  if (watch.pauses() > 0) {
    verdict.across.push_back(
        {Weight::kNote,
         format("no frame at all came %llu time%s, for %s s at the longest: the car slept, or the "
                "recorder was stopped",
                static_cast<unsigned long long>(watch.pauses()), watch.pauses() == 1 ? "" : "s",
                grouped(watch.longest_pause_s()).c_str())});
  }
  // Of a log the configuration demands them; a table has the columns that it has.
  for (std::size_t i = 0; i < daemon::kRoleCount; ++i) {
    const auto role = static_cast<Role>(i);
    const bool bound =
        std::any_of(config.roles.begin(), config.roles.end(),
                    [role](const daemon::RoleBinding& each) { return each.role == role; });
    if (bound || !is_required(role, config)) continue;
    observes = commands = false;
    verdict.missing.push_back(std::string(daemon::role_name(role)) + ": no column of it");
  }
  if (none_seen) {
    observes = commands = false;
    // Of a log without one frame there is no verdict.
    verdict.missing.push_back(
        watch.frames() == 0
            ? "no frame came: is the ignition on, the interface up, the bit rate right?"
            : "no message of any role is in " + grouped(static_cast<double>(watch.frames())) +
                  " frames: the log of another car, or another bus?");
  } else {
    for (std::size_t i = 0; i < verdict.roles.size(); ++i) {
      const std::string text = first_wrong(verdict.roles[i]);
      if (text.empty()) continue;
      const Role role = config.roles[i].role;
      verdict.missing.push_back(std::string(daemon::role_name(role)) + ": " + text);
      commands = false;
      if (is_required(role, config)) observes = false;
    }
    for (const Finding& each : verdict.across) {
      if (each.weight != Weight::kWrong) continue;
      verdict.missing.push_back(each.text);
      observes = commands = false;
    }
  }
  const std::size_t wrong = verdict.missing.size();
  missing_for_command(config, verdict.missing);
  if (verdict.missing.size() > wrong) commands = false;
  if (seen && !none_seen && prospects.judged && prospects.opportunities > 0 &&
      prospects.in_reach == 0) {
    commands = false;
    verdict.missing.push_back("to command: a drive in which an experiment may run; in none of " +
                              std::to_string(prospects.opportunities) + " it may");
  }
  if (!seen) verdict.missing.push_back("a log or a bus: nothing of the car has been seen");

  verdict.ready = commands && observes ? Ready::kCommand
                  : observes           ? Ready::kObserve
                                       : Ready::kNone;
  const std::string reach = seen ? reach_text(prospects, config) : std::string();
  std::string forbidden = reach;
  if (prospects.best && prospects.best->forbidden != 0) {
    const auto limit = static_cast<daemon::Inhibit>(std::countr_zero(prospects.best->forbidden));
    if (limit != daemon::Inhibit::kUnreachable) {
      forbidden = "with " + grouped(prospects.best->torque_Nm) +
                  " Nm the peak is in reach, but kept away by " + cause_of(limit, prospects);
    }
  }
  const std::string only_configuration = seen ? "" : " by the configuration alone";
  switch (verdict.ready) {
    case Ready::kNone:
      verdict.sentence = "Not ready: " + verdict.missing.front();
      if (wrong > 1) verdict.sentence += "; and " + std::to_string(wrong - 1) + " more, see above";
      break;
    case Ready::kObserve:
      verdict.sentence = "Ready to observe" + only_configuration;
      if (seen && prospects.judged && prospects.opportunities > 0 && prospects.in_reach == 0) {
        verdict.sentence += ", not to command: " + forbidden;
      } else {
        if (!reach.empty()) verdict.sentence += "; " + reach;
        for (const std::string& each : verdict.missing) {
          constexpr std::string_view kCommand = "to command: ";
          if (!each.starts_with(kCommand)) continue;
          verdict.sentence += ". To command, this is missing: " + each.substr(kCommand.size());
          break;
        }
      }
      break;
    case Ready::kCommand:
      verdict.sentence = "Ready to command" + only_configuration;
      if (!reach.empty()) {
        verdict.sentence += "; " + reach;
      } else if (seen && prospects.judged) {
        verdict.sentence += "; this drive had no opportunity for an experiment";
        const std::uint64_t most =
            *std::max_element(prospects.forbidden_by.begin(), prospects.forbidden_by.end());
        std::string why;
        for (std::size_t i = 0; most > 0 && i < prospects.forbidden_by.size(); ++i) {
          if (prospects.forbidden_by[i] < most) continue;
          why += (why.empty() ? "; kept away by " : ", and by ") +
                 cause_of(static_cast<daemon::Inhibit>(i), prospects);
        }
        verdict.sentence += why;
      }
      break;
  }
  if (!verdict.sentence.ends_with('?')) verdict.sentence += '.';
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
