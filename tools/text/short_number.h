// A double as the shortest text that reads back to it, byte for byte as std::to_chars writes it,
// and sooner where the number has few decimals, as what a signal stands for mostly has. Tools only.
#pragma once

#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>

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

// decimals: as many as the value is likely to have. Behind the text, for which there must be room
// for kNumberLongest characters.
inline char* write_short(char* out, double value, unsigned decimals) {
  const double magnitude = std::fabs(value);
  std::uint64_t digits = 0;
  if (decimals <= kDecimalsMost && magnitude >= kFixedLeast && magnitude < kFixedMost) {
    digits = digits_of(magnitude, decimals);
  }
  if (digits == 0) return std::to_chars(out, out + kNumberLongest, value).ptr;
  if (value < 0.0) *out++ = '-';
  // What is no whole number lies too far from one to have been rounded to it.
  const auto whole = static_cast<std::uint32_t>(magnitude);
  auto rest = static_cast<std::uint32_t>(digits - std::uint64_t{whole} * kPowersOfTen[decimals]);
  out = std::to_chars(out, out + kNumberLongest, whole).ptr;
  if (rest == 0) return out;
  for (; rest % 10 == 0; rest /= 10) --decimals;
  *out = '.';
  for (unsigned i = decimals; i > 0; --i, rest /= 10) out[i] = static_cast<char>('0' + rest % 10);
  return out + decimals + 1;
}

}  // namespace beltgrip::text
