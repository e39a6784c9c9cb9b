// The history of a belt as a page to look at: mu_max over the belt's life. Tools only.
#pragma once

#include <string>

#include "tools/cli/history_file.h"

namespace beltgrip::cli {
std::string history_page(const History& history);
}  // namespace beltgrip::cli
