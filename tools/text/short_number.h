// A double as the shortest text that reads back to it, byte for byte as std::to_chars writes it,
// and sooner where the number has few decimals, as what a signal stands for mostly has. Tools only.
#pragma once

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>

namespace beltgrip::text {

inline constexpr std::size_t kNumberLongest = 32;  // characters
inline constexpr unsigned kDecimalsMost = 6;
inline constexpr unsigned kNoDecimals = kDecimalsMost + 1;  // not known, or too many
inline constexpr std::array<std::uint32_t, kDecimalsMost + 1> kPowersOfTen{
    1, 10, 100, 1000, 10'000, 100'000, 1'000'000};

// Digits in units of the last decimal, if the value is what they make: at most 11 of them, so no
// shorter text and no other one of as many digits is the same double.
constexpr double kFixedLeast =
    1e-3;  // from here on and below the next no exponent makes it shorter
constexpr double kFixedMost = 1e5;
inline std::uint64_t digits_of(double magnitude, unsigned decimals) {
  const double power = kPowersOfTen[decimals];
  constexpr double kWholeFrom = 4503599627370496.0;  // 2^52: doubles above it are whole numbers
  const double digits = (magnitude * power + kWholeFrom) - kWholeFrom;
  return digits / power == magnitude ? static_cast<std::uint64_t>(digits) : 0;
}

// How many decimals the value has; kNoDecimals where it has more than kDecimalsMost.
inline unsigned decimals_of(double value) {
  const double magnitude = std::fabs(value);
  if (magnitude == 0.0) return 0;
  if (!(magnitude < kFixedMost)) return magnitude == std::trunc(magnitude) ? 0 : kNoDecimals;
  unsigned decimals = 0;
  while (decimals <= kDecimalsMost && digits_of(magnitude, decimals) == 0) ++decimals;
  return decimals;
}

// Three digits at once, 0 to 999.
struct ThreeDigits {
  std::array<char, 5> text{};      // with room behind, so that three of them stand from each on
  std::uint8_t zeros_before = 0;   // of a whole number: at most two
  std::uint8_t without_zeros = 0;  // of a fraction: how many are left without those at its end
  // How long a fraction is with its point that ends in these, as its first three or its second;
  // 0: not in these.
  std::uint8_t length_as_first = 0, length_as_second = 0;
};
constexpr std::array<ThreeDigits, 1000> all_three_digits() {
  std::array<ThreeDigits, 1000> table{};
  for (std::size_t i = 0; i < table.size(); ++i) {
    ThreeDigits& three = table[i];
    three.text = {static_cast<char>('0' + i / 100), static_cast<char>('0' + i / 10 % 10),
                  static_cast<char>('0' + i % 10), '0', '0'};
    three.zeros_before = i < 10 ? 2 : i < 100 ? 1 : 0;
    three.without_zeros = i % 10 != 0 ? 3 : i % 100 != 0 ? 2 : i != 0 ? 1 : 0;
    three.length_as_first = i == 0 ? 0 : static_cast<std::uint8_t>(1 + three.without_zeros);
    three.length_as_second = i == 0 ? 0 : static_cast<std::uint8_t>(4 + three.without_zeros);
  }
  return table;
}
inline constexpr std::array<ThreeDigits, 1000> kThreeDigits = all_three_digits();

// Always three characters from `from` on are written.
inline void write_three(char* out, const ThreeDigits& three, std::size_t from = 0) {
  std::memcpy(out, three.text.data() + from, 3);
}

// Below kFixedMost.
inline char* write_whole(char* out, std::uint32_t whole) {
  const bool thousands = whole >= 1000;
  const ThreeDigits& first = kThreeDigits[thousands ? whole / 1000 : whole];
  write_three(out, first, first.zeros_before);
  out += 3 - first.zeros_before;
  if (!thousands) return out;
  write_three(out, kThreeDigits[whole % 1000]);
  return out + 3;
}

// ".25" of 250,000 millionths, nothing of 0; seven characters are written. No branch: what comes is
// as good as drawn, and a processor that guesses wrong waits for longer than all of this takes.
inline char* write_fraction(char* out, std::uint32_t millionths) {
  const ThreeDigits& first = kThreeDigits[millionths / 1000];
  const ThreeDigits& second = kThreeDigits[millionths % 1000];
  *out = '.';
  write_three(out + 1, first);
  write_three(out + 4, second);
  return out + std::max(first.length_as_first, second.length_as_second);
}

// decimals: as many as the value is likely to have. Behind the text, for which there must be room
// for kNumberLongest characters.
inline char* write_short(char* out, double value, unsigned decimals) {
  const double magnitude = std::fabs(value);
  std::uint64_t digits = 0;
  if (decimals <= kDecimalsMost && magnitude >= kFixedLeast && magnitude < kFixedMost) {
    digits = digits_of(magnitude, decimals);
  }
  if (digits == 0) return std::to_chars(out, out + kNumberLongest, value).ptr;
  *out = '-';
  out += value < 0.0;
  // What is no whole number lies too far from one to have been rounded to it.
  const auto whole = static_cast<std::uint32_t>(magnitude);
  const auto rest =
      static_cast<std::uint32_t>(digits - std::uint64_t{whole} * kPowersOfTen[decimals]);
  out = write_whole(out, whole);
  if (decimals == 0) return out;
  return write_fraction(out, rest * kPowersOfTen[kDecimalsMost - decimals]);
}

}  // namespace beltgrip::text
