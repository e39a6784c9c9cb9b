#include "daemon/core/base/faults.h"

#include <gtest/gtest.h>

namespace beltgrip::daemon {
namespace {

TEST(FaultSet, ShowsAtOnceAndHolds) {
  FaultSet faults;
  EXPECT_EQ(faults.bits(), 0U);
  faults.raise(Fault::kInputStale, 5);
  EXPECT_EQ(faults.bits(), fault_bit(Fault::kInputStale));
  faults.expire(5 + FaultSet::kHold - 1);
  EXPECT_TRUE(faults.has(Fault::kInputStale));
  faults.expire(5 + FaultSet::kHold);
  EXPECT_FALSE(faults.has(Fault::kInputStale));
}

TEST(FaultSet, RaisingAgainProlongs) {
  FaultSet faults;
  faults.raise(Fault::kInputRange, 0);
  faults.raise(Fault::kInputRange, kSecond / 2);
  faults.expire(kSecond);
  EXPECT_TRUE(faults.has(Fault::kInputRange));
  faults.expire(kSecond + kSecond / 2);
  EXPECT_FALSE(faults.has(Fault::kInputRange));
}

TEST(FaultSet, LatchedStays) {
  FaultSet faults;
  faults.latch(Fault::kFrameRefused);
  faults.raise(Fault::kFrameRefused, 0);
  faults.expire(100 * kSecond);
  EXPECT_EQ(faults.bits(), fault_bit(Fault::kFrameRefused));
}

TEST(FaultSet, AForeignSenderIsGoneAfterTenSecondsOfSilence) {
  FaultSet faults;
  faults.raise(Fault::kForeignSender, 0);
  faults.raise(Fault::kForeignSender, 3 * kSecond);
  faults.expire(13 * kSecond - 1);
  EXPECT_TRUE(faults.has(Fault::kForeignSender));
  faults.expire(13 * kSecond);
  EXPECT_FALSE(faults.has(Fault::kForeignSender));
}

TEST(FaultSet, AFlickerChangesTheSetAtMostTwiceASecond) {
  FaultSet faults;
  int changes = 0;
  std::uint32_t last = 0;
  for (MonoTime t = 0; t < 10 * kSecond; t += 5 * kMillisecond) {
    if (t % (70 * kMillisecond) == 0 && (t / kSecond) % 3 != 2) {
      faults.raise(Fault::kInputStale, t);
    }
    faults.expire(t);
    changes += faults.bits() != last ? 1 : 0;
    last = faults.bits();
  }
  EXPECT_GE(changes, 2);
  EXPECT_LE(changes, 20);
}

}  // namespace
}  // namespace beltgrip::daemon
