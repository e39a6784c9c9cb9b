// Small readers of numbers and words that the log formats share. Each takes what it reads from the
// front of the text. No locale, no allocation.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "can_dbc/frame/can_frame.h"

namespace beltgrip::can::log_text {

constexpr bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\0'; }
constexpr bool is_digit(char c) { return c >= '0' && c <= '9'; }

inline void skip_blanks(std::string_view& text) {
  std::size_t count = 0;
  while (count < text.size() && is_blank(text[count])) ++count;
  text.remove_prefix(count);
}

inline void trim_end(std::string_view& text) {
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
}

// The next word; blanks before it are skipped. Empty at the end.
inline std::string_view take_word(std::string_view& text) {
  skip_blanks(text);
  std::size_t count = 0;
  while (count < text.size() && !is_blank(text[count])) ++count;
  const std::string_view word = text.substr(0, count);
  text.remove_prefix(count);
  return word;
}

constexpr std::array<std::int8_t, 256> hex_values() {
  std::array<std::int8_t, 256> table{};
  for (auto& value : table) value = -1;
  for (std::size_t i = 0; i < 10; ++i) table['0' + i] = static_cast<std::int8_t>(i);
  for (std::size_t i = 0; i < 6; ++i) {
    table['a' + i] = table['A' + i] = static_cast<std::int8_t>(10 + i);
  }
  return table;
}
inline constexpr std::array<std::int8_t, 256> kHexValues = hex_values();

// -1 unless it is a hexadecimal digit.
inline int hex_value(char c) { return kHexValues[static_cast<unsigned char>(c)]; }

// The whole word as a number; nothing if it is none or has more than 32 bits.
std::optional<std::uint32_t> hexadecimal(std::string_view word);
std::optional<std::uint32_t> decimal(std::string_view word);
inline std::optional<std::uint32_t> in_base(std::string_view word, int base) {
  return base == 16 ? hexadecimal(word) : decimal(word);
}

// "-12.345" or "12,345" of a unit of `unit_ns` nanoseconds, exactly; digits beyond the nanosecond
// are cut.
std::optional<std::int64_t> time_ns(std::string_view word, std::int64_t unit_ns = 1'000'000'000);
// "2020-09-12 10:20:30.123456" with a blank or T, read as universal time.
std::optional<std::int64_t> date_ns(std::string_view text);

// "10:20:30.5" or "10:20:30:5000": the time since midnight.
std::optional<std::int64_t> clock_ns(std::string_view text);

// The number of payload bytes that a CAN FD data length code 0..15 stands for.
inline constexpr std::array<std::uint8_t, 16> kFdLengths{0, 1,  2,  3,  4,  5,  6,  7,
                                                         8, 12, 16, 20, 24, 32, 48, 64};

}  // namespace beltgrip::can::log_text
