// A check as text of at most 100 columns, and as JSON (interfaces: one object). Tools only.
#pragma once

#include <string>

#include "daemon/core/config/options/config.h"
#include "tools/check/bus_view.h"
#include "tools/check/role_watch.h"
#include "tools/check/verdict.h"

namespace beltgrip::check {

struct Checked {
  const daemon::Config& config;
  const RoleWatch& watch;
  const Prospects& prospects;
  const Verdict& verdict;
  std::string what;  // "drive.log", "can0 for 10 s"; empty: the configuration alone
};

std::string text(const Checked& checked);
std::string json(const Checked& checked);

}  // namespace beltgrip::check
