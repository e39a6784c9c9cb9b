#include "tools/cli/configuration.h"

#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <memory>

#include "tools/cli/exit_codes.h"
#include "tools/cli/output_file.h"

namespace beltgrip::cli {

daemon::Config load_configuration(const std::string& path, const std::string& method) {
  daemon::ConfigResult result = daemon::load_config(path);
  for (const std::string& warning : result.warnings) {
    std::fprintf(stderr, "beltgrip: warning: %s\n", warning.c_str());
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

daemon::Config load_configuration_text(std::string_view toml, std::string_view dbc,
                                       const std::string& method) {
  std::string folder = (std::filesystem::temp_directory_path() / "beltgrip.XXXXXX").string();
  if (mkdtemp(folder.data()) == nullptr) {
    throw Failure{kCannotCreate, folder + ": no temporary directory can be made"};
  }
  const std::unique_ptr<const char, void (*)(const char*)> remove(
      folder.c_str(), [](const char* path) { std::filesystem::remove_all(path); });
  write_file(folder + "/vehicle.dbc", dbc);
  write_file(folder + "/beltgrip.toml", toml);
  return load_configuration(folder + "/beltgrip.toml", method);
}

}  // namespace beltgrip::cli
