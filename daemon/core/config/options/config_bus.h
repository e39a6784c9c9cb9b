// [bus], its identifiers and [bus.NAME]. Start-up and tools only.
#pragma once

#include <string>

#include "daemon/core/config/options/config.h"
#include "daemon/core/config/toml/config_document.h"
#include "daemon/core/config/toml/config_errors.h"

namespace beltgrip::daemon {

// False when errors were added.
bool read_identifiers(const std::string& key, const TomlNode& node, Config& config,
                      ConfigErrors& errors);
void read_further_bus(const TomlNode& node, Config& config, ConfigErrors& errors);

// Interface and identifiers, also against the messages of the roles. `root` is the file.
void check_bus(const Config& config, const TomlNode& root, ConfigErrors& errors);
// A second interface is there for a role, and is one that can be waited for together with the
// first.
void check_further_bus(const Config& config, const TomlNode& root, ConfigErrors& errors);

}  // namespace beltgrip::daemon
