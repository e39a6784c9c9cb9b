// The configuration for the logs that a command is given: of frames, or tables of signals. Tools
// only.
#pragma once

#include <string>
#include <vector>

#include "daemon/command_line/command_line.h"
#include "daemon/core/config/options/config.h"

namespace beltgrip::cli {

// As load_configuration(). Where the logs are tables of signals (.csv), their columns take the
// place of DBC and bus. rate_Hz: rows a second, 0: not said. Throws Failure.
daemon::Config load_configuration_for(const std::vector<std::string>& logs, double rate_Hz,
                                      const std::string& path, const std::string& method);
// What an experiment needs has a column in the table, if it is one. Throws Failure 65.
void require_columns(const daemon::Config& config, const std::string& log);
// The option that says it.
void add_rate_option(const command_line::Command& command, double& rate_Hz);

}  // namespace beltgrip::cli
