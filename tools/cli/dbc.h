// beltgrip dbc show | decode | check: what a DBC file says, what the frames of a log say in its
// terms, and what is odd about it.
#pragma once

#include <CLI/CLI.hpp>

namespace beltgrip::cli {

void add_dbc(CLI::App& app);

}  // namespace beltgrip::cli
