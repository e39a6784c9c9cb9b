// Rows of a table: the cells, and how many there may be.
#include "can_dbc/text/table_row.h"

#include <gtest/gtest.h>

#include <string>

namespace beltgrip::can {
namespace {

Cells cells_of(std::string_view line, char separator = ',') {
  Cells cells;
  split_row(line, separator, cells);
  return cells;
}

std::string wrong(std::string_view line, std::size_t least, std::size_t most) {
  const char* const reason = wrong_width(cells_of(line), least, most);
  return reason == nullptr ? "" : reason;
}

TEST(TableRow, CellsAreBareAndQuotesMayHoldASeparator) {
  EXPECT_EQ(cells_of("1, \"a, b\" ,,2\r"), (Cells{"1", "a, b", "", "2"}));
  EXPECT_EQ(cells_of("1;2,5", ';'), (Cells{"1", "2,5"}));
  EXPECT_EQ(cells_of(""), (Cells{""}));
}

constexpr const char* kFewer = "fewer cells than the header has; expected one for each column";
constexpr const char* kMore = "more cells than the header has; expected decimal points";

TEST(TableRow, AnotherNumberOfCellsThanTheHeaderHasIsWrong) {
  EXPECT_EQ(wrong("1,2,3", 3, 3), "");
  EXPECT_EQ(wrong("1,2", 3, 3), kFewer);
  EXPECT_EQ(wrong("1,2,", 3, 3), "") << "empty, but there";
  EXPECT_EQ(wrong("1,2", 2, 3), "") << "the last may be left out";
  EXPECT_EQ(wrong("1,2,3,4", 3, 3), kMore);
  EXPECT_EQ(wrong("1,2,3, ", 3, 3), "") << "a separator that ends the line";
  EXPECT_EQ(wrong("1,2,3,,", 3, 3), kMore);
}

// By the rows of the table, under three headings.
std::string wrong(std::string_view line, std::initializer_list<std::string_view> rows) {
  RowWidth width(3);
  for (const std::string_view row : rows) width.look(cells_of(row));
  const char* const reason = width.wrong(cells_of(line));
  return reason == nullptr ? "" : reason;
}

TEST(TableRow, WhetherRowsEndWithASeparatorTellsACellTooManyOrTooFew) {
  EXPECT_EQ(wrong("1,5,2,", {"1,2,3", "4,5,6"}), kMore);
  EXPECT_EQ(wrong("1,2,", {"1,2,3", "4,5,6"}), "");
  EXPECT_EQ(wrong("1,2,3,", {"1,2,3,", "4,5,6,"}), "");
  EXPECT_EQ(wrong("1,2,", {"1,2,3,", "4,5,6,"}), kFewer);
  EXPECT_EQ(wrong("1,2,3", {"1,2,3,", "4,5,6,"}), "") << "only the end is not there";
  EXPECT_EQ(wrong("1,2", {"1,2,3,", "4,5,6,"}), kFewer);
  EXPECT_EQ(wrong("1,2,3,", {"1,2,3,", "4,5,6"}), "") << "nobody knows";
}

}  // namespace
}  // namespace beltgrip::can
