// Reads the configuration and every file that it names. Start-up and tools only.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/config/options/config.h"
#include "daemon/core/config/toml/config_errors.h"

namespace beltgrip::daemon {

struct ConfigResult {
  std::optional<Config> config;       // set when errors is empty
  std::vector<ConfigError> errors;    // all of them
  std::vector<std::string> warnings;  // problems of the DBC files and the like, one line each
  // What [sensors] states, by role. Beside it, what it leaves out is as in other cars, and listed;
  // where it states nothing at all, all is 0.
  std::array<estimator::ChannelAccuracy, kRoleCount> stated{};
  std::vector<AssumedAccuracy> assumed;
  estimator::ConstantSet left_out;  // of [variator], in any scope

  int exit_code() const { return errors.empty() ? 0 : errors.front().exit_code; }
};

// How much of it is wanted: for the daemon, for reading logs, or (without [signals] and DBC files)
// for tables whose columns are named by role.
enum class ConfigScope { kAll, kSignals, kVariator };
ConfigResult load_config(const std::string& path, ConfigScope scope = ConfigScope::kAll);
// The same for a table of signals: columns take the place of DBC and bus, roles may be missing, and
// nobody is there to be commanded.
ConfigResult load_config(const std::string& path, std::shared_ptr<const TableSource> table);
// One line: what results rest on that nobody stated; empty: nothing.
std::string assumed_text(const Config& config);

}  // namespace beltgrip::daemon
