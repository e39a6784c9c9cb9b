// beltgrip dbc show | decode | check: what a DBC file says, what the frames of a log say in its
// terms, and what is odd about it.
#pragma once

#include "daemon/command_line/command_line.h"

namespace beltgrip::cli {

void add_dbc(command_line::Command app);

}  // namespace beltgrip::cli
