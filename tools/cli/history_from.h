// A history from logs: what a daemon would have kept had it been there, so that recordings of many
// drives show wear. Tools only.
#pragma once

#include <string>
#include <vector>

#include "daemon/core/config/options/config.h"
#include "tools/cli/failure.h"

namespace beltgrip::cli {

// The results of all logs, in the order of their stamps, into the history in `folder`, which is
// made where there is none; what stands there already is left out. Logs whose stamps have no date
// follow each other in the order given. Returns why for each log that cannot be used.
// Failure 74: the history cannot be written.
std::vector<Failure> fill_history(const std::string& folder, const std::vector<std::string>& logs,
                                  const daemon::Config& config);

}  // namespace beltgrip::cli
