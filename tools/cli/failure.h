// Why a subcommand ends early: thrown by it, caught once in main, which prints one line on standard
// error and exits with the code.
#pragma once

#include <string>

#include "daemon/core/base/exit_code.h"

namespace beltgrip::cli {

struct Failure {
  int exit_code = kInternal;
  std::string text;
};

}  // namespace beltgrip::cli
