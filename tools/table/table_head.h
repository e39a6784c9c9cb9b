// What a table of signals is made of: its columns with their units and texts, its time, where its
// rows begin. The whole file is looked at once. Tools only.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "can_dbc/dbc/model.h"
#include "can_dbc/text/table_row.h"

namespace beltgrip::table {

struct Column {
  std::string name;                // without a unit in brackets
  std::string unit;                // of the brackets, or of the row of units
  std::uint64_t unit_line = 0;     // where that stands
  std::vector<std::string> texts;  // the values of a column without a number
  std::uint64_t numbers = 0;
  std::optional<int> decimals = 0;  // the most; none: written with an exponent
};

struct Head {
  char separator = ',';
  std::vector<Column> columns;
  std::optional<std::size_t> time;  // its column
  std::int64_t time_unit_ns = 1'000'000'000;
  bool time_unit_unknown = false;  // numbers of a unit that is none of time
  std::uint64_t first_row = 0;     // its line
  std::uint64_t rows = 0;
  can::RowWidth width;
};

// Nothing where the file is none, or frames stand in it. Throws can::LogOpenError.
std::optional<Head> read_head(const std::string& path);

// Every column but the time as a message with one signal of its name: a number to its decimals, a
// text by a value table in which "off", "no", "open" and the like are 0, their opposites 1.
can::Database database_of(const Head& head);

}  // namespace beltgrip::table
