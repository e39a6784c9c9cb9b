// What `beltgrip calibrate` reads from the same drives, against what the configuration says.
// Tools only.
#pragma once

#include <array>
#include <span>

#include "daemon/core/config/options/config.h"
#include "tools/calibrate/calibrate.h"
#include "tools/check/finding.h"

namespace beltgrip::check {

// periods_s: of each role's messages, 0 where it is not known.
using Periods = std::array<double, daemon::kRoleCount>;
Findings judge_constants(std::span<const calibrate::Finding> measured, const daemon::Config& config,
                         const Periods& periods_s);

}  // namespace beltgrip::check
