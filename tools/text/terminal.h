// What a tool says, on standard output or standard error: text that may hold names of others never
// steers the terminal. Tools only.
#pragma once

#include <cstdio>
#include <string>
#include <string_view>

#include "can_dbc/text/printable.h"

namespace beltgrip::text {

inline void print(std::FILE* out, std::string_view text) {
  const std::string safe = can::printable_lines(text);
  std::fwrite(safe.data(), 1, safe.size(), out);
}
// One line on standard error.
inline void complain(std::string_view line) {
  print(stderr, "beltgrip: " + can::printable(line) + "\n");
}
inline void warn(std::string_view line) { complain("warning: " + std::string(line)); }

}  // namespace beltgrip::text
