// beltgripd as a process on SocketCAN: start, stop, and an interface that is missing, down,
// deleted.
#include <gtest/gtest.h>
#include <linux/can/error.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <fstream>

#include "tests/vcan/rig.h"

namespace beltgrip::test {
namespace {

// Promised: 200 ms. A guest on a busy machine may stand still for longer than that.
constexpr Milliseconds kStopLimit{1000};

class Daemon : public Vcan {
 protected:
  std::vector<std::string> argv(const std::string& interface = "vcan0") {
    return {program("beltgripd"), "--config", write_rig_config(folder(), interface)};
  }
};

bool has_inputs(const PublishedFrames& published) {
  const auto status = published.last("BeltGripStatus").signals;
  return !status.empty() && status.at("FaultInputMissing") == 0 &&
         status.at("FaultInputStale") == 0 && status.at("FaultBusDown") == 0;
}

bool in_experiment(const PublishedFrames& published) {
  const auto status = published.last("BeltGripStatus").signals;
  return !status.empty() && status.at("State") == 3;  // Ramping
}

bool has_status(const PublishedFrames& published) {
  return !published.of("BeltGripStatus").empty();
}

TEST_F(Daemon, PublishesWithoutAnyInputAndSaysWhatIsMissing) {
  const BusSocket bus("vcan0");
  const Process daemon(argv());
  PublishedFrames published;
  ASSERT_TRUE(listen(bus, published, [](const PublishedFrames& seen) {
    return seen.of("BeltGripStatus").size() >= 2 && seen.of("BeltGripEstimate").size() >= 10;
  }));
  EXPECT_EQ(published.problems(), std::vector<std::string>{});
  EXPECT_EQ(published.last("BeltGripStatus").signals.at("FaultInputMissing"), 1);
  EXPECT_EQ(published.last("BeltGripEstimate").signals.at("MuMaxValid"), 0);
  EXPECT_EQ(published.last("BeltGripSlip").signals.at("MacroSlipStop"), 0);
}

TEST_F(Daemon, SeesItsInputsComeAndGo) {
  const BusSocket bus("vcan0");
  const Process daemon(argv());
  PublishedFrames published;
  {
    const Process player(canplayer(write_steady_log(folder()), "vcan0", true));
    ASSERT_TRUE(listen(bus, published, has_inputs));
  }
  EXPECT_TRUE(listen(bus, published, [](const PublishedFrames& seen) {
    return seen.last("BeltGripStatus").signals.at("FaultInputStale") == 1;
  }));
  EXPECT_EQ(published.problems(), std::vector<std::string>{});
}

class StopSignal : public Daemon, public testing::WithParamInterface<int> {};

TEST_P(StopSignal, EndsItWithStatusZero) {
  const BusSocket bus("vcan0");
  const Process player(canplayer(write_steady_log(folder()), "vcan0", true));
  Process daemon(argv());
  PublishedFrames published;
  ASSERT_TRUE(listen(bus, published, in_experiment)) << daemon.err();
  const auto begin = std::chrono::steady_clock::now();
  daemon.signal(GetParam());
  EXPECT_EQ(daemon.wait(kStopLimit), 0) << daemon.err();
  RecordProperty("milliseconds", static_cast<int>(std::chrono::duration_cast<Milliseconds>(
                                                      std::chrono::steady_clock::now() - begin)
                                                      .count()));
  // The last word on the bus: stopped on purpose, and nothing asked for.
  ASSERT_TRUE(listen(bus, published, [](const PublishedFrames& seen) {
    return seen.last("BeltGripStatus").signals.at("StopReason") == 15;  // Shutdown
  }));
  EXPECT_EQ(published.problems(), std::vector<std::string>{});
}

TEST_P(StopSignal, TwiceIsOnce) {
  const BusSocket bus("vcan0");
  Process daemon(argv());
  PublishedFrames published;
  ASSERT_TRUE(listen(bus, published, has_status));
  daemon.signal(GetParam());
  daemon.signal(GetParam());
  EXPECT_EQ(daemon.wait(kStopLimit), 0) << daemon.err();
}

TEST_P(StopSignal, EndsItWithTheInterfaceGone) {
  const BusSocket bus("vcan0");
  Process daemon(argv());
  PublishedFrames published;
  ASSERT_TRUE(listen(bus, published, has_status));
  ASSERT_NO_FATAL_FAILURE(ip({"link", "delete", "vcan0"}));
  ASSERT_TRUE(daemon.wait_for_error("BusDown", kLimit));
  daemon.signal(GetParam());
  EXPECT_EQ(daemon.wait(kStopLimit), 0) << daemon.err();
}

INSTANTIATE_TEST_SUITE_P(, StopSignal, testing::Values(SIGTERM, SIGINT));

TEST_F(Daemon, MissingInterfaceIsOneLineAndStatus69) {
  const RunResult result = run(argv("vcan7"), kLimit);
  EXPECT_EQ(result.status, 69);
  EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
  EXPECT_NE(result.err.find("\"vcan7\""), std::string::npos) << result.err;
}

TEST_F(Daemon, AnInterfaceThatIsNotCanIsOneLineAndStatus69) {
  const RunResult result = run(argv("lo"), kLimit);
  EXPECT_EQ(result.status, 69);
  EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
}

TEST_F(Daemon, WrongConfigurationIsStatus78) {
  const std::string path = write_rig_config(folder(), "vcan0", "triger = \"always\"\n");
  const RunResult result = run({program("beltgripd"), "--config", path}, kLimit);
  EXPECT_EQ(result.status, 78);
  EXPECT_NE(result.err.find(path + ":11: "), std::string::npos) << result.err;
  EXPECT_NE(result.err.find("triger"), std::string::npos) << result.err;
}

TEST_F(Daemon, WhatIsNotThereYetIsStatus78) {
  const std::string path = write_rig_config(folder(), "vcan0", "control = \"command\"\n");
  const RunResult result = run({program("beltgripd"), "--config", path}, kLimit);
  EXPECT_EQ(result.status, 78);
  EXPECT_NE(result.err.find("control"), std::string::npos) << result.err;
}

TEST_F(Daemon, GoesOnWhenTheInterfaceWasDown) {
  const std::string steady = write_steady_log(folder());
  Process daemon(argv());
  PublishedFrames published;
  {
    const BusSocket bus("vcan0");
    const Process player(canplayer(steady, "vcan0", true));
    ASSERT_TRUE(listen(bus, published, has_inputs));
    ASSERT_NO_FATAL_FAILURE(ip({"link", "set", "vcan0", "down"}));
    ASSERT_TRUE(daemon.wait_for_error("BusDown", kLimit));
  }
  ASSERT_NO_FATAL_FAILURE(ip({"link", "set", "vcan0", "up"}));
  const BusSocket bus("vcan0");
  const Process player(canplayer(steady, "vcan0", true));
  PublishedFrames after;
  EXPECT_TRUE(listen(bus, after, has_inputs)) << daemon.err();
  EXPECT_EQ(after.problems(), std::vector<std::string>{});
  EXPECT_EQ(daemon.wait(Milliseconds{0}), std::nullopt) << daemon.err();
}

TEST_F(Daemon, StartsOnAnInterfaceThatIsDown) {
  ASSERT_NO_FATAL_FAILURE(ip({"link", "set", "vcan0", "down"}));
  Process daemon(argv());
  ASSERT_TRUE(daemon.wait_for_error("BusDown", kLimit)) << daemon.err();
  ASSERT_NO_FATAL_FAILURE(ip({"link", "set", "vcan0", "up"}));
  const BusSocket bus("vcan0");
  const Process player(canplayer(write_steady_log(folder()), "vcan0", true));
  PublishedFrames published;
  EXPECT_TRUE(listen(bus, published, has_inputs)) << daemon.err();
}

TEST_F(Daemon, GoesOnWhenTheInterfaceWasDeletedAndMadeAgain) {
  const std::string steady = write_steady_log(folder());
  Process daemon(argv());
  {
    const BusSocket bus("vcan0");
    const Process player(canplayer(steady, "vcan0", true));
    PublishedFrames published;
    ASSERT_TRUE(listen(bus, published, has_inputs));
    ASSERT_NO_FATAL_FAILURE(ip({"link", "delete", "vcan0"}));
    ASSERT_TRUE(daemon.wait_for_error("BusDown", kLimit));
  }
  // Absent: it looks again and again, but is not busy with it.
  const auto cpu_time_ms = [&] {
    std::ifstream stat("/proc/" + std::to_string(daemon.pid()) + "/stat");
    std::string field;
    for (int i = 1; i < 14; ++i) stat >> field;
    long user = 0, system = 0;
    stat >> user >> system;
    return (user + system) * 1000 / sysconf(_SC_CLK_TCK);
  };
  const long before_ms = cpu_time_ms();
  EXPECT_EQ(daemon.wait(Milliseconds{1000}), std::nullopt) << daemon.err();
  EXPECT_LT(cpu_time_ms() - before_ms, 500);
  ASSERT_NO_FATAL_FAILURE(add_interface("vcan0"));
  const BusSocket bus("vcan0");
  const Process player(canplayer(steady, "vcan0", true));
  PublishedFrames after;
  EXPECT_TRUE(listen(bus, after, has_inputs)) << daemon.err();
  EXPECT_EQ(after.problems(), std::vector<std::string>{});
}

TEST_F(Daemon, TwoInterfacesAreTwoWorlds) {
  ASSERT_NO_FATAL_FAILURE(add_interface("vcan1"));
  const BusSocket bus0("vcan0");
  const BusSocket bus1("vcan1");
  const Process daemon0(argv("vcan0"));
  const Process daemon1(argv("vcan1"));
  const auto misses_inputs = [](const PublishedFrames& seen) {
    return has_status(seen) && seen.last("BeltGripStatus").signals.at("FaultInputMissing") == 1;
  };
  PublishedFrames published0, published1;
  ASSERT_TRUE(listen(bus0, published0, misses_inputs));
  const Process player(canplayer(write_steady_log(folder()), "vcan1", true));
  ASSERT_TRUE(listen(bus1, published1, has_inputs));
  const std::size_t seen_before = published0.of("BeltGripStatus").size();
  ASSERT_TRUE(listen(bus0, published0, [&](const PublishedFrames& seen) {
    return seen.of("BeltGripStatus").size() >= seen_before + 2;
  }));
  EXPECT_TRUE(misses_inputs(published0));
  EXPECT_EQ(published0.problems(), std::vector<std::string>{});
  EXPECT_EQ(published1.problems(), std::vector<std::string>{});
}

bool fault(const PublishedFrames& published, const std::string& name) {
  return has_status(published) && published.last("BeltGripStatus").signals.at("Fault" + name) == 1;
}

TEST_F(Daemon, AnotherNodeThatSendsItsFramesIsAFault) {
  const BusSocket bus("vcan0");
  const Process daemon(argv());
  PublishedFrames published;
  ASSERT_TRUE(listen(bus, published, has_status));
  EXPECT_FALSE(fault(published, "ForeignSender"));
  bus.send(0x6A1, {0, 0, 0, 0, 0, 0, 0, 0});
  EXPECT_TRUE(listen(bus, published,
                     [](const PublishedFrames& seen) { return fault(seen, "ForeignSender"); }));
}

TEST_F(Daemon, ASecondDaemonOnTheSameBusIsAFaultInBoth) {
  const BusSocket bus("vcan0");
  Process first(argv());
  Process second(argv());
  EXPECT_TRUE(first.wait_for_error("ForeignSender", kLimit)) << first.err();
  EXPECT_TRUE(second.wait_for_error("ForeignSender", kLimit)) << second.err();
}

// Frames that the daemon must not take for an input, though they have its identifier.
struct WrongFrame {
  const char* name;
  canid_t id;
  std::vector<std::uint8_t> data;
  bool fd;
};

class WrongFrames : public Daemon, public testing::WithParamInterface<WrongFrame> {};

TEST_P(WrongFrames, AreAFaultThatGoesAgain) {
  const BusSocket bus("vcan0");
  const Process player(canplayer(write_steady_log(folder()), "vcan0", true));
  Process daemon(argv());
  PublishedFrames published;
  ASSERT_TRUE(listen(bus, published, has_inputs)) << daemon.err();
  EXPECT_FALSE(fault(published, "InputFrame"));
  if (GetParam().fd) {
    bus.send_fd(GetParam().id, GetParam().data);
  } else {
    bus.send(GetParam().id, GetParam().data);
  }
  ASSERT_TRUE(listen(bus, published, [](const PublishedFrames& seen) {
    return fault(seen, "InputFrame");
  })) << daemon.err();
  EXPECT_TRUE(listen(bus, published, [](const PublishedFrames& seen) {
    return has_inputs(seen) && !fault(seen, "InputFrame");
  })) << daemon.err();
  EXPECT_EQ(published.problems(), std::vector<std::string>{});
}

INSTANTIATE_TEST_SUITE_P(, WrongFrames,
                         testing::Values(WrongFrame{"TooShort", 0x110, {1, 2, 3}, false},
                                         WrongFrame{"Empty", 0x120, {}, false},
                                         WrongFrame{"Fd", 0x130, {1, 2, 3, 4, 5, 6}, true},
                                         WrongFrame{"FdLong", 0x110,
                                                    std::vector<std::uint8_t>(64, 0xFF), true}),
                         [](const auto& test) { return test.param.name; });

TEST_F(Daemon, BusOffIsAFaultUntilFramesComeAgain) {
  const std::string steady = write_steady_log(folder());
  const BusSocket bus("vcan0");
  const Process daemon(argv());
  PublishedFrames published;
  ASSERT_TRUE(listen(bus, published, has_status));
  bus.send(CAN_ERR_FLAG | CAN_ERR_BUSOFF, {0, 0, 0, 0, 0, 0, 0, 0});
  ASSERT_TRUE(
      listen(bus, published, [](const PublishedFrames& seen) { return fault(seen, "BusOff"); }));
  const Process player(canplayer(steady, "vcan0", true));
  EXPECT_TRUE(listen(bus, published, [](const PublishedFrames& seen) {
    return has_inputs(seen) && !fault(seen, "BusOff");
  }));
}

// What cannot be foreseen: every kind of frame that can-utils make, as fast as they can.
TEST_F(Daemon, OutlivesRandomFrames) {
  const BusSocket bus("vcan0");
  Process daemon(argv());
  PublishedFrames published;
  ASSERT_TRUE(listen(bus, published, has_status));
  const std::vector<std::vector<std::string>> kinds{{}, {"-e"}, {"-f"}, {"-R"}, {"-e", "-f"}};
  for (const std::vector<std::string>& kind : kinds) {
    std::vector<std::string> cangen{"cangen", "vcan0", "-g", "0", "-n", "4000", "-i", "-x"};
    cangen.insert(cangen.end(), kind.begin(), kind.end());
    EXPECT_EQ(run(cangen, kLimit).status, 0);
  }
  // Inputs with random content, in range or not.
  for (const char* id : {"110", "120", "130"}) {
    EXPECT_EQ(run({"cangen", "vcan0", "-g", "0", "-n", "2000", "-I", id, "-L", "r"}, kLimit).status,
              0);
  }
  const Process player(canplayer(write_steady_log(folder()), "vcan0", true));
  const BusSocket quiet("vcan0");
  PublishedFrames after;
  EXPECT_TRUE(listen(quiet, after, has_inputs)) << daemon.err();
  EXPECT_EQ(after.problems(), std::vector<std::string>{});
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(kStopLimit), 0) << daemon.err();
}

}  // namespace
}  // namespace beltgrip::test
