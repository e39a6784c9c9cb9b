// What belongs together across roles: speeds and the end stops, the engine's speed and the lock-up,
// vehicle speed and final drive, torque and acceleration, pressure and what the belt must carry.
// Tools only.
#pragma once

#include "daemon/core/config/options/config.h"
#include "tools/check/bus_view.h"
#include "tools/check/finding.h"
#include "tools/check/thinned.h"

namespace beltgrip::check {

Findings judge_across(const std::vector<Window>& windows, const daemon::Config& config);

}  // namespace beltgrip::check
