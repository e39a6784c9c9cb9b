#include "tools/cli/log_configuration.h"

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>

#include "can_dbc/log/can_log.h"
#include "tools/check/judge_role.h"
#include "tools/cli/configuration.h"
#include "tools/cli/failure.h"
#include "tools/table/table_head.h"

namespace beltgrip::cli {

namespace {

// Only what can be read twice.
std::optional<table::Head> head_of(const std::string& path) {
  const auto is_called = [&path](const char* ending) {
    return path.ends_with(ending) || path.ends_with(std::string(ending) + ".gz") ||
           path.ends_with(std::string(ending) + ".zst");
  };
  std::error_code none;
  if (!is_called(".csv") && !is_called(".tsv")) return {};
  const auto file = std::filesystem::status(path, none);
  if (!std::filesystem::is_regular_file(file) && std::filesystem::exists(file)) return {};
  try {
    return table::read_head(path);
  } catch (const can::LogOpenError& error) {
    throw Failure{kNoInput, error.text};
  }
}

}  // namespace

daemon::Config load_configuration_for(const std::vector<std::string>& logs, double rate_Hz,
                                      const std::string& path, const std::string& method) {
  std::shared_ptr<daemon::TableSource> source;
  std::size_t tables = 0;
  for (const std::string& log : logs) {
    const std::optional<table::Head> head = head_of(log);
    if (!head) continue;
    ++tables;
    if (!head->time && !(rate_Hz > 0.0)) {
      throw Failure{kBadInput, log + ": a table of " + std::to_string(head->columns.size()) +
                                   " signals without a time column, expected one (t[s], time_ms) "
                                   "or --rate HZ"};
    }
    if (head->time && head->time_unit_unknown) {
      const table::Column& time = head->columns[*head->time];
      throw Failure{kBadInput, log + ":" + std::to_string(time.unit_line) + ": time in '" +
                                   time.unit + "', expected s, ms, us, ns, min or h, as in t[s]"};
    }
    if (head->time && rate_Hz > 0.0) {
      throw Failure{kUsage, log + ": --rate beside the time column \"" +
                                head->columns[*head->time].name + "\", expected one of them"};
    }
    if (source) continue;
    source = std::make_shared<daemon::TableSource>();
    source->columns = table::database_of(*head);
    source->rate_Hz = rate_Hz;
  }
  if (tables == 0 && rate_Hz > 0.0) {
    throw Failure{kUsage, "--rate: found no table of signals (.csv), expected one"};
  }
  if (tables > 0 && tables < logs.size()) {
    throw Failure{kUsage, "found tables of signals and logs of frames, expected one kind"};
  }
  return load_configuration(path, method, std::move(source));
}

void require_columns(const daemon::Config& config, const std::string& log) {
  if (!config.table) return;
  for (std::size_t i = 0; i < daemon::kRoleCount; ++i) {
    const auto role = static_cast<daemon::Role>(i);
    if (!check::is_required(role, config)) continue;
    const auto has = std::find_if(
        config.roles.begin(), config.roles.end(),
        [role](const auto& each) { return each.role == role && daemon::has_column(each); });
    if (has != config.roles.end()) continue;
    throw Failure{kBadInput, log + ": no column for " + std::string(daemon::role_name(role)) +
                                 ", expected signals." + std::string(daemon::role_name(role)) +
                                 " = { column = \"...\" } in the configuration"};
  }
}

void add_rate_option(const command_line::Command& command, double& rate_Hz) {
  command
      .add_option("--rate", rate_Hz,
                  "Rows a second of a table of signals (.csv) without a time column")
      .type_name("HZ")
      .range(1e-3, 1e5);
}

}  // namespace beltgrip::cli
