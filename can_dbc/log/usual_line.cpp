#include "can_dbc/log/usual_line.h"

#include <cassert>
#include <cstdint>
#include <cstring>

#include "can_dbc/log/eight_chars.h"
#include "can_dbc/log/text.h"

namespace beltgrip::can {

namespace {

using log_text::is_digit;

using namespace eight_chars;

// "(1700000000.123456) ": behind it, or nullptr.
const char* read_stamp(const char* at, std::int64_t& t_ns) noexcept {
  if (*at != '(') return nullptr;
  ++at;
  const std::uint64_t word = load(at);
  const std::uint64_t ends = no_digits(word);
  const int count = ends == 0 ? kChars : before(ends);
  if (count == 0) return nullptr;
  std::uint64_t whole_s = decimal_of(word, count);
  at += count;
  constexpr int kMore = 2;  // ten digits are enough for 200 years
  if (count == kChars) {
    for (int i = 0; i < kMore && is_digit(*at); ++i) {
      whole_s = whole_s * 10 + static_cast<std::uint64_t>(*at++ - '0');
    }
  }
  constexpr std::uint64_t kLongest_s = INT64_MAX / kSecond_ns - 2;
  if (*at != '.' || whole_s > kLongest_s) return nullptr;
  ++at;
  const std::uint64_t fraction = load(at);
  const std::uint64_t fraction_ends = no_digits(fraction);
  std::uint64_t fraction_ns = 0;
  if (fraction_ends != 0) {
    constexpr int kMicroseconds = 6;
    if (before(fraction_ends) != kMicroseconds) return nullptr;
    fraction_ns = decimal_of(fraction, kMicroseconds) * 1000;
    at += kMicroseconds;
  } else {
    if (!is_digit(at[kChars])) return nullptr;
    fraction_ns = decimal_of(fraction, kChars) * 10 + static_cast<std::uint64_t>(at[kChars] - '0');
    at += kChars + 1;
  }
  if (at[0] != ')' || at[1] != ' ') return nullptr;
  t_ns = static_cast<std::int64_t>(whole_s) * kSecond_ns + static_cast<std::int64_t>(fraction_ns);
  return at + 2;
}

// "123#" or "12345678#": behind it, or nullptr.
const char* read_id(const char* at, CanId& id) noexcept {
  constexpr int kStandard = 3;
  const std::uint64_t word = load(at);
  const std::uint64_t ends = no_hex_digits(word);
  if (ends == 0) {
    if (at[kChars] != '#') return nullptr;
    const std::uint32_t value = __builtin_bswap32(four_bytes(nibbles(word)));
    id = {value, true};
    return value <= kExtendedIdMax ? at + kChars + 1 : nullptr;
  }
  if (before(ends) != kStandard || at[kStandard] != '#') return nullptr;
  const auto digits = static_cast<std::uint32_t>(nibbles(word & first(kStandard)));
  id = {(digits & 0xFU) << 8 | (digits >> 4 & 0xF0U) | digits >> 16, false};
  return id.value <= kStandardIdMax ? at + kStandard + 1 : nullptr;
}

}  // namespace

const char* read_usual_line(std::string_view text, LogRecord& record) noexcept {
  assert(text.size() >= kUsualLineMost);
  std::int64_t t_ns = 0;
  const char* const interface = read_stamp(&text.front(), t_ns);
  if (interface == nullptr) return nullptr;
  const std::uint64_t ends = no_words(load(interface));
  const int length = ends == 0 ? 0 : before(ends);
  if (length == 0 || interface[length] != ' ') return nullptr;
  CanId id;
  const char* const data = read_id(interface + length + 1, id);
  if (data == nullptr) return nullptr;

  const std::uint64_t low = load(data);
  const std::uint64_t low_ends = no_hex_digits(low);
  std::uint64_t high = 0;
  int digits = 0;
  if (low_ends != 0) {
    digits = before(low_ends);
  } else {
    high = load(data + kChars);
    const std::uint64_t high_ends = no_hex_digits(high);
    const int more = high_ends == 0 ? kChars : before(high_ends);
    digits = kChars + more;
    high = nibbles(high) & first(more);
  }
  if (data[digits] != '\n' || digits % 2 != 0) return nullptr;
  const std::uint64_t bytes = std::uint64_t{four_bytes(high)} << 32 |
                              four_bytes(nibbles(low) & first(digits < kChars ? digits : kChars));
  record.t_ns = t_ns;
  record.interface = {interface, static_cast<std::size_t>(length)};
  record.sent = false;
  record.frame = CanFrame{};
  record.frame.id = id;
  record.frame.length = static_cast<std::uint8_t>(digits / 2);
  std::memcpy(record.frame.data.data(), &bytes, sizeof bytes);
  return data + digits + 1;
}

}  // namespace beltgrip::can
