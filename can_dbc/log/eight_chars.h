// Text eight characters at a time, as one number whose lowest byte is the first of them: what kinds
// of characters they are, and what digits say.
#pragma once

#include <bit>
#include <cstdint>
#include <cstring>

namespace beltgrip::can::eight_chars {

static_assert(std::endian::native == std::endian::little, "the first character is the lowest byte");

inline constexpr int kChars = 8;  // in a word
inline constexpr std::uint64_t kAll = ~std::uint64_t{0};

// That byte in all eight places.
constexpr std::uint64_t each(std::uint64_t byte) { return byte * 0x0101'0101'0101'0101U; }

inline std::uint64_t load(const char* text) noexcept {
  std::uint64_t word = 0;
  std::memcpy(&word, text, sizeof word);
  return word;
}

// The top bit of every byte that is not of a kind, all other bits zero. A sum carries into the top
// bit of its byte and no further, for its own top bit is taken off before.
inline std::uint64_t no_digits(std::uint64_t word) noexcept {
  const std::uint64_t digit = word ^ each('0');  // 0 to 9
  return (((digit & each(0x7F)) + each(0x80 - 10)) | digit) & each(0x80);
}
inline std::uint64_t no_hex_digits(std::uint64_t word) noexcept {
  const std::uint64_t letter = (word | each(0x20)) ^ each(0x60);  // 1 to 6 of a to f, A to F
  const std::uint64_t low = letter & each(0x7F);
  const std::uint64_t no_letters = (low + each(0x80 - 7)) | ~(low + each(0x80 - 1)) | letter;
  return no_digits(word) & no_letters;
}
inline std::uint64_t no_words(std::uint64_t word) noexcept {  // blanks, control, not ASCII
  return (~((word & each(0x7F)) + each(0x80 - 0x21)) | word) & each(0x80);
}
inline std::uint64_t controls(std::uint64_t word) noexcept {  // the line break among them
  return ~((word & each(0x7F)) + each(0x80 - 0x20)) & ~word & each(0x80);
}
// How many bytes stand before the first that is marked.
inline int before(std::uint64_t marks) noexcept { return std::countr_zero(marks) / kChars; }

// All bits of the first `count` bytes.
inline std::uint64_t first(int count) noexcept {
  return count == kChars ? kAll : (std::uint64_t{1} << (kChars * count)) - 1;
}

// Of the first `count` characters, 1 to 8, all of them digits.
inline std::uint64_t decimal_of(std::uint64_t word, int count) noexcept {
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
inline std::uint64_t nibbles(std::uint64_t word) noexcept {
  return (word & each(0x0F)) + 9 * ((word >> 6) & each(0x01));
}
// Eight of them as four bytes, the first lowest.
inline std::uint32_t four_bytes(std::uint64_t nibbles) noexcept {
  std::uint64_t bytes = (nibbles << 4 | nibbles >> 8) & 0x00FF'00FF'00FF'00FFU;
  bytes = (bytes | bytes >> 8) & 0x0000'FFFF'0000'FFFFU;
  return static_cast<std::uint32_t>(bytes | bytes >> 16);
}

}  // namespace beltgrip::can::eight_chars
