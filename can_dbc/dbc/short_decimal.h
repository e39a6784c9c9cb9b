// Numbers as DBC files have them, "8", "0.25": so few digits that a double has their number and
// their power of ten exactly. One division then rounds as reading the text does.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace beltgrip::can::dbc {

struct ShortDecimal {
  const char* end = nullptr;  // behind it; nullptr: another kind of number, or none
  double value = 0.0;
  std::uint64_t digits = 0;  // all of them as one number
  bool whole = false;        // without a fraction
};

// At most 15 digits, and at least one before a point and behind it. No sign, no exponent.
inline ShortDecimal read_short_decimal(const char* at, const char* end) noexcept {
  constexpr std::array<double, 16> kPowers{1e0, 1e1, 1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                           1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15};
  constexpr std::ptrdiff_t kDigitsMost = kPowers.size() - 1;
  ShortDecimal read;
  const auto take_digits = [&] {
    const char* const first = at;
    for (; at != end && *at >= '0' && *at <= '9'; ++at) {
      read.digits = read.digits * 10 + static_cast<std::uint64_t>(*at - '0');
    }
    return at - first;
  };
  const std::ptrdiff_t before = take_digits();
  std::ptrdiff_t behind = 0;
  read.whole = at == end || *at != '.';
  if (!read.whole) {
    ++at;
    behind = take_digits();
    if (behind == 0) return {};
  }
  if (before == 0 || before + behind > kDigitsMost) return {};
  if (at != end && ((*at | 0x20) == 'e' || (*at | 0x20) == 'x')) return {};
  read.value = static_cast<double>(read.digits);
  if (behind > 0) read.value /= kPowers[static_cast<std::size_t>(behind)];
  read.end = at;
  return read;
}

}  // namespace beltgrip::can::dbc
