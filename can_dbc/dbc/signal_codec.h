// One signal compiled to masks and shifts at load. decode/encode are noexcept, allocation-free and
// never read outside the payload. Exact for every 64-bit raw value.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "can_dbc/dbc/model.h"

namespace beltgrip::can {

class SignalCodec {
 public:
  SignalCodec() = default;
  explicit SignalCodec(const SignalDef& definition);

  // True if every bit of the signal lies inside a payload of that many bytes. Never for a signal of
  // no bits or more than 64.
  bool fits(std::size_t payload_bytes) const noexcept {
    return byte_count_ != 0 && first_byte_ + byte_count_ <= payload_bytes;
  }
  // Raw bits, sign-extended to 64 for signed signals. Precondition: fits(payload.size()).
  std::uint64_t raw(std::span<const std::uint8_t> payload) const noexcept;
  // raw -> scale * value + offset, each operation rounded. NaN or infinity only for float signals.
  double physical(std::uint64_t raw_bits) const noexcept;
  double decode(std::span<const std::uint8_t> payload) const noexcept {
    return physical(raw(payload));
  }
  // Nearest raw value, saturated at what the signal's bits can hold; NaN gives the raw value 0.
  std::uint64_t raw_from_physical(double value) const noexcept;
  // Writes the signal's bits and no others. Precondition: fits(payload.size()).
  void insert(std::span<std::uint8_t> payload, std::uint64_t raw_bits) const noexcept;
  void encode(std::span<std::uint8_t> payload, double value) const noexcept {
    insert(payload, raw_from_physical(value));
  }
  // All bits one: the usual "signal not available". False for float signals and single bits.
  bool is_all_ones(std::uint64_t raw_bits) const noexcept;
  // "decimal text" of the raw value as integer (two's complement for signed), or of the float.
  std::string raw_text(std::uint64_t raw_bits) const;

  std::uint64_t mask() const noexcept { return mask_; }  // as many ones as the signal has bits
  bool is_float() const noexcept { return kind_ >= Kind::kFloat16; }
  // The number that the raw bits are, before scale and offset.
  double value_of(std::uint64_t raw_bits) const noexcept;

 private:
  enum class Kind : std::uint8_t { kUnsigned, kSigned, kFloat16, kFloat32, kFloat64 };

  double float_value(std::uint64_t raw_bits) const noexcept;
  std::uint64_t float_bits(double value) const noexcept;

  double scale_ = 1.0;
  double offset_ = 0.0;
  std::uint64_t mask_ = 0;        // length ones
  std::uint32_t first_byte_ = 0;  // lowest byte index touched
  std::uint8_t byte_count_ = 0;   // bytes touched, 1..9; 0: not a signal that can be decoded
  std::uint8_t shift_ = 0;        // bits below the signal in the touched bytes read as one number
  std::uint8_t length_ = 0;       // bits
  ByteOrder byte_order_ = ByteOrder::kLittle;
  Kind kind_ = Kind::kUnsigned;
};

}  // namespace beltgrip::can
