#include "tools/table/table_text.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include "can_dbc/text/table_row.h"

namespace beltgrip::table {

namespace {

constexpr std::size_t kBlock = std::size_t{64} * 1024;

// With a point; empty where that is the cell itself.
std::string with_point(std::string_view cell, char separator) {
  std::string text(cell);
  if (separator == ';') std::replace(text.begin(), text.end(), ',', '.');
  return text;
}

}  // namespace

Lines::Lines(const std::string& path) : source_(can::ByteSource::open(path)) {}

std::optional<std::string_view> Lines::next() {
  for (;;) {
    std::size_t end = buffer_.find('\n', at_);
    while (end == std::string::npos && !ended_) {
      buffer_.erase(0, at_);
      at_ = 0;
      const std::size_t had = buffer_.size();
      buffer_.resize(had + kBlock);
      const std::size_t got = source_->read({buffer_.data() + had, kBlock});
      buffer_.resize(had + got);
      ended_ = got == 0;
      end = buffer_.find('\n', had);
    }
    if (end == std::string::npos) {
      if (at_ >= buffer_.size()) return std::nullopt;
      end = buffer_.size();
    }
    std::string_view line(buffer_.data() + at_, end - at_);
    at_ = std::min(end + 1, buffer_.size());
    ++number_;
    if (number_ == 1 && line.starts_with("\xEF\xBB\xBF")) line.remove_prefix(3);
    const std::string_view bare = can::bare_cell(line);
    if (!bare.empty() && bare.front() != '#') return line;
  }
}

std::optional<double> number_of(std::string_view cell, char separator) {
  const std::string text = with_point(cell, separator);
  const char* begin = text.data() + (text.starts_with('+') ? 1 : 0);
  double value = 0.0;
  const auto [end, error] = std::from_chars(begin, text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || !std::isfinite(value)) return {};
  return value;
}

std::optional<int> decimals_of(std::string_view cell, char separator) {
  const std::string text = with_point(cell, separator);
  if (text.find_first_of("eE") != std::string::npos) return {};
  const std::size_t point = text.find('.');
  return point == std::string::npos ? 0 : static_cast<int>(text.size() - point - 1);
}

bool is_missing(std::string_view cell) {
  constexpr std::array<std::string_view, 7> kMissing{"", "-", "--", "nan", "n/a", "na", "null"};
  return std::find(kMissing.begin(), kMissing.end(), lower(cell)) != kMissing.end();
}

std::string lower(std::string_view text) {
  std::string out(text);
  for (char& c : out) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return out;
}

}  // namespace beltgrip::table
