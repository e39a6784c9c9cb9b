// The subcommands of the program beltgrip. Each add_... registers its options and a callback that
// does the work and throws Failure when it cannot.
#pragma once

#include <CLI/CLI.hpp>

#include "tools/cli/exit_codes.h"

namespace beltgrip::cli {}  // namespace beltgrip::cli
