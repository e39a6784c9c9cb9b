// A role's value in a diagnostic answer: { request, response, did, start, length, byte_order,
// scale, offset, signed } of the configuration. Start-up and tools only.
#pragma once

#include <optional>
#include <string>

#include "daemon/core/config/config.h"
#include "daemon/core/config/config_binding.h"
#include "daemon/core/config/config_document.h"

namespace beltgrip::daemon {

// Nothing when errors were added. `key` is that of the table.
std::optional<UdsSource> read_uds(const std::string& key, const TomlNode& node,
                                  ConfigErrors& errors);

// What the roles from diagnostics must agree on with each other, with the broadcast messages and
// with the identifiers of BeltGrip. `signals` is that section of the file.
void check_uds(const Config& config, const TomlNode& signals, ConfigErrors& errors);

}  // namespace beltgrip::daemon
