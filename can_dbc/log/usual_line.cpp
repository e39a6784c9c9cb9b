#include "can_dbc/log/usual_line.h"

#include <bit>
#include <cassert>
#include <cstdint>
#include <cstring>

#include "can_dbc/log/text.h"

namespace beltgrip::can {

static_assert(std::endian::native == std::endian::little, "the first character is the lowest byte");

namespace {

using log_text::is_digit;

constexpr int kChars = 8;  // in a word
constexpr std::uint64_t kAll = ~std::uint64_t{0};

// That byte in all eight places.
constexpr std::uint64_t each(std::uint64_t byte) { return byte * 0x0101'0101'0101'0101U; }

std::uint64_t load(const char* text) noexcept {
  std::uint64_t word = 0;
  std::memcpy(&word, text, sizeof word);
  return word;
}

// The top bit of every byte that is not of a kind, all other bits zero. A sum carries into the top
// bit of its byte and no further, for its own top bit is taken off before.
std::uint64_t no_digits(std::uint64_t word) noexcept {
  const std::uint64_t digit = word ^ each('0');  // 0 to 9
  return (((digit & each(0x7F)) + each(0x80 - 10)) | digit) & each(0x80);
}
std::uint64_t no_hex_digits(std::uint64_t word) noexcept {
  const std::uint64_t letter = (word | each(0x20)) ^ each(0x60);  // 1 to 6 of a to f, A to F
  const std::uint64_t low = letter & each(0x7F);
  const std::uint64_t no_letters = (low + each(0x80 - 7)) | ~(low + each(0x80 - 1)) | letter;
  return no_digits(word) & no_letters;
}
std::uint64_t no_words(std::uint64_t word) noexcept {  // blanks, what steers, and what is not ASCII
  return (~((word & each(0x7F)) + each(0x80 - 0x21)) | word) & each(0x80);
}
// How many bytes stand before the first that is marked.
int before(std::uint64_t marks) noexcept { return std::countr_zero(marks) / kChars; }

// All bits of the first `count` bytes.
std::uint64_t first(int count) noexcept {
  return count == kChars ? kAll : (std::uint64_t{1} << (kChars * count)) - 1;
}

// Of the first `count` characters, 1 to 8, all of them digits.
std::uint64_t decimal(std::uint64_t word, int count) noexcept {
  // Zeros in front make them eight; then pairs, fours and all eight are put together.
  const int missing = kChars * (kChars - count);
  std::uint64_t digits = ((word & first(count)) ^ (each('0') & first(count))) << missing;
  digits = digits * 10 + (digits >> 8);
  constexpr std::uint64_t kPairs = 0x0000'00FF'0000'00FFU;
  constexpr std::uint64_t kFirst = 100 + (std::uint64_t{1'000'000} << 32);
  constexpr std::uint64_t kSecond = 1 + (std::uint64_t{10'000} << 32);
  return ((digits & kPairs) * kFirst + ((digits >> 16) & kPairs) * kSecond) >> 32;
}

// What each of eight hexadecimal digits stands for.
std::uint64_t nibbles(std::uint64_t word) noexcept {
  return (word & each(0x0F)) + 9 * ((word >> 6) & each(0x01));
}
// Eight of them as four bytes, the first lowest.
std::uint32_t four_bytes(std::uint64_t nibbles) noexcept {
  std::uint64_t bytes = (nibbles << 4 | nibbles >> 8) & 0x00FF'00FF'00FF'00FFU;
  bytes = (bytes | bytes >> 8) & 0x0000'FFFF'0000'FFFFU;
  return static_cast<std::uint32_t>(bytes | bytes >> 16);
}

// "(1700000000.123456) ": behind it, or nullptr.
const char* read_stamp(const char* at, std::int64_t& t_ns) noexcept {
  if (*at != '(') return nullptr;
  ++at;
  const std::uint64_t word = load(at);
  const std::uint64_t ends = no_digits(word);
  const int count = ends == 0 ? kChars : before(ends);
  if (count == 0) return nullptr;
  std::uint64_t whole_s = decimal(word, count);
  at += count;
  constexpr int kMore = 2;  // ten digits are enough for 200 years
  if (count == kChars) {
    for (int i = 0; i < kMore && is_digit(*at); ++i) {
      whole_s = whole_s * 10 + static_cast<std::uint64_t>(*at++ - '0');
    }
  }
  constexpr std::uint64_t kSecond_ns = 1'000'000'000;
  constexpr std::uint64_t kLongest_s = INT64_MAX / kSecond_ns - 2;
  if (*at != '.' || whole_s > kLongest_s) return nullptr;
  ++at;
  const std::uint64_t fraction = load(at);
  const std::uint64_t fraction_ends = no_digits(fraction);
  std::uint64_t fraction_ns = 0;
  if (fraction_ends != 0) {
    constexpr int kMicroseconds = 6;
    if (before(fraction_ends) != kMicroseconds) return nullptr;
    fraction_ns = decimal(fraction, kMicroseconds) * 1000;
    at += kMicroseconds;
  } else {
    if (!is_digit(at[kChars])) return nullptr;
    fraction_ns = decimal(fraction, kChars) * 10 + static_cast<std::uint64_t>(at[kChars] - '0');
    at += kChars + 1;
  }
  if (at[0] != ')' || at[1] != ' ') return nullptr;
  t_ns = static_cast<std::int64_t>(whole_s * kSecond_ns + fraction_ns);
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
