#include "can_dbc/log/text.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <string>

namespace beltgrip::can::log_text {

namespace {

constexpr std::size_t kStampLengthMax = 32;

// Exactly `digits` digits from the front.
std::optional<int> take_digits(std::string_view& text, std::size_t digits) {
  if (text.size() < digits) return std::nullopt;
  int value = 0;
  for (std::size_t i = 0; i < digits; ++i) {
    if (!is_digit(text[i])) return std::nullopt;
    value = value * 10 + (text[i] - '0');
  }
  text.remove_prefix(digits);
  return value;
}

// Days since 1970-01-01 of a date in the Gregorian calendar: years are counted from March, so that
// the leap day is the last of its year, in eras of 400 years = 146 097 days.
std::int64_t days_since_1970(int year, int month, int day) {
  const int from_march = month > 2 ? month - 3 : month + 9;
  const int march_year = month > 2 ? year : year - 1;
  const int era = (march_year >= 0 ? march_year : march_year - 399) / 400;
  const int year_of_era = march_year - era * 400;
  const int day_of_year = (153 * from_march + 2) / 5 + day - 1;
  const int day_of_era = year_of_era * 365 + year_of_era / 4 - year_of_era / 100 + day_of_year;
  constexpr std::int64_t kDaysTo1970 = 719468;
  return std::int64_t{era} * 146097 + day_of_era - kDaysTo1970;
}

}  // namespace

std::optional<std::uint32_t> whole_number(std::string_view word, int base) {
  std::uint32_t value = 0;
  const char* const begin = word.data();
  const char* const end = begin + word.size();
  const auto [rest, status] = std::from_chars(begin, end, value, base);
  if (status != std::errc{} || rest != end) return std::nullopt;
  return value;
}

bool take_hex_bytes(std::string_view& text, std::size_t count, std::uint8_t* bytes) noexcept {
  constexpr std::size_t kChars = 3;  // "0A "
  std::string_view rest = text;
  skip_blanks(rest);
  const std::size_t size = kChars * count - 1;
  if (count == 0 || count > kMaxPayload || rest.size() < size ||
      (rest.size() > size && !is_blank(rest[size]))) {
    return false;
  }
  std::array<std::uint8_t, kMaxPayload> read;
  const char* at = rest.data();
  int wrong = 0;  // negative with the first that is no digit
  for (std::size_t i = 0; i < count; ++i, at += kChars) {
    const int high = hex_value(at[0]);
    const int low = hex_value(at[1]);
    wrong |= high | low;
    read[i] = static_cast<std::uint8_t>(high << 4 | low);
    if (i + 1 < count && !is_blank(at[2])) return false;
  }
  if (wrong < 0) return false;
  std::copy_n(read.begin(), count, bytes);
  rest.remove_prefix(size);
  text = rest;
  return true;
}

std::optional<std::int64_t> any_time_ns(std::string_view word, std::int64_t unit_ns) {
  const bool negative = word.starts_with('-');
  if (negative) word.remove_prefix(1);
  std::int64_t whole = 0;
  const char* const end = word.data() + word.size();
  const char* at = word.data();
  constexpr std::int64_t kLargest = 900'000'000'000'000'000;  // with room for one more digit
  for (; at != end && is_digit(*at); ++at) {
    if (whole > kLargest / 10) return std::nullopt;
    whole = whole * 10 + (*at - '0');
  }
  if (at == word.data() || whole > INT64_MAX / unit_ns - 1) return std::nullopt;
  std::int64_t result = whole * unit_ns;
  if (at != end) {
    if (*at != '.' && *at != ',') return std::nullopt;
    ++at;
    for (std::int64_t unit = unit_ns / 10; at != end; ++at, unit /= 10) {
      if (!is_digit(*at)) return std::nullopt;
      result += (*at - '0') * unit;
    }
  }
  return negative ? -result : result;
}

std::optional<std::int64_t> date_ns(std::string_view text) {
  const auto separator = [&](std::string_view any_of) {
    if (text.empty() || any_of.find(text.front()) == std::string_view::npos) return false;
    text.remove_prefix(1);
    return true;
  };
  const auto year = take_digits(text, 4);
  if (!year || !separator("-/")) return std::nullopt;
  const auto month = take_digits(text, 2);
  if (!month || !separator("-/")) return std::nullopt;
  const auto day = take_digits(text, 2);
  if (!day || !separator(" T")) return std::nullopt;
  if (text.ends_with('Z')) text.remove_suffix(1);
  const auto since_midnight_ns = clock_ns(text);
  if (!since_midnight_ns || *month < 1 || *month > 12 || *day < 1 || *day > 31 || *year < 1700 ||
      *year > 2200) {
    return std::nullopt;
  }
  return days_since_1970(*year, *month, *day) * 24 * 3600 * kSecond_ns + *since_midnight_ns;
}

std::optional<std::int64_t> clock_ns(std::string_view text) {
  const auto hour = take_digits(text, 2);
  if (!hour || !text.starts_with(':')) return std::nullopt;
  text.remove_prefix(1);
  const auto minute = take_digits(text, 2);
  if (!minute || !text.starts_with(':')) return std::nullopt;
  text.remove_prefix(1);
  std::string seconds(text.substr(0, kStampLengthMax));
  std::replace(seconds.begin(), seconds.end(), ':', '.');
  const auto second_ns = time_ns(seconds);
  if (!second_ns || *second_ns < 0 || *second_ns > 61 * kSecond_ns || *hour > 24 || *minute > 59) {
    return std::nullopt;
  }
  return (std::int64_t{*hour} * 60 + *minute) * 60 * kSecond_ns + *second_ns;
}

}  // namespace beltgrip::can::log_text
