// Loads BeltGrip's configuration for a subcommand: warnings to standard error, errors as Failure.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "daemon/core/config/options/config.h"

namespace beltgrip::cli {

// method: empty, or what --method says ("robust", "paper"). table: is read instead of frames.
daemon::Config load_configuration(const std::string& path, const std::string& method,
                                  std::shared_ptr<const daemon::TableSource> table = nullptr);
// The same for texts that are in no file; the configuration names the DBC "vehicle.dbc".
daemon::Config load_configuration_text(std::string_view toml, std::string_view dbc,
                                       const std::string& method);

// Why lines that are read after the configuration at `path` (absolute) make it one that does not
// load; empty: it loads.
std::string why_refused(std::string_view lines, const std::string& path,
                        std::shared_ptr<const daemon::TableSource> table);

}  // namespace beltgrip::cli
