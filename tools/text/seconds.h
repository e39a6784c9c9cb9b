// Nanoseconds as seconds in decimal, "12.345", without a rounding error, whatever the origin of the
// stamps. Tools only.
#pragma once

#include <cstdint>
#include <string>

namespace beltgrip::text {

inline std::string seconds_text(std::int64_t t_ns) {
  std::string digits = std::to_string(t_ns < 0 ? -t_ns : t_ns);
  if (digits.size() < 10) digits.insert(0, 10 - digits.size(), '0');
  digits.insert(digits.size() - 9, ".");
  while (digits.back() == '0') digits.pop_back();
  if (digits.back() == '.') digits.pop_back();
  return (t_ns < 0 ? "-" : "") + digits;
}

}  // namespace beltgrip::text
