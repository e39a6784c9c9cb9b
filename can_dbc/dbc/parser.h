// DBC text -> Database and a list of problems with positions. Bounded and linear in the input, no
// locale, no exception for any content. Start-up and tools only.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "can_dbc/dbc/model.h"

namespace beltgrip::can {

enum class Severity { kWarning, kError };

struct Problem {
  Severity severity = Severity::kWarning;
  std::uint32_t line = 0;    // 1-based
  std::uint32_t column = 0;  // 1-based, in bytes
  std::string code;          // short stable identifier of the kind, e.g. "overlap"
  std::string text;          // what was found and what would be right
};

struct DbcParseResult {
  Database database;
  std::vector<Problem> problems;  // in file order
};

DbcParseResult parse_dbc(std::string text);  // which the database keeps

}  // namespace beltgrip::can
