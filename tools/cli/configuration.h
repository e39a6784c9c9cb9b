// Loads BeltGrip's configuration for a subcommand: warnings to standard error, errors as Failure.
#pragma once

#include <string>

#include "daemon/core/config.h"

namespace beltgrip::cli {

// method: empty, or what --method says ("robust", "paper").
daemon::Config load_configuration(const std::string& path, const std::string& method);

}  // namespace beltgrip::cli
