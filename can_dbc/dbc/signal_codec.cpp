#include "can_dbc/dbc/signal_codec.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>

namespace beltgrip::can {

static_assert(std::endian::native == std::endian::little, "words are loaded as little endian");

namespace {

constexpr std::size_t kWord = sizeof(std::uint64_t);

std::uint64_t load_little(const std::uint8_t* bytes) noexcept {
  std::uint64_t word;
  std::memcpy(&word, bytes, kWord);
  return word;
}

// IEEE 754 binary16. Every binary16 is a binary64, so the conversion is exact.
double half_to_double(std::uint16_t bits) noexcept {
  constexpr int kFractionBits = 10;
  constexpr unsigned kExponentMax = 31;
  const unsigned exponent = (bits >> kFractionBits) & kExponentMax;
  const unsigned fraction = bits & ((1U << kFractionBits) - 1U);
  const double sign = (bits & 0x8000U) != 0 ? -1.0 : 1.0;
  if (exponent == kExponentMax) {
    return fraction != 0 ? std::numeric_limits<double>::quiet_NaN()
                         : sign * std::numeric_limits<double>::infinity();
  }
  if (exponent == 0) return sign * std::ldexp(fraction, -24);
  return sign * std::ldexp(fraction + (1U << kFractionBits), static_cast<int>(exponent) - 25);
}

constexpr double kHalfMax = 65504.0;

// Nearest, ties to even. Precondition: |value| <= kHalfMax or infinite.
std::uint16_t double_to_half(double value) noexcept {
  const unsigned sign = std::signbit(value) ? 0x8000U : 0U;
  const double magnitude = std::fabs(value);
  if (std::isinf(magnitude)) return static_cast<std::uint16_t>(sign | 0x7C00U);
  int exponent = 0;
  std::frexp(magnitude, &exponent);
  // The unit in the last place; below 2^-14 it stays that of the denormal numbers. A carry out of
  // the fraction adds into the exponent, as it must.
  const int biased = magnitude == 0.0 ? 0 : std::max(exponent + 14, 0);
  const int ulp_exponent = std::max(biased, 1) - 25;
  auto digits = static_cast<unsigned>(std::nearbyint(std::ldexp(magnitude, -ulp_exponent)));
  if (biased > 0) digits += (static_cast<unsigned>(biased) - 1U) << 10;
  return static_cast<std::uint16_t>(sign | digits);
}

}  // namespace

SignalCodec::SignalCodec(const SignalDef& definition)
    : scale_(definition.scale), offset_(definition.offset), byte_order_(definition.byte_order) {
  constexpr std::uint32_t kLengthMax = 64;
  constexpr std::uint32_t kStartMax = 1U << 24;  // keeps the sums below inside 32 bits
  const std::uint32_t length = definition.length;
  if (length == 0 || length > kLengthMax || definition.start_bit >= kStartMax) return;

  first_byte_ = definition.start_bit / 8;
  const std::uint32_t bit = definition.start_bit % 8;
  // Bits of the first byte that the signal leaves out: below it (little endian) or above it (big).
  const std::uint32_t skipped = byte_order_ == ByteOrder::kLittle ? bit : 7 - bit;
  const std::uint32_t bytes = (skipped + length + 7) / 8;
  const std::uint32_t shift =
      byte_order_ == ByteOrder::kLittle ? skipped : bytes * 8 - skipped - length;
  byte_count_ = static_cast<std::uint8_t>(bytes);
  shift_ = static_cast<std::uint8_t>(shift);
  length_ = static_cast<std::uint8_t>(length);
  mask_ = ~std::uint64_t{0} >> (kLengthMax - length);

  switch (definition.type) {
    case ValueType::kUnsigned:
      kind_ = Kind::kUnsigned;
      break;
    case ValueType::kSigned:
      kind_ = Kind::kSigned;
      break;
    case ValueType::kFloat32:
    case ValueType::kFloat64:
      // The width says which float it is; a float of any other width is its bits as an integer.
      kind_ = length == 16   ? Kind::kFloat16
              : length == 32 ? Kind::kFloat32
              : length == 64 ? Kind::kFloat64
                             : Kind::kUnsigned;
      break;
  }
}

std::uint64_t SignalCodec::raw(std::span<const std::uint8_t> payload) const noexcept {
  assert(fits(payload.size()));
  const bool little = byte_order_ == ByteOrder::kLittle;
  std::uint64_t bits = 0;
  if (byte_count_ <= kWord && payload.size() >= kWord) {
    // One load of eight bytes that include the signal's.
    const std::size_t base = std::min<std::size_t>(first_byte_, payload.size() - kWord);
    const std::uint64_t word = load_little(payload.data() + base);
    const auto before = static_cast<unsigned>((first_byte_ - base) * 8);
    if (little) {
      bits = word >> (before + shift_);
    } else {
      const unsigned after = 64U - before - byte_count_ * 8U;
      bits = __builtin_bswap64(word) >> (after + shift_);
    }
  } else {
    // A ninth byte holds the bits that a word cannot: the top ones (little) or the low ones (big).
    const std::size_t in_word = std::min<std::size_t>(byte_count_, kWord);
    const std::uint8_t* bytes = payload.data() + first_byte_;
    for (std::size_t i = 0; i < in_word; ++i) {
      bits = (bits << 8) | bytes[little ? in_word - 1 - i : i];
    }
    if (byte_count_ <= kWord) {
      bits >>= shift_;
    } else if (little) {
      bits = (bits >> shift_) | (std::uint64_t{bytes[kWord]} << (64 - shift_));
    } else {
      bits = (bits << (8 - shift_)) | (bytes[kWord] >> shift_);
    }
  }
  bits &= mask_;
  if (kind_ == Kind::kSigned) {
    const std::uint64_t sign = std::uint64_t{1} << (length_ - 1);
    bits = (bits ^ sign) - sign;
  }
  return bits;
}

double SignalCodec::float_value(std::uint64_t raw_bits) const noexcept {
  switch (kind_) {
    case Kind::kFloat16:
      return half_to_double(static_cast<std::uint16_t>(raw_bits));
    case Kind::kFloat32:
      return static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(raw_bits)));
    default:
      return std::bit_cast<double>(raw_bits);
  }
}

std::uint64_t SignalCodec::float_bits(double value) const noexcept {
  const bool infinite = std::isinf(value);
  switch (kind_) {
    case Kind::kFloat16:
      return double_to_half(infinite ? value : std::clamp(value, -kHalfMax, kHalfMax));
    case Kind::kFloat32: {
      constexpr double kMax = static_cast<double>(std::numeric_limits<float>::max());
      const double inside = infinite ? value : std::clamp(value, -kMax, kMax);
      return std::bit_cast<std::uint32_t>(static_cast<float>(inside));
    }
    default:
      return std::bit_cast<std::uint64_t>(value);
  }
}

double SignalCodec::value_of(std::uint64_t raw_bits) const noexcept {
  if (is_float()) return float_value(raw_bits);
  if (kind_ == Kind::kSigned) return static_cast<double>(static_cast<std::int64_t>(raw_bits));
  return static_cast<double>(raw_bits);
}

double SignalCodec::physical(std::uint64_t raw_bits) const noexcept {
  const double scaled = value_of(raw_bits) * scale_;
  return scaled + offset_;
}

std::uint64_t SignalCodec::raw_from_physical(double value) const noexcept {
  if (std::isnan(value) || scale_ == 0.0) return 0;
  const double wanted = (value - offset_) / scale_;
  if (std::isnan(wanted)) return 0;  // infinite value, scale or offset
  if (is_float()) return float_bits(wanted);

  // The ends as integers, and as doubles that a wanted value is compared with before it is cast.
  const bool is_signed = kind_ == Kind::kSigned;
  const std::uint64_t lowest = is_signed ? ~(mask_ >> 1) : 0;
  const std::uint64_t highest = is_signed ? mask_ >> 1 : mask_;
  const double rounded = std::round(wanted);
  const auto as_double = [&](std::uint64_t raw_value) {
    return is_signed ? static_cast<double>(static_cast<std::int64_t>(raw_value))
                     : static_cast<double>(raw_value);
  };
  if (rounded <= as_double(lowest)) return lowest;
  if (rounded >= as_double(highest)) return highest;
  const std::uint64_t middle = is_signed
                                   ? static_cast<std::uint64_t>(static_cast<std::int64_t>(rounded))
                                   : static_cast<std::uint64_t>(rounded);
  // The division rounds too: of the neighbours, the one whose physical value is nearest.
  std::uint64_t best = middle;
  double best_distance = std::fabs(physical(middle) - value);
  for (const std::uint64_t neighbour : {middle - 1, middle + 1}) {
    const double distance = std::fabs(physical(neighbour) - value);
    if (distance < best_distance) {
      best = neighbour;
      best_distance = distance;
    }
  }
  return best;
}

void SignalCodec::insert(std::span<std::uint8_t> payload, std::uint64_t raw_bits) const noexcept {
  assert(fits(payload.size()));
  const std::uint64_t value = raw_bits & mask_;
  std::uint8_t* bytes = payload.data() + first_byte_;
  // Byte by byte from the least significant end; `below` counts the signal's bits already written.
  const bool little = byte_order_ == ByteOrder::kLittle;
  const auto put = [&](std::size_t index, std::uint64_t byte_value, std::uint64_t byte_mask) {
    std::uint8_t& byte = bytes[little ? index : byte_count_ - 1U - index];
    byte = static_cast<std::uint8_t>((byte & ~byte_mask) | (byte_value & byte_mask));
  };
  put(0, value << shift_, (mask_ << shift_) & 0xFFU);
  for (std::size_t index = 1; index < byte_count_; ++index) {
    const auto below = static_cast<unsigned>(index * 8 - shift_);
    put(index, value >> below, (mask_ >> below) & 0xFFU);
  }
}

bool SignalCodec::is_all_ones(std::uint64_t raw_bits) const noexcept {
  return !is_float() && length_ > 1 && (raw_bits & mask_) == mask_;
}

std::string SignalCodec::raw_text(std::uint64_t raw_bits) const {
  std::array<char, 32> text;
  char* const end = text.data() + text.size();
  std::to_chars_result result{};
  if (is_float()) {
    const double value = float_value(raw_bits);
    if (std::isnan(value)) return "nan";  // without the sign bit that some NaN carry
    result = std::to_chars(text.data(), end, value);
  } else if (kind_ == Kind::kSigned) {
    result = std::to_chars(text.data(), end, static_cast<std::int64_t>(raw_bits));
  } else {
    result = std::to_chars(text.data(), end, raw_bits);
  }
  return {text.data(), result.ptr};
}

}  // namespace beltgrip::can
