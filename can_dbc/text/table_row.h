// A row of a table as text: its cells, and whether they can be told apart. No locale.
#pragma once

#include <cstddef>
#include <span>
#include <string_view>
#include <vector>

namespace beltgrip::can {

using Cells = std::vector<std::string_view>;

std::string_view bare_cell(std::string_view text);  // without blanks and quotes around it

// Bare cells; quotes may hold a separator.
void split_row(std::string_view line, char separator, Cells& cells);

// nullptr, or what is wrong with a row under `most` headings: with more cells, or with fewer than
// `least`, nobody knows which of them belong to which column. One that is empty and behind the last
// column is the separator that some programs end a line with.
const char* wrong_width(std::span<const std::string_view> cells, std::size_t least,
                        std::size_t most);

// The same of a table whose rows are looked at first: whether they end with a separator tells a
// cell too many from it, and one too few.
class RowWidth {
 public:
  explicit RowWidth(std::size_t columns = 0) : columns_(columns) {}
  void look(std::span<const std::string_view> cells);
  const char* wrong(std::span<const std::string_view> cells) const;

 private:
  std::size_t columns_;
  std::size_t plain_rows_ = 0, ended_rows_ = 0;  // with so many cells, with an empty one more
};

}  // namespace beltgrip::can
