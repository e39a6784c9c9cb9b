// Memory for the real-time loop: locked where the system permits it, stack touched beforehand.
// Start-up only, after everything has been allocated.
#pragma once

#include <string>

namespace beltgrip::daemon {

// One line that says what was had and what was not, and what would give it.
std::string prepare_real_time();

}  // namespace beltgrip::daemon
