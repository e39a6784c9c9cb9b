// The subcommands of the program beltgrip. Each add_... registers its options and a callback that
// does the work and throws Failure when it cannot.
#pragma once

#include "daemon/command_line/command_line.h"
#include "tools/cli/failure.h"

namespace beltgrip::cli {

void add_calibrate(command_line::Command app);
void add_check(command_line::Command app);
void add_history(command_line::Command app);
void add_init(command_line::Command app);
void add_monitor(command_line::Command app);
void add_replay(command_line::Command app);
void add_report(command_line::Command app);
void add_run_demo(command_line::Command app);
void add_simulate(command_line::Command app);

}  // namespace beltgrip::cli
