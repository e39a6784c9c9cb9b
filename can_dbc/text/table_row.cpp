#include "can_dbc/text/table_row.h"

namespace beltgrip::can {

std::string_view bare_cell(std::string_view text) {
  constexpr std::string_view kBlank = " \t\r\"";
  const std::size_t first = text.find_first_not_of(kBlank);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlank) - first + 1);
}

void split_row(std::string_view line, char separator, Cells& cells) {
  cells.clear();
  for (;;) {
    std::size_t end = 0;
    bool quoted = false;
    while (end < line.size() && (quoted || line[end] != separator)) {
      quoted ^= line[end++] == '"';
    }
    cells.push_back(bare_cell(line.substr(0, end)));
    if (end == line.size()) return;
    line.remove_prefix(end + 1);
  }
}

namespace {

constexpr const char* kFewer = "fewer cells than the header has; expected one for each column";
constexpr const char* kMore = "more cells than the header has; expected decimal points";

// Behind the last column an empty cell.
bool is_ended(std::span<const std::string_view> cells, std::size_t columns) {
  return cells.size() == columns + 1 && cells.back().empty();
}

}  // namespace

const char* wrong_width(std::span<const std::string_view> cells, std::size_t least,
                        std::size_t most) {
  if (cells.size() < least) return kFewer;
  return cells.size() <= most || is_ended(cells, most) ? nullptr : kMore;
}

void RowWidth::look(std::span<const std::string_view> cells) {
  if (cells.size() == columns_) ++plain_rows_;
  if (is_ended(cells, columns_)) ++ended_rows_;
}

const char* RowWidth::wrong(std::span<const std::string_view> cells) const {
  if (const char* const wrong = wrong_width(cells, columns_, columns_)) return wrong;
  if (cells.size() > columns_) return plain_rows_ > ended_rows_ ? kMore : nullptr;
  return ended_rows_ > plain_rows_ && cells.back().empty() ? kFewer : nullptr;
}

}  // namespace beltgrip::can
