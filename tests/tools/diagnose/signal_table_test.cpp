// CSV tables: roles, units, gaps, and what is refused with line and reason.
#include "tools/diagnose/data/signal_table.h"

#include <gtest/gtest.h>

namespace beltgrip::diagnose {
namespace {

std::string error_of(const std::string& text) {
  try {
    parse_csv(text, "a.csv");
  } catch (const TableError& error) {
    return error.text;
  }
  return "no error";
}

TEST(Csv, ReadsRolesInTheirUnits) {
  const SignalTable table = parse_csv(
      "t[s],primary_speed[rpm],oil_temperature[K],secondary_pressure[bar]\r\n"
      "10.0,3000,353.15,20\r\n10.5,,353.15,21\r\n11.0,3000,nan,22\r\n",
      "a.csv");
  ASSERT_EQ(table[Role::kPrimarySpeed].t_s.size(), 2U);
  EXPECT_NEAR(table[Role::kPrimarySpeed].value[0], 314.159265, 1e-6);
  EXPECT_DOUBLE_EQ(table[Role::kPrimarySpeed].t_s[1], 11.0);
  ASSERT_EQ(table[Role::kOilTemperature].value.size(), 2U);
  EXPECT_NEAR(table[Role::kOilTemperature].value[0], 80.0, 1e-9);
  EXPECT_DOUBLE_EQ(table[Role::kSecondaryPressure].value[2], 22e5);
  EXPECT_EQ(table.notes, std::vector<std::string>{"a.csv:4: 1 value that is not finite, left out"});
}

TEST(Csv, TakesSemicolonsTabsAndMarks) {
  EXPECT_EQ(parse_csv("\xEF\xBB\xBFt[s];primary_speed[rad/s]\n0;1\n1;2\n", "a")[Role::kPrimarySpeed]
                .value.size(),
            2U);
  EXPECT_EQ(parse_csv("# rig 3\nt[s]\tprimary_speed[rad/s]\n0\t1\n# pause\n1\t2\n",
                      "a")[Role::kPrimarySpeed]
                .value.size(),
            2U);
}

TEST(Csv, CountsWhatItLeavesOut) {
  const SignalTable table =
      parse_csv("t[s],primary_speed[rad/s],colour[]\n0,1,2\n1,x,2\n1,2,2\n0.5,3,2\n", "a.csv");
  EXPECT_EQ(table[Role::kPrimarySpeed].value.size(), 2U);
  ASSERT_EQ(table.notes.size(), 3U);
  EXPECT_EQ(table.notes[0], "a.csv:1: column 'colour[]' names no role, ignored");
  EXPECT_EQ(table.notes[1], "a.csv:3: 1 line that is not all numbers, ignored");
  EXPECT_EQ(table.notes[2], "a.csv:5: 1 line whose time does not increase, ignored");
}

// A decimal comma beside commas between the cells moves every value behind it by one.
TEST(Csv, ALineWithMoreCellsThanTheHeaderHasNoValues) {
  const SignalTable table = parse_csv("t[s],primary_speed[rad/s]\n0,1,\n1,2,5\n2,3\n", "a.csv");
  EXPECT_EQ(table[Role::kPrimarySpeed].value, (std::vector<double>{1.0, 3.0}));
  ASSERT_EQ(table.notes.size(), 1U);
  EXPECT_EQ(table.notes[0],
            "a.csv:3: 1 line with more cells than the header, ignored (decimal commas?)");
  EXPECT_EQ(error_of("t[s],primary_speed[rad/s]\n0,1,5\n1,2,5\n"),
            "a.csv:2: more cells than the header has; expected decimal points");
}

// It was cut, or a cell was lost in it.
TEST(Csv, ALineWithFewerCellsThanTheHeaderHasNoValues) {
  const SignalTable table =
      parse_csv("t[s],oil_temperature[K],primary_speed[rad/s]\n0,300,1\n1,2\n2,,3\n3,30", "a.csv");
  EXPECT_EQ(table[Role::kPrimarySpeed].value, (std::vector<double>{1.0, 3.0}));
  EXPECT_EQ(table[Role::kOilTemperature].value.size(), 1U);
  ASSERT_EQ(table.notes.size(), 1U);
  EXPECT_EQ(table.notes[0], "a.csv:3: 2 lines with fewer cells than the header, ignored");
  EXPECT_EQ(error_of("t[s],primary_speed[rad/s]\n0\n1\n"),
            "a.csv:2: fewer cells than the header has; expected one for each column");
}

TEST(Csv, ValuesThatAreNotFiniteAreLeftOutAndCounted) {
  const SignalTable table = parse_csv(
      "t[s],oil_temperature[K],primary_speed[rad/s]\n0,NaN,1\n1,300,inf\n2,,3\n3,301,4\n", "a.csv");
  EXPECT_EQ(table[Role::kPrimarySpeed].value, (std::vector<double>{1.0, 3.0, 4.0}));
  ASSERT_EQ(table.notes.size(), 1U);  // an empty cell is usual
  EXPECT_EQ(table.notes[0], "a.csv:2: 2 values that are not finite, left out");
}

TEST(Csv, DecimalCommasBetweenSemicolonsAreNamed) {
  EXPECT_EQ(error_of("t[s];primary_speed[rad/s]\n0,0;1,5\n0,1;1,6\n"),
            "a.csv:2: found decimal commas, expected decimal points");
  EXPECT_EQ(error_of("t[s];primary_speed[rad/s]\nx;y\nz;w\n"),
            "a.csv:2: no line with numbers after the header");
}

// A garbled time is ignored, as in a log; a clock that stays back was set.
TEST(Csv, ALineWhoseTimeLiesBackAloneSetsNoClock) {
  const std::string header = "t[s],primary_speed[rad/s]\n";
  const SignalTable alone = parse_csv(header + "20,1\n20.1,2\n2,3\n1,4\n20.2,5\n20.3,6\n", "a.csv");
  EXPECT_EQ(alone[Role::kPrimarySpeed].value, (std::vector<double>{1.0, 2.0, 5.0, 6.0}));
  EXPECT_DOUBLE_EQ(alone[Role::kPrimarySpeed].t_s.back(), 20.3);
  ASSERT_EQ(alone.notes.size(), 1U);
  EXPECT_EQ(alone.notes[0], "a.csv:4: 2 lines whose time does not increase, ignored");
  const SignalTable set = parse_csv(header + "20,1\n21,2\n16,3\n17,4\n18,5\n19,6\n", "a.csv");
  EXPECT_EQ(set[Role::kPrimarySpeed].value.size(), 6U);
  ASSERT_EQ(set.notes.size(), 1U);
  EXPECT_EQ(set.notes[0], "a.csv:4: 1 time the clock was set back: a new stretch begins");
}

TEST(Csv, AShareHasTheUnitOneOrPercent) {
  const SignalTable table =
      parse_csv("t[s],accelerator_pedal[1],primary_speed[rad/s]\n0,0.5,1\n", "a.csv");
  EXPECT_EQ(table[Role::kAcceleratorPedal].value.at(0), 0.5);
  EXPECT_EQ(
      parse_csv("t[s],accelerator_pedal[%]\n0,50\n", "a.csv")[Role::kAcceleratorPedal].value.at(0),
      0.5);
  EXPECT_EQ(error_of("t[s],primary_speed[1]\n0,1\n"),
            "a.csv:1: column 'primary_speed[1]': expected a unit of angular speed, e.g. "
            "primary_speed[rad/s]");
}

TEST(Csv, RefusesWithLineAndReason) {
  EXPECT_EQ(error_of("t[s],primary_speed[bar]\n0,1\n"),
            "a.csv:1: column 'primary_speed[bar]': expected a unit of angular speed, e.g. "
            "primary_speed[rad/s]");
  EXPECT_EQ(error_of("t[s],primary_speed\n0,1\n"),
            "a.csv:1: column 'primary_speed': expected a unit of angular speed, e.g. "
            "primary_speed[rad/s]");
  EXPECT_EQ(error_of("primary_speed[rad/s]\n1\n"),
            "a.csv:1: no column t[s]; expected a header such as t[s],primary_speed[rad/s],...");
  EXPECT_EQ(error_of("t[s],primary_speed[rad/s]\n"),
            "a.csv:1: no line with numbers after the header");
  EXPECT_EQ(error_of("t[s],primary_speed[rad/s],primary_speed[rpm]\n0,1,2\n"),
            "a.csv:1: role 'primary_speed' stands twice");
  EXPECT_EQ(error_of(""),
            "a.csv:0: no column t[s]; expected a header such as "
            "t[s],primary_speed[rad/s],...");
}

TEST(Csv, MissingFileIsNamed) {
  try {
    read_csv("/nowhere/a.csv");
    FAIL();
  } catch (const TableError& error) {
    EXPECT_TRUE(error.missing_file);
    EXPECT_EQ(error.text, "/nowhere/a.csv: cannot be opened");
  }
}

}  // namespace
}  // namespace beltgrip::diagnose
