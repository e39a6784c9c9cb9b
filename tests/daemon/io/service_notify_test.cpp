// What the service manager hears, through a real notification socket.
#include "daemon/io/service_notify.h"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <filesystem>
#include <string>

namespace beltgrip::daemon {
namespace {

class Notify : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = std::filesystem::temp_directory_path() / "beltgrip_notify.XXXXXX";
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
    const std::string path = folder_ + "/socket";
    socket_ = socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.copy(address.sun_path, sizeof address.sun_path - 1);
    ASSERT_EQ(bind(socket_, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
    setenv("NOTIFY_SOCKET", path.c_str(), 1);
    setenv("WATCHDOG_USEC", "2000000", 1);
    setenv("WATCHDOG_PID", std::to_string(getpid()).c_str(), 1);
  }
  void TearDown() override {
    for (const char* name : {"NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"}) unsetenv(name);
    close(socket_);
    std::filesystem::remove_all(folder_);
  }
  // The one message since the last call; empty: none.
  std::string heard() const {
    std::array<char, 1024> text{};
    const ssize_t size = recv(socket_, text.data(), text.size(), 0);
    return size < 0 ? "" : std::string(text.data(), static_cast<std::size_t>(size));
  }

 private:
  std::string folder_;
  int socket_ = -1;
};

Observation after(std::uint64_t samples) {
  Observation observation;
  observation.pipeline.samples = samples;
  return observation;
}

TEST_F(Notify, ReadyOnlyOnceTheLoopHasSampled) {
  ServiceNotify notify;
  notify.turn(MonoTime{}, nullptr);
  EXPECT_EQ(heard(), "");
  const Observation none = after(0);
  notify.turn(MonoTime::of_ns(1), &none);
  EXPECT_EQ(heard(), "");
  const Observation one = after(1);
  notify.turn(MonoTime::of_ns(2), &one);
  EXPECT_EQ(heard(), "READY=1\nSTATUS=Inhibited, no result yet\nWATCHDOG=1\n");
  EXPECT_EQ(heard(), "");
}

TEST_F(Notify, TheWatchdogIsFedWhileTheLoopGoesOnAndNotOtherwise) {
  ServiceNotify notify;
  const Observation first = after(1);
  notify.turn(MonoTime{}, &first);
  heard();
  const Observation second = after(100);
  notify.turn(MonoTime{499 * kMillisecond}, &second);
  EXPECT_EQ(heard(), "") << "four times in its two seconds are enough";
  notify.turn(MonoTime{500 * kMillisecond}, &second);
  EXPECT_EQ(heard(), "WATCHDOG=1\n");
  // The helper lives on, the loop does not.
  for (int turn = 1; turn <= 200; ++turn) {
    notify.turn(MonoTime{(500 + 20 * turn) * kMillisecond}, &second);
    ASSERT_EQ(heard(), "") << turn;
  }
  const Observation third = after(101);
  notify.turn(MonoTime{5 * kSecond}, &third);
  EXPECT_EQ(heard(), "WATCHDOG=1\n");
}

TEST_F(Notify, WithoutAWatchdogNothingIsFed) {
  unsetenv("WATCHDOG_USEC");
  ServiceNotify notify;
  const Observation one = after(1);
  notify.turn(MonoTime{}, &one);
  EXPECT_EQ(heard(), "READY=1\nSTATUS=Inhibited, no result yet\n");
}

TEST_F(Notify, SaysWhenItsStateChangesAndWhenItStops) {
  unsetenv("WATCHDOG_USEC");
  ServiceNotify notify;
  Observation seen = after(1);
  notify.turn(MonoTime{}, &seen);
  heard();
  seen.report.state = State::kRamping;
  seen.report.faults = fault_bit(Fault::kInputStale) | fault_bit(Fault::kBusDown);
  notify.turn(MonoTime::of_ns(1), &seen);
  EXPECT_EQ(heard(), "STATUS=Ramping, no result yet, faults InputStale BusDown\n");
  seen.report.faults = 0;
  seen.report.result.peak.kind = estimator::PeakKind::kValue;
  seen.report.result.peak.mu_max = 0.10537;
  seen.report.result.peak.mu_max_std = 0.0002;
  notify.turn(MonoTime::of_ns(2), &seen);
  EXPECT_EQ(heard(), "STATUS=Ramping, mu_max 0.1054 +- 0.0002\n");
  seen.report.result.peak.kind = estimator::PeakKind::kLowerBound;
  notify.turn(MonoTime::of_ns(3), &seen);
  EXPECT_EQ(heard(), "STATUS=Ramping, mu_max above 0.1054\n");
  notify.stopping();
  EXPECT_EQ(heard(), "STOPPING=1\nSTATUS=stopping");
}

TEST(NoManager, IsNoTrouble) {
  unsetenv("NOTIFY_SOCKET");
  ServiceNotify notify;
  const Observation one = after(1);
  EXPECT_NO_THROW(notify.turn(MonoTime{}, &one));
  EXPECT_NO_THROW(notify.stopping());
}

}  // namespace
}  // namespace beltgrip::daemon
