#include "daemon/core/base/faults.h"

#include <gtest/gtest.h>

namespace beltgrip::daemon {
namespace {

TEST(FaultSet, ShowsAtOnceAndHolds) {
  FaultSet faults;
  EXPECT_EQ(faults.bits(), 0U);
  faults.raise(Fault::kInputStale, MonoTime::of_ns(5));
  EXPECT_EQ(faults.bits(), fault_bit(Fault::kInputStale));
  faults.expire(MonoTime::of_ns(5) + FaultSet::kHold - kNanosecond);
  EXPECT_TRUE(faults.has(Fault::kInputStale));
  faults.expire(MonoTime::of_ns(5) + FaultSet::kHold);
  EXPECT_FALSE(faults.has(Fault::kInputStale));
}

TEST(FaultSet, RaisingAgainProlongs) {
  FaultSet faults;
  faults.raise(Fault::kInputRange, MonoTime{});
  faults.raise(Fault::kInputRange, MonoTime{kSecond / 2});
  faults.expire(MonoTime{kSecond});
  EXPECT_TRUE(faults.has(Fault::kInputRange));
  faults.expire(MonoTime{kSecond + kSecond / 2});
  EXPECT_FALSE(faults.has(Fault::kInputRange));
}

TEST(FaultSet, LatchedStays) {
  FaultSet faults;
  faults.latch(Fault::kFrameRefused);
  faults.raise(Fault::kFrameRefused, MonoTime{});
  faults.expire(MonoTime{100 * kSecond});
  EXPECT_EQ(faults.bits(), fault_bit(Fault::kFrameRefused));
}

TEST(FaultSet, AForeignSenderIsGoneAfterTenSecondsOfSilence) {
  FaultSet faults;
  faults.raise(Fault::kForeignSender, MonoTime{});
  faults.raise(Fault::kForeignSender, MonoTime{3 * kSecond});
  faults.expire(MonoTime{13 * kSecond} - kNanosecond);
  EXPECT_TRUE(faults.has(Fault::kForeignSender));
  faults.expire(MonoTime{13 * kSecond});
  EXPECT_FALSE(faults.has(Fault::kForeignSender));
}

TEST(FaultSet, AFlickerChangesTheSetAtMostTwiceASecond) {
  FaultSet faults;
  int changes = 0;
  std::uint32_t last = 0;
  for (MonoTime t{}; t < MonoTime{10 * kSecond}; t += 5 * kMillisecond) {
    if (t.since_origin() % (70 * kMillisecond) == Duration{} &&
        (t.since_origin() / kSecond) % 3 != 2) {
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
