// All of a check, put together: role by role, across, experiments, and what it is ready for.
// Tools only.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "daemon/core/config/options/config.h"
#include "daemon/core/reasons/reasons.h"
#include "tools/check/bus_view.h"
#include "tools/check/finding.h"
#include "tools/check/judge_role.h"
#include "tools/check/role_watch.h"

namespace beltgrip::check {

enum class Ready { kNone, kObserve, kCommand };

struct Verdict {
  std::vector<Findings> roles;  // as config.roles
  Findings across;
  Ready ready = Ready::kNone;
  std::vector<std::string> missing;
  std::string sentence;
};

// seen: a log or a bus was looked at, not the configuration alone.
Verdict judge(const RoleWatch& watch, const std::vector<Window>& windows,
              const Prospects& prospects, const daemon::Config& config, const DbcUnits& units,
              bool seen);

// When all findings are there: the sentence says how many of them are doubts.
void summarize_doubts(Verdict& verdict);

// What kept experiments away, with its figure, in the words of every program.
daemon::Reason reason_of(daemon::Inhibit inhibit, const Prospects& prospects);
// "force floor 7,280 N: the peak is reached from 116 Nm on; this drive coasts with 31 Nm"
std::string reach_text(const Prospects& prospects, const daemon::Config& config);

}  // namespace beltgrip::check
