// beltgrip diagnose: what the simulation gets wrong, why, and what the correction is worth.
#pragma once

#include "tools/cli/command.h"

namespace beltgrip::cli {
void add_diagnose(command_line::Command app);
}  // namespace beltgrip::cli
