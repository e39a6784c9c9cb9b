#include "can_dbc/dbc/signal_codec.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>
#include <random>

#include "naive_codec.h"
#include "tests/support/guarded_bytes.h"

namespace beltgrip::can {
namespace {

SignalDef make_signal(std::uint32_t start, std::uint32_t length, ByteOrder order,
                      ValueType type = ValueType::kUnsigned, double scale = 1.0,
                      double offset = 0.0) {
  SignalDef signal;
  signal.start_bit = start;
  signal.length = length;
  signal.byte_order = order;
  signal.type = type;
  signal.scale = scale;
  signal.offset = offset;
  return signal;
}

// Every start bit, length, byte order and sign in payloads of 1 to 9 bytes, against the bits picked
// one by one: fits, value read, value written, neighbours untouched.
TEST(SignalCodec, EqualsBitByBitReferenceForEveryPlaceAndLength) {
  std::mt19937_64 random(1);
  for (std::size_t bytes = 1; bytes <= 9; ++bytes) {
    std::vector<std::uint8_t> payload(bytes);
    for (std::uint32_t start = 0; start < bytes * 8; ++start) {
      for (std::uint32_t length = 1; length <= 64; ++length) {
        for (const ByteOrder order : {ByteOrder::kLittle, ByteOrder::kBig}) {
          for (const ValueType type : {ValueType::kUnsigned, ValueType::kSigned}) {
            const SignalDef signal = make_signal(start, length, order, type);
            const SignalCodec codec(signal);
            const bool fits = testing::naive_fits(signal, bytes);
            ASSERT_EQ(codec.fits(bytes), fits) << start << ' ' << length;
            if (!fits) continue;
            for (auto& byte : payload) byte = static_cast<std::uint8_t>(random());
            const std::uint64_t raw = testing::naive_raw(signal, payload);
            ASSERT_EQ(codec.raw(payload), raw) << start << '|' << length << " bytes " << bytes
                                               << " big " << (order == ByteOrder::kBig);

            std::vector<std::uint8_t> written(bytes, 0xA5);
            std::vector<std::uint8_t> wanted = written;
            const std::vector<std::uint32_t> bits = testing::naive_bits(signal);
            for (std::size_t i = 0; i < bits.size(); ++i) {
              const auto one = static_cast<std::uint8_t>(1U << (bits[i] % 8));
              auto& byte = wanted[bits[i] / 8];
              byte = static_cast<std::uint8_t>(((raw >> i) & 1) != 0 ? byte | one : byte & ~one);
            }
            codec.insert(written, raw);
            ASSERT_EQ(written, wanted) << start << '|' << length << " bytes " << bytes;
          }
        }
      }
    }
  }
}

TEST(SignalCodec, ReadsCanFdPayloadsToTheLastBit) {
  std::mt19937_64 random(2);
  for (int i = 0; i < 100'000; ++i) {
    const std::size_t bytes = 1 + random() % 64;
    std::vector<std::uint8_t> payload(bytes);
    for (auto& byte : payload) byte = static_cast<std::uint8_t>(random());
    const SignalDef signal =
        make_signal(static_cast<std::uint32_t>(random() % (bytes * 8)),
                    static_cast<std::uint32_t>(1 + random() % 64),
                    random() % 2 != 0 ? ByteOrder::kLittle : ByteOrder::kBig,
                    random() % 2 != 0 ? ValueType::kUnsigned : ValueType::kSigned);
    const SignalCodec codec(signal);
    ASSERT_EQ(codec.fits(bytes), testing::naive_fits(signal, bytes));
    if (codec.fits(bytes)) {
      ASSERT_EQ(codec.raw(payload), testing::naive_raw(signal, payload));
    }
  }
}

TEST(SignalCodec, NeverFitsWithoutBitsOrWithMoreThan64) {
  for (const std::uint32_t length : {0U, 65U, 512U, 4'000'000'000U}) {
    EXPECT_FALSE(SignalCodec(make_signal(0, length, ByteOrder::kLittle)).fits(64));
    EXPECT_FALSE(SignalCodec(make_signal(7, length, ByteOrder::kBig)).fits(64));
  }
  EXPECT_FALSE(SignalCodec(make_signal(4'294'967'295U, 1, ByteOrder::kLittle)).fits(64));
  EXPECT_FALSE(SignalCodec().fits(64));
  // The last place that is taken at all, and the first that is not: 2 MiB.
  EXPECT_TRUE(SignalCodec(make_signal((1U << 24) - 8, 8, ByteOrder::kLittle)).fits(1U << 21));
  EXPECT_FALSE(SignalCodec(make_signal(1U << 24, 8, ByteOrder::kLittle)).fits(1U << 22));
}

TEST(SignalCodec, ReadsAndWritesNothingBehindThePayload) {
  const beltgrip::testing::GuardedBytes guarded;
  for (const std::size_t bytes : {1U, 2U, 4U, 5U, 7U, 8U, 9U, 12U, 64U}) {
    const std::span<std::uint8_t> payload = guarded.last(bytes);
    for (std::uint32_t first = 0; first < bytes; ++first) {
      const SignalCodec codec(make_signal(8 * first, 8, ByteOrder::kLittle));
      codec.insert(payload, 0xA0U + first);
      EXPECT_EQ(codec.raw(payload), 0xA0U + first) << bytes;
    }
  }
}

TEST(SignalCodec, IsExactAtTheEndsOf64Bits) {
  const std::array<std::uint8_t, 8> ones{0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF};
  const SignalCodec plain(make_signal(0, 64, ByteOrder::kLittle));
  const SignalCodec negative(make_signal(7, 64, ByteOrder::kBig, ValueType::kSigned));
  EXPECT_EQ(plain.raw_text(plain.raw(ones)), "18446744073709551615");
  EXPECT_EQ(negative.raw_text(negative.raw(ones)), "-1");
  EXPECT_EQ(negative.decode(ones), -1.0);
  EXPECT_EQ(plain.decode(ones), std::ldexp(1.0, 64));
  EXPECT_EQ(negative.raw_from_physical(std::ldexp(1.0, 63)), 0x7FFF'FFFF'FFFF'FFFFU);
  EXPECT_EQ(plain.raw_from_physical(1e300), ~std::uint64_t{0});
  EXPECT_EQ(plain.raw_from_physical(-1.0), 0U);
  EXPECT_EQ(negative.raw_from_physical(1e300), 0x7FFF'FFFF'FFFF'FFFFU);
  EXPECT_EQ(negative.raw_from_physical(-1e300), 0x8000'0000'0000'0000U);
  EXPECT_EQ(plain.raw_from_physical(9007199254740993.0), 9007199254740992U);
  EXPECT_EQ(plain.raw_from_physical(std::numeric_limits<double>::infinity()), ~std::uint64_t{0});
  EXPECT_EQ(plain.raw_from_physical(std::numeric_limits<double>::quiet_NaN()), 0U);
}

TEST(SignalCodec, SaturatesAtWhatTheBitsHold) {
  const SignalCodec byte(make_signal(0, 8, ByteOrder::kLittle, ValueType::kUnsigned, 0.5, -10.0));
  EXPECT_EQ(byte.raw_from_physical(-11.0), 0U);
  EXPECT_EQ(byte.raw_from_physical(-10.0), 0U);
  EXPECT_EQ(byte.raw_from_physical(117.5), 255U);
  EXPECT_EQ(byte.raw_from_physical(118.0), 255U);
  EXPECT_EQ(byte.raw_from_physical(0.2), 20U);
  const SignalCodec nibble(make_signal(0, 4, ByteOrder::kLittle, ValueType::kSigned));
  EXPECT_EQ(static_cast<std::int64_t>(nibble.raw_from_physical(-9.0)), -8);
  EXPECT_EQ(static_cast<std::int64_t>(nibble.raw_from_physical(9.0)), 7);
  // 0.25 lies between 2 and 3; as a double 3 * 0.1 is a little more than 0.3, so 2 is nearer.
  const SignalCodec tenths(make_signal(0, 8, ByteOrder::kLittle, ValueType::kSigned, 0.1));
  EXPECT_EQ(tenths.raw_from_physical(0.25), 2U);
  EXPECT_EQ(static_cast<std::int64_t>(tenths.raw_from_physical(-0.25)), -2);
  const SignalCodec falling(make_signal(0, 8, ByteOrder::kLittle, ValueType::kUnsigned, -2.0, 3.0));
  EXPECT_EQ(falling.raw_from_physical(1.0), 1U);
  EXPECT_EQ(falling.raw_from_physical(100.0), 0U);
  EXPECT_EQ(falling.raw_from_physical(-1e9), 255U);
  const SignalCodec flat(make_signal(0, 8, ByteOrder::kLittle, ValueType::kUnsigned, 0.0, 3.0));
  EXPECT_EQ(flat.raw_from_physical(7.0), 0U);
  EXPECT_EQ(flat.physical(200), 3.0);
}

// Found by fuzzing: infinity minus infinity on the way to a half float.
TEST(SignalCodec, InfiniteScaleOrOffsetGivesTheRawValueZero) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (const std::uint32_t length : {8U, 16U, 32U, 64U}) {
    for (const ValueType type : {ValueType::kSigned, ValueType::kFloat32}) {
      EXPECT_EQ(SignalCodec(make_signal(0, length, ByteOrder::kLittle, type, 1.0, kInfinity))
                    .raw_from_physical(kInfinity),
                0U);
      EXPECT_EQ(SignalCodec(make_signal(0, length, ByteOrder::kLittle, type, kInfinity, 0.0))
                    .raw_from_physical(-kInfinity),
                0U);
    }
  }
}

TEST(SignalCodec, EncodeOfDecodeIsTheSameRawValue) {
  for (const double scale : {1.0, 0.1, 0.001, 1.0 / 3.0, -0.25, 3e7, 1e-9}) {
    for (const double offset : {0.0, -40.0, 0.3, 1e6}) {
      for (const ValueType type : {ValueType::kUnsigned, ValueType::kSigned}) {
        const SignalCodec codec(make_signal(0, 16, ByteOrder::kLittle, type, scale, offset));
        for (std::uint32_t i = 0; i < 65536; ++i) {
          const std::array<std::uint8_t, 2> payload{static_cast<std::uint8_t>(i),
                                                    static_cast<std::uint8_t>(i >> 8)};
          const std::uint64_t raw = codec.raw(payload);
          ASSERT_EQ(codec.raw_from_physical(codec.physical(raw)), raw) << scale << ' ' << offset;
        }
      }
    }
  }
}

TEST(SignalCodec, RoundsEachOperationOnItsOwn) {
  // 0.1 * 3 rounds up; a fused multiply-add would give -5.55e-17 here.
  const SignalCodec codec(make_signal(0, 8, ByteOrder::kLittle, ValueType::kUnsigned, 0.1, -0.3));
  EXPECT_EQ(codec.physical(3), 0.1 * 3.0 - 0.3);
  EXPECT_EQ(codec.physical(3), 5.551115123125783e-17);
}

TEST(SignalCodec, ReadsFloats) {
  const SignalCodec single(make_signal(0, 32, ByteOrder::kLittle, ValueType::kFloat32));
  EXPECT_EQ(single.decode(std::array<std::uint8_t, 4>{0x00, 0x00, 0xC0, 0x3F}), 1.5);
  EXPECT_EQ(single.raw_text(0x3FC00000), "1.5");
  EXPECT_EQ(single.raw_text(0xFFC00000), "nan");
  EXPECT_EQ(single.raw_text(0xFF800000), "-inf");
  EXPECT_TRUE(std::isnan(single.physical(0x7FC00000)));
  const SignalCodec twice(make_signal(7, 64, ByteOrder::kBig, ValueType::kFloat64, 2.0, 1.0));
  EXPECT_EQ(twice.decode(std::array<std::uint8_t, 8>{0x3F, 0xF8}), 4.0);
  EXPECT_EQ(twice.raw_from_physical(4.0), 0x3FF8'0000'0000'0000U);
  // Marked as a float by the file, 64 bits wide: a double whatever the mark says.
  const SignalCodec wide(make_signal(0, 64, ByteOrder::kLittle, ValueType::kFloat32));
  EXPECT_EQ(wide.physical(std::bit_cast<std::uint64_t>(0.1)), 0.1);
  // Of a width no float has: its bits.
  const SignalCodec odd(make_signal(0, 24, ByteOrder::kLittle, ValueType::kFloat32));
  EXPECT_FALSE(odd.is_float());
  EXPECT_EQ(odd.physical(77), 77.0);
}

TEST(SignalCodec, WritesFloatsAndSaturatesAtTheLargest) {
  const SignalCodec single(make_signal(0, 32, ByteOrder::kLittle, ValueType::kFloat32));
  EXPECT_EQ(single.raw_from_physical(0.1), std::bit_cast<std::uint32_t>(0.1F));
  EXPECT_EQ(single.raw_from_physical(1e300), 0x7F7FFFFFU);
  EXPECT_EQ(single.raw_from_physical(-std::numeric_limits<double>::infinity()), 0xFF800000U);
  EXPECT_EQ(single.raw_from_physical(std::numeric_limits<double>::quiet_NaN()), 0U);
}

TEST(SignalCodec, HalfFloatsReadAndWriteBackAllPatterns) {
  const SignalCodec half(make_signal(0, 16, ByteOrder::kLittle, ValueType::kFloat32));
  EXPECT_EQ(half.physical(0x3C00), 1.0);
  EXPECT_EQ(half.physical(0x0001), std::ldexp(1.0, -24));
  EXPECT_EQ(half.physical(0x03FF), std::ldexp(1023.0, -24));
  EXPECT_EQ(half.physical(0x0400), std::ldexp(1.0, -14));
  EXPECT_EQ(half.physical(0x7BFF), 65504.0);
  EXPECT_EQ(half.physical(0xC000), -2.0);
  for (std::uint32_t bits = 0; bits < 0x10000; ++bits) {
    const double value = half.physical(bits);
    if (std::isnan(value) || bits == 0x8000) continue;  // -0 * scale + offset is +0
    ASSERT_EQ(half.raw_from_physical(value), bits);
  }
  // Nearest, ties to even.
  EXPECT_EQ(half.raw_from_physical(1.0 + std::ldexp(1.0, -11)), 0x3C00U);
  EXPECT_EQ(half.raw_from_physical(1.0 + std::ldexp(3.0, -11)), 0x3C02U);
  EXPECT_EQ(half.raw_from_physical(2.0 - std::ldexp(1.0, -30)), 0x4000U);
  EXPECT_EQ(half.raw_from_physical(1e9), 0x7BFFU);
  EXPECT_EQ(half.raw_from_physical(std::ldexp(1.0, -26)), 0x0000U);
}

TEST(SignalCodec, KnowsTheAllOnesPattern) {
  const SignalCodec byte(make_signal(0, 8, ByteOrder::kLittle, ValueType::kSigned));
  EXPECT_TRUE(byte.is_all_ones(static_cast<std::uint64_t>(-1)));
  EXPECT_FALSE(byte.is_all_ones(0x7F));
  EXPECT_FALSE(SignalCodec(make_signal(0, 1, ByteOrder::kLittle)).is_all_ones(1));
  const SignalCodec single(make_signal(0, 32, ByteOrder::kLittle, ValueType::kFloat32));
  EXPECT_FALSE(single.is_all_ones(0xFFFFFFFF));
}

}  // namespace
}  // namespace beltgrip::can
