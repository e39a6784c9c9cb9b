// The lines of a table of signals: comment lines begin with "#", cells are parted by comma,
// semicolon or tab. Tools only.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "can_dbc/log/byte_source.h"

namespace beltgrip::table {

// One line after the other, unpacked on the way.
class Lines {
 public:
  // Throws can::LogOpenError.
  explicit Lines(const std::string& path);
  // The next line that is neither empty nor a comment; nothing at the end.
  std::optional<std::string_view> next();
  std::uint64_t number() const { return number_; }  // of that line, from 1

 private:
  std::unique_ptr<can::ByteSource> source_;
  std::string buffer_;
  std::size_t at_ = 0;
  std::uint64_t number_ = 0;
  bool ended_ = false;
};

// The whole cell as a number; with the separator ';' a comma may stand for the point.
std::optional<double> number_of(std::string_view cell, char separator);
// Digits behind the point; nothing of a number that is written with an exponent.
std::optional<int> decimals_of(std::string_view cell, char separator);
bool is_missing(std::string_view cell);  // "", "-", "NaN", "n/a"

std::string lower(std::string_view text);

}  // namespace beltgrip::table
