// Kernel stamps on the monotonic clock, whatever is done to the wall clock.
#include "daemon/io/stamp.h"

#include <gtest/gtest.h>

namespace beltgrip::daemon {
namespace {

constexpr Duration kWall = 1'700'000'000 * kSecond;

TEST(StampConverter, AgesAreTakenFromTheWallClock) {
  StampConverter stamps;
  stamps.read(MonoTime{100 * kSecond}, kWall.ns());
  EXPECT_EQ(stamps.convert(true, (kWall - 3 * kMillisecond).ns()),
            MonoTime{100 * kSecond - 3 * kMillisecond});
  EXPECT_EQ(stamps.convert(true, kWall.ns()), MonoTime{100 * kSecond});
}

TEST(StampConverter, WithoutAStampItIsNow) {
  StampConverter stamps;
  stamps.read(MonoTime{100 * kSecond}, kWall.ns());
  EXPECT_EQ(stamps.convert(false, 0), MonoTime{100 * kSecond});
}

TEST(StampConverter, AFrameOfAStoppedReaderKeepsItsAge) {
  StampConverter stamps;
  stamps.read(MonoTime{100 * kSecond}, kWall.ns());
  stamps.read(MonoTime{101 * kSecond}, (kWall + kSecond).ns());
  EXPECT_EQ(stamps.convert(true, (kWall + 750 * kMillisecond).ns()),
            MonoTime{100'750 * kMillisecond});
}

// Steps of a second, an hour, to 1970 and to 2106, each between stamp and reading.
TEST(StampConverter, AStepOfTheWallClockCannotEnter) {
  for (const Duration step : {kSecond, -kSecond, 3600 * kSecond, -3600 * kSecond, -kWall,
                              2'600'000'000 * kSecond, 5 * kMillisecond, -5 * kMillisecond}) {
    StampConverter stamps;
    MonoTime mono{100 * kSecond};
    stamps.read(mono, (kWall + mono.since_origin()).ns());
    MonoTime last = stamps.convert(true, (kWall + mono.since_origin() - kMicrosecond).ns());
    mono += 5 * kMillisecond;
    stamps.read(mono, (kWall + mono.since_origin() + step).ns());
    // Stamped before the step, and after it.
    for (const Duration stamp : {kWall + mono.since_origin() - 2 * kMicrosecond,
                                 kWall + mono.since_origin() + step - kMicrosecond}) {
      const MonoTime t = stamps.convert(true, stamp.ns());
      EXPECT_GE(t, last) << step;
      EXPECT_LE(t, mono) << step;
      EXPECT_GE(t, mono - kMillisecond) << step;
      last = t;
    }
    // And the batch after that is as ever.
    mono += 5 * kMillisecond;
    stamps.read(mono, (kWall + mono.since_origin() + step).ns());
    EXPECT_EQ(stamps.convert(true, (kWall + mono.since_origin() + step - kMicrosecond).ns()),
              mono - kMicrosecond)
        << step;
  }
}

TEST(StampConverter, NeverLaterThanNowNeverBackwards) {
  StampConverter stamps;
  stamps.read(MonoTime{100 * kSecond}, kWall.ns());
  EXPECT_EQ(stamps.convert(true, (kWall + kSecond).ns()), MonoTime{100 * kSecond});
  EXPECT_EQ(stamps.convert(true, (kWall - kSecond).ns()), MonoTime{100 * kSecond});
  EXPECT_EQ(stamps.convert(true, (kWall - 10 * kSecond).ns()), MonoTime{100 * kSecond});
}

}  // namespace
}  // namespace beltgrip::daemon
