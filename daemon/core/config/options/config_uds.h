// A role's value in a diagnostic answer: signals.ROLE.uds of the configuration. Start-up and tools
// only.
#pragma once

#include <string>

#include "daemon/core/config/options/config_options.h"
#include "daemon/core/config/toml/config_errors.h"

namespace beltgrip::daemon {

UdsSource usual_uds();  // where the keys that have a default are left out
// False when errors were added. `key` is that of the table.
bool read_role_uds(const std::string& key, const TomlNode& node, RoleText& role,
                   ConfigErrors& errors);

// What the roles from diagnostics must agree on with each other, with the broadcast messages and
// with the identifiers of BeltGrip. `signals` is that section of the file.
void check_uds(const Config& config, const TomlNode& signals, ConfigErrors& errors);

}  // namespace beltgrip::daemon
