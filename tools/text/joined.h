// Words in one line, with something between them.
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace beltgrip::text {

inline std::string joined(std::span<const std::string> words, std::string_view between = ", ") {
  std::string out;
  for (const std::string& each : words) {
    if (!out.empty()) out += between;
    out += each;
  }
  return out;
}

}  // namespace beltgrip::text
