// A line by a pattern as printf has it. Not on the real-time thread.
#pragma once

#include <cstdio>
#include <string>

namespace beltgrip {

inline std::string format(const char* pattern, auto... values) {
  const int length = std::snprintf(nullptr, 0, pattern, values...);
  std::string line(static_cast<std::size_t>(length), '\0');
  std::snprintf(line.data(), line.size() + 1, pattern, values...);
  return line;
}

}  // namespace beltgrip
