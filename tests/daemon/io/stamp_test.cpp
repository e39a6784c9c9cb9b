// Kernel stamps on the monotonic clock, whatever is done to the wall clock.
#include "daemon/io/stamp.h"

#include <gtest/gtest.h>

namespace beltgrip::daemon {
namespace {

constexpr std::int64_t kWall = 1'700'000'000 * kSecond;

TEST(StampConverter, AgesAreTakenFromTheWallClock) {
  StampConverter stamps;
  stamps.read(100 * kSecond, kWall);
  EXPECT_EQ(stamps.convert(true, kWall - 3 * kMillisecond), 100 * kSecond - 3 * kMillisecond);
  EXPECT_EQ(stamps.convert(true, kWall), 100 * kSecond);
}

TEST(StampConverter, WithoutAStampItIsNow) {
  StampConverter stamps;
  stamps.read(100 * kSecond, kWall);
  EXPECT_EQ(stamps.convert(false, 0), 100 * kSecond);
}

TEST(StampConverter, AFrameOfAStoppedReaderKeepsItsAge) {
  StampConverter stamps;
  stamps.read(100 * kSecond, kWall);
  stamps.read(101 * kSecond, kWall + kSecond);
  EXPECT_EQ(stamps.convert(true, kWall + 750 * kMillisecond), 100'750 * kMillisecond);
}

// Steps of a second, an hour, to 1970 and to 2106, each between stamp and reading.
TEST(StampConverter, AStepOfTheWallClockCannotEnter) {
  for (const std::int64_t step : {kSecond, -kSecond, 3600 * kSecond, -3600 * kSecond, -kWall,
                                  2'600'000'000 * kSecond, 5 * kMillisecond, -5 * kMillisecond}) {
    StampConverter stamps;
    MonoTime mono = 100 * kSecond;
    stamps.read(mono, kWall + mono);
    MonoTime last = stamps.convert(true, kWall + mono - 1000);
    mono += 5 * kMillisecond;
    stamps.read(mono, kWall + mono + step);
    // Stamped before the step, and after it.
    for (const std::int64_t stamp : {kWall + mono - 2000, kWall + mono + step - 1000}) {
      const MonoTime t = stamps.convert(true, stamp);
      EXPECT_GE(t, last) << step;
      EXPECT_LE(t, mono) << step;
      EXPECT_GE(t, mono - kMillisecond) << step;
      last = t;
    }
    // And the batch after that is as ever.
    mono += 5 * kMillisecond;
    stamps.read(mono, kWall + mono + step);
    EXPECT_EQ(stamps.convert(true, kWall + mono + step - 1000), mono - 1000) << step;
  }
}

TEST(StampConverter, NeverLaterThanNowNeverBackwards) {
  StampConverter stamps;
  stamps.read(100 * kSecond, kWall);
  EXPECT_EQ(stamps.convert(true, kWall + kSecond), 100 * kSecond);
  EXPECT_EQ(stamps.convert(true, kWall - kSecond), 100 * kSecond);
  EXPECT_EQ(stamps.convert(true, kWall - 10 * kSecond), 100 * kSecond);
}

}  // namespace
}  // namespace beltgrip::daemon
