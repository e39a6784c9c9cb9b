// Unit text of a DBC or configuration -> dimension and factor to SI. No locale. Start-up only.
#pragma once

#include <optional>
#include <string_view>

namespace beltgrip::can {

enum class Dimension {
  kAngularSpeed,  // rad/s
  kPressure,      // Pa
  kTorque,        // N m
  kTemperature,   // degrees Celsius (the one exception to SI: the domain's scale)
  kSpeed,         // m/s
  kShare,         // 1 (percent / 100)
  kForce,         // N
  kLength,        // m
  kNone           // no unit: flags and enumerations
};

struct Unit {
  Dimension dimension = Dimension::kNone;
  double factor = 1.0;  // SI = value * factor + offset
  double offset = 0.0;
};

// Accepts what real files contain: "rpm", "1/min", "U/min", "rad/s", "bar", "kPa", "MPa", "Pa",
// "Nm", "N·m", "N.m", "N m", "degC", "°C", "C", "K", "km/h", "kph", "m/s", "%", "N", "kN", "m",
// "mm", in either case where that is unambiguous, with blanks. Unknown text gives nothing.
std::optional<Unit> parse_unit(std::string_view text);
std::string_view dimension_name(Dimension dimension);  // "angular speed", ...
std::string_view si_unit_text(Dimension dimension);    // "rad/s", ...

}  // namespace beltgrip::can
