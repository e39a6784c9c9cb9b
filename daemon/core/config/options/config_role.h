// A role's value in [signals], before a DBC is looked at. Start-up and tools only.
#pragma once

#include <optional>
#include <string>

#include "daemon/core/config/options/config_options.h"
#include "daemon/core/config/toml/config_errors.h"

namespace beltgrip::daemon {

// "Message.Signal" or a table; nothing when errors were added.
std::optional<RoleText> read_role(const std::string& key, const TomlNode& node,
                                  ConfigErrors& errors);
// The line of one of its keys, else its own.
std::uint32_t line_in_role(const TomlNode& node, std::string_view key);

}  // namespace beltgrip::daemon
