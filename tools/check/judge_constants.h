// What `beltgrip calibrate` reads from the same drives, against what the configuration says.
// Tools only.
#pragma once

#include <span>

#include "daemon/core/config/options/config.h"
#include "tools/calibrate/calibrate.h"
#include "tools/check/finding.h"

namespace beltgrip::check {

Findings judge_constants(std::span<const calibrate::Finding> measured,
                         const daemon::Config& config);

}  // namespace beltgrip::check
