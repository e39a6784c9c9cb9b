// beltgrip can: up, down, status of a CAN interface.
#pragma once

#include "daemon/command_line/command_line.h"

namespace beltgrip::cli {

void add_can(command_line::Command app);

}  // namespace beltgrip::cli
