// The configuration once more, beside a loop that runs. Helper thread only.
#pragma once

#include <string>

#include "daemon/core/config/load/load_config.h"

namespace beltgrip::daemon {

// As load_config(), out of regular files only: what it reads must end, or the helper thread never
// comes back.
ConfigResult reload_config(const std::string& path);

}  // namespace beltgrip::daemon
