// What the keys of a configuration must be to each other. `root` is the file. Start-up and tools
// only.
#pragma once

#include "daemon/core/config/options/config.h"
#include "daemon/core/config/toml/config_document.h"
#include "daemon/core/config/toml/config_errors.h"

namespace beltgrip::daemon {

void check_required_roles(const Config& config, const TomlNode& root, ConfigErrors& errors);
// Numbers of [variator], [estimator] and [experiment].
void check_numbers(const Config& config, const TomlNode& root, ConfigErrors& errors);
// What a request for clamping force needs beyond what observation does.
void check_command(const Config& config, const TomlNode& root, ConfigErrors& errors);

}  // namespace beltgrip::daemon
