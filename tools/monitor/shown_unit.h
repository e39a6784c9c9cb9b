// The unit in which people read a quantity. Tools only.
#pragma once

#include <numbers>

#include "can_dbc/text/unit_text.h"

namespace beltgrip::monitor {

struct Shown {
  double value = 0.0;
  const char* unit = "";
};

constexpr Shown in_shown_unit(can::Dimension dimension, double si) {
  switch (dimension) {
    case can::Dimension::kAngularSpeed:
      return {si * 30.0 / std::numbers::pi, "rpm"};
    case can::Dimension::kPressure:
      return {si * 1e-5, "bar"};
    case can::Dimension::kTorque:
      return {si, "Nm"};
    case can::Dimension::kTemperature:
      return {si, "degC"};
    case can::Dimension::kSpeed:
      return {si * 3.6, "km/h"};
    case can::Dimension::kShare:
      return {si * 100.0, "%"};
    case can::Dimension::kForce:
      return {si, "N"};
    case can::Dimension::kLength:
      return {si, "m"};
    case can::Dimension::kNone:
      return {si, ""};
  }
  return {si, ""};
}

}  // namespace beltgrip::monitor
