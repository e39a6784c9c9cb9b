// What the parts of a pipeline are made with, out of the configuration. Pure functions; start-up.
#pragma once

#include "daemon/core/config/options/config.h"
#include "daemon/core/guard/safety_monitor.h"

namespace beltgrip::daemon {

// The safety monitor's limits. Independent of what the experiment uses: wider than its own limits,
// and it keeps to them.
SafetyLimits safety_limits(const Config& config);

// With its assumed constants as samples are read. What is only watched is read best in the middle
// of what is possible: a force that is off by a constant bends the curve, and without any inertia
// the torque that slip takes from the belt cannot be seen. A request is made in the transmission's
// own measure of force, which the defaults are.
Config as_read(Config config);

}  // namespace beltgrip::daemon
