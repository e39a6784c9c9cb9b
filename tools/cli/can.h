// beltgrip can: up, down, status of a CAN interface.
#pragma once

#include <CLI/CLI.hpp>

namespace beltgrip::cli {

void add_can(CLI::App& app);

}  // namespace beltgrip::cli
