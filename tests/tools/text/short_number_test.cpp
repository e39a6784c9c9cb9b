// The truth is std::to_chars.
#include "tools/text/short_number.h"

#include <gtest/gtest.h>

#include <bit>
#include <limits>
#include <random>
#include <string>

namespace beltgrip::text {
namespace {

std::string by_library(double value) {
  char buffer[kNumberLongest];
  return {buffer, std::to_chars(buffer, buffer + sizeof buffer, value).ptr};
}

std::string here(double value, unsigned decimals) {
  char buffer[kNumberLongest];
  return {buffer, write_short(buffer, value, decimals)};
}

void expect_same(double value) {
  for (unsigned decimals = 0; decimals <= kNoDecimals; ++decimals) {
    ASSERT_EQ(here(value, decimals), by_library(value)) << decimals;
    ASSERT_EQ(here(-value, decimals), by_library(-value)) << decimals;
  }
}

TEST(ShortNumber, KnowsHowManyDecimalsThereAre) {
  EXPECT_EQ(decimals_of(0.0), 0U);
  EXPECT_EQ(decimals_of(-40.0), 0U);
  EXPECT_EQ(decimals_of(1e9), 0U);
  EXPECT_EQ(decimals_of(0.25), 2U);
  EXPECT_EQ(decimals_of(-0.1), 1U);
  EXPECT_EQ(decimals_of(0.000001), 6U);
  EXPECT_EQ(decimals_of(0.0000001), kNoDecimals);
  EXPECT_EQ(decimals_of(1.0 / 3.0), kNoDecimals);
  EXPECT_EQ(decimals_of(123456.5), kNoDecimals);
  EXPECT_EQ(decimals_of(std::numeric_limits<double>::infinity()), 0U);
  EXPECT_EQ(decimals_of(std::numeric_limits<double>::quiet_NaN()), kNoDecimals);
}

TEST(ShortNumber, WritesWhatTheLibraryWrites) {
  const double edges[] = {0.0,
                          1e-3,
                          0.00099,
                          0.0010001,
                          0.5,
                          1.0,
                          9999.0,
                          1e4,
                          9e4,
                          99999.0,
                          99999.5,
                          1e5,
                          100001.0,
                          1e15,
                          1e-7,
                          0.3,
                          0.1 * 3,
                          1.0 / 3.0,
                          12345.678901,
                          5e-324,
                          std::numeric_limits<double>::max(),
                          std::numeric_limits<double>::infinity()};
  for (const double edge : edges) {
    expect_same(edge);
    expect_same(std::nextafter(edge, 0.0));
    expect_same(std::nextafter(edge, 1e300));
  }
}

TEST(ShortNumber, WritesWhatTheLibraryWritesOfAnySignal) {
  std::mt19937_64 random(1);
  const double scales[] = {1.0, 0.5, 0.25, 0.1, 0.01, 0.001, 1e-4, 1e-5, 0.03125, 0.0078125, 7.0};
  const double offsets[] = {0.0, -40.0, 0.5, -273.15, 1e-3};
  for (int i = 0; i < 30'000; ++i) {
    const auto raw = static_cast<double>(random() % (1ULL << (1 + random() % 24)));
    expect_same(raw * scales[random() % 11] + offsets[random() % 5]);
    expect_same(std::bit_cast<double>(random()));
    if (HasFatalFailure()) return;
  }
}

}  // namespace
}  // namespace beltgrip::text
