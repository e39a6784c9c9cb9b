#include "can_dbc/text/unit_text.h"

#include <gtest/gtest.h>

namespace beltgrip::can {
namespace {

struct Case {
  const char* text;
  Dimension dimension;
  double in;  // in the unit
  double si;
};

class UnitText : public ::testing::TestWithParam<Case> {};

TEST_P(UnitText, GivesDimensionAndSiValue) {
  const auto unit = parse_unit(GetParam().text);
  ASSERT_TRUE(unit) << GetParam().text;
  EXPECT_EQ(unit->dimension, GetParam().dimension);
  EXPECT_NEAR(GetParam().in * unit->factor + unit->offset, GetParam().si,
              1e-12 * std::max(1.0, std::abs(GetParam().si)));
}

constexpr double k60Rpm = 2.0 * 3.14159265358979323846;
INSTANTIATE_TEST_SUITE_P(
    All, UnitText,
    ::testing::Values(
        Case{"rpm", Dimension::kAngularSpeed, 60, k60Rpm},
        Case{"RPM", Dimension::kAngularSpeed, 60, k60Rpm},
        Case{"1/min", Dimension::kAngularSpeed, 60, k60Rpm},
        Case{"U/min", Dimension::kAngularSpeed, 60, k60Rpm},
        Case{"min^-1", Dimension::kAngularSpeed, 60, k60Rpm},
        Case{"rad/s", Dimension::kAngularSpeed, 3, 3}, Case{"bar", Dimension::kPressure, 2, 2e5},
        Case{"kPa", Dimension::kPressure, 2, 2e3}, Case{"kpa", Dimension::kPressure, 2, 2e3},
        Case{"MPa", Dimension::kPressure, 2, 2e6}, Case{"Pa", Dimension::kPressure, 2, 2},
        Case{"Nm", Dimension::kTorque, 2, 2}, Case{"N·m", Dimension::kTorque, 2, 2},
        Case{"N.m", Dimension::kTorque, 2, 2}, Case{"N m", Dimension::kTorque, 2, 2},
        Case{"N*m", Dimension::kTorque, 2, 2}, Case{"NM", Dimension::kTorque, 2, 2},
        Case{"degC", Dimension::kTemperature, 20, 20},
        Case{"deg C", Dimension::kTemperature, 20, 20}, Case{"°C", Dimension::kTemperature, 20, 20},
        Case{" °C ", Dimension::kTemperature, 20, 20},
        Case{"[°C]", Dimension::kTemperature, 20, 20}, Case{"C", Dimension::kTemperature, 20, 20},
        Case{"K", Dimension::kTemperature, 293.15, 20},
        Case{"°F", Dimension::kTemperature, 212, 100}, Case{"km/h", Dimension::kSpeed, 36, 10},
        Case{"KM/H", Dimension::kSpeed, 36, 10}, Case{"kph", Dimension::kSpeed, 36, 10},
        Case{"m/s", Dimension::kSpeed, 3, 3}, Case{"%", Dimension::kShare, 50, 0.5},
        Case{"N", Dimension::kForce, 3, 3}, Case{"kN", Dimension::kForce, 3, 3000},
        Case{"m", Dimension::kLength, 3, 3}, Case{"mm", Dimension::kLength, 3, 0.003}));

TEST(UnitText, RefusesWhatIsUnknownOrAmbiguous) {
  for (const char* text :
       {"", " ", "n", "k", "c", "M", "mPa", "mpa", "MM", "furlong", "[]", "rpm2", "%%", "1", "-",
        "\xB0"
        "C"}) {
    EXPECT_FALSE(parse_unit(text)) << text;
  }
  EXPECT_FALSE(parse_unit(std::string(1'000'000, ' ') + "rpm"));
}

TEST(UnitText, NamesEachDimensionAndItsSiUnitParsesBack) {
  for (int i = 0; i < static_cast<int>(Dimension::kNone); ++i) {
    const auto dimension = static_cast<Dimension>(i);
    EXPECT_FALSE(dimension_name(dimension).empty());
    if (dimension == Dimension::kShare) continue;  // a pure number has no unit text
    const auto unit = parse_unit(si_unit_text(dimension));
    ASSERT_TRUE(unit) << si_unit_text(dimension);
    EXPECT_EQ(unit->dimension, dimension);
    EXPECT_EQ(unit->factor, 1.0);
    EXPECT_EQ(unit->offset, 0.0);
  }
}

}  // namespace
}  // namespace beltgrip::can
