// How each bus is, as port and error frames tell it.
#include "daemon/core/input/bus_watch.h"

#include <gtest/gtest.h>

namespace beltgrip::daemon {
namespace {

TEST(BusWatch, OnlyWhatIsNeededMustBeUp) {
  BusWatch buses;
  buses.need(0);
  EXPECT_TRUE(buses.needed_up());
  buses.on_link(1, BusState::kDown);
  EXPECT_TRUE(buses.needed_up());
  EXPECT_FALSE(buses.up(1));
  buses.on_link(0, BusState::kAbsent);
  EXPECT_FALSE(buses.needed_up());
  buses.on_link(0, BusState::kActive);
  EXPECT_TRUE(buses.needed_up());
}

TEST(BusWatch, ALinkThatIsDownIsAFault) {
  BusWatch buses;
  FaultSet faults;
  buses.raise_faults(MonoTime::of_ns(1), faults);
  EXPECT_EQ(faults.bits(), 0U);
  buses.on_link(1, BusState::kDown);
  buses.raise_faults(MonoTime::of_ns(1), faults);
  EXPECT_EQ(faults.bits(), fault_bit(Fault::kBusDown));
}

TEST(BusWatch, AnotherConfigurationKeepsWhatItNeeds) {
  BusWatch before, next;
  before.need(0);
  before.on_link(1, BusState::kDown);
  next.need(1);
  next.go_on_from(before);
  EXPECT_FALSE(next.needed_up());
  next.on_link(1, BusState::kActive);
  EXPECT_TRUE(next.needed_up());
}

}  // namespace
}  // namespace beltgrip::daemon
