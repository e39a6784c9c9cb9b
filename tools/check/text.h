// Numbers as a person reads them. Tools only.
#pragma once

#include <cmath>
#include <string>

#include "can_dbc/text/format.h"

namespace beltgrip::check {

// "7,280"; what has more digits than a person counts as 1.2e+15.
inline std::string grouped(double value) {
  constexpr double kMost = 1e12;
  if (std::abs(value) >= kMost) return format("%.2g", value);
  std::string digits = format("%.0f", std::abs(value));
  for (std::size_t at = digits.size(); at > 3; at -= 3) digits.insert(at - 3, ",");
  return (value < 0.0 && digits != "0" ? "-" : "") + digits;
}

// To four digits, without an exponent where there need be none.
inline std::string number(double value) {
  if (!std::isfinite(value)) return "-";
  if (value == 0.0) return "0";
  const double magnitude = std::abs(value);
  if (magnitude >= 9999.5) return grouped(value);
  std::string text = format("%.4g", value);
  if (text.find('e') != std::string::npos && magnitude >= 1e-4) text = format("%.6f", value);
  return text;
}

}  // namespace beltgrip::check
