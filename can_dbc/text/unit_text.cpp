#include "can_dbc/text/unit_text.h"

#include <algorithm>
#include <array>
#include <numbers>
#include <string>

namespace beltgrip::can {

namespace {

struct UnitRow {
  std::string_view text;  // after normalise()
  Unit unit;
  bool either_case;  // false where another case would be another unit or a mere letter
};

constexpr double kRpm = std::numbers::pi / 30.0;  // rad/s
constexpr double kZeroCelsius_K = 273.15;
constexpr double kPsi_Pa = 6894.757293168361;
constexpr double kMph_m_per_s = 0.44704;

constexpr auto kAngular = Dimension::kAngularSpeed;
constexpr auto kTemperature = Dimension::kTemperature;

constexpr std::array kUnits{
    UnitRow{"rpm", {kAngular, kRpm, 0.0}, true},
    UnitRow{"1/min", {kAngular, kRpm, 0.0}, true},
    UnitRow{"min^-1", {kAngular, kRpm, 0.0}, true},
    UnitRow{"min-1", {kAngular, kRpm, 0.0}, true},
    UnitRow{"u/min", {kAngular, kRpm, 0.0}, true},
    UnitRow{"r/min", {kAngular, kRpm, 0.0}, true},
    UnitRow{"rev/min", {kAngular, kRpm, 0.0}, true},
    UnitRow{"tr/min", {kAngular, kRpm, 0.0}, true},
    UnitRow{"unit_minutinver", {kAngular, kRpm, 0.0}, true},
    UnitRow{"rad/s", {kAngular, 1.0, 0.0}, true},
    UnitRow{"rad/sec", {kAngular, 1.0, 0.0}, true},
    UnitRow{"deg/s", {kAngular, std::numbers::pi / 180.0, 0.0}, true},
    UnitRow{"°/s", {kAngular, std::numbers::pi / 180.0, 0.0}, true},
    UnitRow{"bar", {Dimension::kPressure, 1e5, 0.0}, true},
    UnitRow{"unit_bar", {Dimension::kPressure, 1e5, 0.0}, true},
    UnitRow{"mbar", {Dimension::kPressure, 1e2, 0.0}, false},
    UnitRow{"hpa", {Dimension::kPressure, 1e2, 0.0}, true},
    UnitRow{"kpa", {Dimension::kPressure, 1e3, 0.0}, true},
    UnitRow{"MPa", {Dimension::kPressure, 1e6, 0.0}, false},
    UnitRow{"Mpa", {Dimension::kPressure, 1e6, 0.0}, false},
    UnitRow{"MPA", {Dimension::kPressure, 1e6, 0.0}, false},
    UnitRow{"pa", {Dimension::kPressure, 1.0, 0.0}, true},
    UnitRow{"psi", {Dimension::kPressure, kPsi_Pa, 0.0}, true},
    UnitRow{"nm", {Dimension::kTorque, 1.0, 0.0}, true},
    UnitRow{"newtonmeter", {Dimension::kTorque, 1.0, 0.0}, true},
    UnitRow{"unit_newtometer", {Dimension::kTorque, 1.0, 0.0}, true},
    UnitRow{"kNm", {Dimension::kTorque, 1e3, 0.0}, false},
    UnitRow{"degc", {kTemperature, 1.0, 0.0}, true},
    UnitRow{"gradc", {kTemperature, 1.0, 0.0}, true},
    UnitRow{"degreec", {kTemperature, 1.0, 0.0}, true},
    UnitRow{"°c", {kTemperature, 1.0, 0.0}, true},
    UnitRow{"unit_degrecelsi", {kTemperature, 1.0, 0.0}, true},
    UnitRow{"℃", {kTemperature, 1.0, 0.0}, false},
    UnitRow{"celsius", {kTemperature, 1.0, 0.0}, true},
    UnitRow{"C", {kTemperature, 1.0, 0.0}, false},
    UnitRow{"K", {kTemperature, 1.0, -kZeroCelsius_K}, false},
    UnitRow{"kelvin", {kTemperature, 1.0, -kZeroCelsius_K}, true},
    UnitRow{"degf", {kTemperature, 5.0 / 9.0, -160.0 / 9.0}, true},
    UnitRow{"°f", {kTemperature, 5.0 / 9.0, -160.0 / 9.0}, true},
    UnitRow{"km/h", {Dimension::kSpeed, 1.0 / 3.6, 0.0}, true},
    UnitRow{"kph", {Dimension::kSpeed, 1.0 / 3.6, 0.0}, true},
    UnitRow{"kmh", {Dimension::kSpeed, 1.0 / 3.6, 0.0}, true},
    UnitRow{"kmph", {Dimension::kSpeed, 1.0 / 3.6, 0.0}, true},
    UnitRow{"unit_kilometerperhour", {Dimension::kSpeed, 1.0 / 3.6, 0.0}, true},
    UnitRow{"m/s", {Dimension::kSpeed, 1.0, 0.0}, false},
    UnitRow{"m/sec", {Dimension::kSpeed, 1.0, 0.0}, false},
    UnitRow{"mph", {Dimension::kSpeed, kMph_m_per_s, 0.0}, true},
    UnitRow{"%", {Dimension::kShare, 0.01, 0.0}, true},
    UnitRow{"percent", {Dimension::kShare, 0.01, 0.0}, true},
    UnitRow{"unit_percent", {Dimension::kShare, 0.01, 0.0}, true},
    UnitRow{"N", {Dimension::kForce, 1.0, 0.0}, false},
    UnitRow{"kN", {Dimension::kForce, 1e3, 0.0}, false},
    UnitRow{"KN", {Dimension::kForce, 1e3, 0.0}, false},
    UnitRow{"newton", {Dimension::kForce, 1.0, 0.0}, true},
    UnitRow{"m", {Dimension::kLength, 1.0, 0.0}, false},
    UnitRow{"mm", {Dimension::kLength, 1e-3, 0.0}, false},
    UnitRow{"cm", {Dimension::kLength, 1e-2, 0.0}, false},
};

struct DimensionRow {
  std::string_view name, si_unit;
};
constexpr std::array<DimensionRow, 9> kDimensions{{{"angular speed", "rad/s"},
                                                   {"pressure", "Pa"},
                                                   {"torque", "Nm"},
                                                   {"temperature", "degC"},
                                                   {"speed", "m/s"},
                                                   {"share", "1"},
                                                   {"force", "N"},
                                                   {"length", "m"},
                                                   {"no unit", ""}}};

// The signs that different editors write for "times" and "degree" as one; blanks and the times sign
// between the parts of a product go.
std::string normalise(std::string_view text) {
  struct Spelling {
    std::string_view from, to;
  };
  static constexpr std::array kSpellings{
      Spelling{"·", ""},    Spelling{"•", ""},      Spelling{"⋅", ""},  Spelling{"∙", ""},
      Spelling{"×", ""},    Spelling{"*", ""},      Spelling{".", ""},  Spelling{" ", ""},
      Spelling{"\t", ""},   Spelling{"\u00A0", ""}, Spelling{"º", "°"}, Spelling{"˚", "°"},
      Spelling{"⁻¹", "^-1"}};
  if (text.size() >= 2 && ((text.front() == '[' && text.back() == ']') ||
                           (text.front() == '(' && text.back() == ')'))) {
    text = text.substr(1, text.size() - 2);
  }
  std::string result;
  while (!text.empty()) {
    const auto spelling = std::find_if(kSpellings.begin(), kSpellings.end(),
                                       [&](const Spelling& s) { return text.starts_with(s.from); });
    if (spelling == kSpellings.end()) {
      result += text.front();
      text.remove_prefix(1);
    } else {
      result += spelling->to;
      text.remove_prefix(spelling->from.size());
    }
  }
  return result;
}

std::string lower_case(std::string text) {
  for (char& c : text) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return text;
}

}  // namespace

std::optional<Unit> parse_unit(std::string_view text) {
  constexpr std::size_t kLongestUnit = 64;
  if (text.size() > kLongestUnit) return std::nullopt;
  const std::string as_written = normalise(text);
  const std::string lower = lower_case(as_written);
  for (const UnitRow& row : kUnits) {
    if (row.text == as_written || (row.either_case && row.text == lower)) return row.unit;
  }
  return std::nullopt;
}

std::string_view dimension_name(Dimension dimension) {
  return kDimensions[static_cast<std::size_t>(dimension)].name;
}

std::string_view si_unit_text(Dimension dimension) {
  return kDimensions[static_cast<std::size_t>(dimension)].si_unit;
}

}  // namespace beltgrip::can
