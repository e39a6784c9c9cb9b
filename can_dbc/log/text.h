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

constexpr std::array<bool, 256> blanks() {
  std::array<bool, 256> table{};
  table[' '] = table['\t'] = table['\r'] = table['\0'] = true;
  return table;
}
inline constexpr std::array<bool, 256> kBlanks = blanks();

constexpr bool is_blank(char c) { return kBlanks[static_cast<unsigned char>(c)]; }
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
std::optional<std::uint32_t> whole_number(std::string_view word, int base);

inline std::optional<std::uint32_t> hexadecimal(std::string_view word) {
  constexpr std::size_t kDigitsMost = 8;  // 32 bits
  if (word.empty() || word.size() > kDigitsMost) return whole_number(word, 16);
  std::uint32_t value = 0;
  int wrong = 0;  // negative with the first character that is no digit
  for (const char c : word) {
    const int digit = hex_value(c);
    wrong |= digit;
    value = value << 4 | static_cast<std::uint32_t>(digit & 0xF);
  }
  return wrong < 0 ? std::nullopt : std::optional(value);
}

inline std::optional<std::uint32_t> decimal(std::string_view word) {
  constexpr std::size_t kDigitsMost = 9;  // below 32 bits
  if (word.empty() || word.size() > kDigitsMost) return whole_number(word, 10);
  std::uint32_t value = 0;
  for (const char c : word) {
    if (!is_digit(c)) return std::nullopt;
    value = value * 10 + static_cast<std::uint32_t>(c - '0');
  }
  return value;
}

// "64 00 0A ...": `count` bytes, at least one, of two hexadecimal digits, one blank between them
// and a blank or the end behind the last. False, and nothing is taken, where it looks otherwise.
bool take_hex_bytes(std::string_view& text, std::size_t count, std::uint8_t* bytes) noexcept;
inline std::optional<std::uint32_t> in_base(std::string_view word, int base) {
  return base == 16 ? hexadecimal(word) : decimal(word);
}

inline constexpr std::array<std::int64_t, 10> kPowersOfTen{
    1, 10, 100, 1'000, 10'000, 100'000, 1'000'000, 10'000'000, 100'000'000, 1'000'000'000};

// Places behind the point of a time in these units, down to the nanosecond; -1: another unit.
constexpr int places_of(std::int64_t unit_ns) {
  for (const int places : {9, 6, 3, 0}) {
    if (unit_ns == kPowersOfTen[static_cast<std::size_t>(places)]) return places;
  }
  return -1;
}

// "12.345678" with so few digits that no sum of them can be too large; nothing: any other.
inline std::optional<std::int64_t> short_time_ns(std::string_view word, std::int64_t unit_ns) {
  constexpr std::size_t kLongest = 18;  // digits of an int64_t, whatever they are
  constexpr std::int64_t kWholeMost = INT64_MAX / 1'000'000'000 - 1;
  const int unit_places = places_of(unit_ns);
  if (word.size() > kLongest || unit_places < 0) return std::nullopt;
  const char* at = word.data();
  const char* const end = at + word.size();
  std::int64_t whole = 0;
  for (; at != end && is_digit(*at); ++at) whole = whole * 10 + (*at - '0');
  if (at == word.data() || whole > kWholeMost) return std::nullopt;
  if (at == end) return whole * unit_ns;
  if (*at != '.') return std::nullopt;
  const char* const first = ++at;
  std::int64_t fraction = 0;
  for (; at != end && is_digit(*at); ++at) fraction = fraction * 10 + (*at - '0');
  const std::ptrdiff_t left = unit_places - (at - first);
  if (at != end || left < 0) return std::nullopt;
  return whole * unit_ns + fraction * kPowersOfTen[static_cast<std::size_t>(left)];
}

// "-12.345" or "12,345" of a unit of `unit_ns` nanoseconds, exactly; digits beyond the nanosecond
// are cut.
std::optional<std::int64_t> any_time_ns(std::string_view word, std::int64_t unit_ns);
inline std::optional<std::int64_t> time_ns(std::string_view word,
                                           std::int64_t unit_ns = 1'000'000'000) {
  const auto quick_ns = short_time_ns(word, unit_ns);
  return quick_ns ? quick_ns : any_time_ns(word, unit_ns);
}
// "2020-09-12 10:20:30.123456" with a blank or T, read as universal time.
std::optional<std::int64_t> date_ns(std::string_view text);

// "10:20:30.5" or "10:20:30:5000": the time since midnight.
std::optional<std::int64_t> clock_ns(std::string_view text);

// The number of payload bytes that a CAN FD data length code 0..15 stands for.
inline constexpr std::array<std::uint8_t, 16> kFdLengths{0, 1,  2,  3,  4,  5,  6,  7,
                                                         8, 12, 16, 20, 24, 32, 48, 64};

}  // namespace beltgrip::can::log_text
