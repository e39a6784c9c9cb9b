// beltgrip status: asks a running beltgripd.
#pragma once

#include "daemon/command_line/command_line.h"

namespace beltgrip::cli {

void add_status(command_line::Command app);

}  // namespace beltgrip::cli
