// beltgrip status: asks a running beltgripd.
#pragma once

#include <CLI/CLI.hpp>

namespace beltgrip::cli {

void add_status(CLI::App& app);

}  // namespace beltgrip::cli
