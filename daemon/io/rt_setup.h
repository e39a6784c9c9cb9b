// Memory for the real-time loop: locked where the system permits it, stack touched beforehand.
// Start-up, after everything has been allocated; and helper thread, after a reload has.
#pragma once

#include <string>

namespace beltgrip::daemon {

// Locks what is mapped now. False: not permitted; `line` says why, and what would permit it.
bool lock_memory(std::string& line);
// One line that says what was had and what was not, and what would give it.
std::string prepare_real_time();

}  // namespace beltgrip::daemon
