#include "tools/cli/configuration.h"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <utility>

#include "daemon/core/config/load/load_config.h"
#include "tools/cli/failure.h"
#include "tools/cli/output_file.h"
#include "tools/text/terminal.h"

namespace beltgrip::cli {

daemon::Config load_configuration(const std::string& path, const std::string& method,
                                  std::shared_ptr<const daemon::TableSource> table) {
  daemon::ConfigResult result =
      table ? daemon::load_config(path, std::move(table)) : daemon::load_config(path);
  for (const std::string& warning : result.warnings) {
    text::warn(warning);
  }
  if (!result.config) {
    Failure failure{result.exit_code(), ""};
    for (const daemon::ConfigError& error : result.errors) {
      failure.text += (failure.text.empty() ? "" : "\n") + error.text;
    }
    throw failure;
  }
  if (!method.empty()) {
    result.config->estimator.method =
        method == "paper" ? estimator::Method::kPaper : estimator::Method::kRobust;
  }
  return std::move(*result.config);
}

namespace {

// Removed with what is in it.
struct TemporaryFolder {
  std::string path = (std::filesystem::temp_directory_path() / "beltgrip.XXXXXX").string();
  TemporaryFolder() {
    if (mkdtemp(path.data()) == nullptr) {
      throw Failure{kCannotCreate, path + ": no temporary directory can be made"};
    }
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
};

// A basic string of TOML.
std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += c;
  }
  return out + '"';
}

}  // namespace

daemon::Config load_configuration_text(std::string_view toml, std::string_view dbc,
                                       const std::string& method) {
  const TemporaryFolder folder;
  write_file(folder.path + "/vehicle.dbc", {}, dbc);
  write_file(folder.path + "/beltgrip.toml", {}, toml);
  return load_configuration(folder.path + "/beltgrip.toml", method);
}

std::string why_refused(std::string_view lines, const std::string& path,
                        std::shared_ptr<const daemon::TableSource> table) {
  const TemporaryFolder folder;
  write_file(folder.path + "/lines.toml", {}, lines);
  write_file(folder.path + "/both.toml", {}, "include = [" + quoted(path) + ", \"lines.toml\"]\n");
  const daemon::ConfigResult result =
      daemon::load_config(folder.path + "/both.toml", std::move(table));
  if (result.config) return {};
  const std::string& text = result.errors.front().text;
  return text.substr(std::min(text.find(": ") + 2, text.size()));
}

}  // namespace beltgrip::cli
