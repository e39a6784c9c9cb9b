// The subcommands of the program beltgrip. Each add_... registers its options and a callback that
// does the work and throws Failure when it cannot.
#pragma once

#include <CLI/CLI.hpp>

#include "tools/cli/exit_codes.h"

namespace beltgrip::cli {

void add_calibrate(CLI::App& app);
void add_history(CLI::App& app);
void add_init(CLI::App& app);
void add_monitor(CLI::App& app);
void add_replay(CLI::App& app);
void add_report(CLI::App& app);
void add_run_demo(CLI::App& app);
void add_simulate(CLI::App& app);

}  // namespace beltgrip::cli
