// A DBC file as `beltgrip dbc` reads it, and what is said of its problems. Tools only.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "can_dbc/dbc/parser.h"

namespace beltgrip::cli {

// Failure 66 where the file cannot be read, 65 where it is too large for a DBC file.
can::DbcParseResult read_dbc(const std::string& path);

// Failure 65.
[[noreturn]] void fail_without_message(const std::string& path);

struct ProblemCount {
  std::size_t warnings = 0;
  std::size_t errors = 0;
};
ProblemCount count(const std::vector<can::Problem>& problems);
// "1 error, 2 warnings"
std::string text_of(const ProblemCount& problems);
// "3 signals"
std::string counted(std::size_t count, const char* what);

// One line on standard error if there is anything to know about the file.
void mention_problems(const std::string& path, const std::vector<can::Problem>& problems);

}  // namespace beltgrip::cli
