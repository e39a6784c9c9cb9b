// "MacroSlip" as JSON has it: "macro_slip".
#pragma once

#include <string>
#include <string_view>

namespace beltgrip::text {

inline std::string snake_case(std::string_view name) {
  std::string result;
  for (const char c : name) {
    const bool upper = c >= 'A' && c <= 'Z';
    if (upper && !result.empty()) result += '_';
    result += upper ? static_cast<char>(c - 'A' + 'a') : c;
  }
  return result;
}

}  // namespace beltgrip::text
