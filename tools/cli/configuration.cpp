#include "tools/cli/configuration.h"

#include <cstdio>

#include "tools/cli/exit_codes.h"

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

}  // namespace beltgrip::cli
