// beltgripd as a process on SocketCAN: start, stop, and an interface that is missing, down,
// deleted.
#include <gtest/gtest.h>
#include <linux/can/error.h>
#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <fstream>
#include <memory>
#include <sstream>

#include "tests/system/vcan/rig.h"

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
    // Before the first frame comes nothing is missed either: an experiment shows that all are
    // there.
    ASSERT_TRUE(listen(bus, published, [](const PublishedFrames& seen) {
      return has_inputs(seen) && in_experiment(seen);
    }));
  }
  EXPECT_TRUE(listen(bus, published, [](const PublishedFrames& seen) {
    return seen.last("BeltGripStatus").signals.at("FaultInputStale") == 1;
  }));
  EXPECT_EQ(published.problems(), std::vector<std::string>{});
}

// A unit without FIFO: works, and says what it lacks.
TEST_F(Daemon, RunsWithOrdinarySchedulingAndSaysSo) {
  // The unit gives the real-time priority; a daemon started by hand has its starter's.
  ASSERT_EQ(sched_getscheduler(0), SCHED_OTHER) << "run this test with ordinary scheduling";
  const BusSocket bus("vcan0");
  Process daemon({program("beltgripd"), "--config", write_rig_config(folder(), "vcan0")});
  PublishedFrames published;
  ASSERT_TRUE(listen(bus, published, has_status));
  EXPECT_TRUE(daemon.wait_for_error("ordinary scheduling", kLimit)) << daemon.err();
}

// Two for the same identifiers on one bus would take each other for a fault.
TEST_F(Daemon, ASecondOneOnThisHostRefusesToStart) {
  const BusSocket bus("vcan0");
  Process first(argv());
  PublishedFrames published;
  ASSERT_TRUE(listen(bus, published, has_status));
  const RunResult second = run(argv(), kLimit);
  EXPECT_EQ(second.status, 69);
  EXPECT_NE(second.err.find("another beltgripd on this host publishes 0x6A0 on vcan0"),
            std::string::npos)
      << second.err;
  EXPECT_EQ(std::count(second.err.begin(), second.err.end(), '\n'), 1) << second.err;
  // The first one goes on unharmed.
  const std::size_t before = published.of("BeltGripStatus").size();
  ASSERT_TRUE(listen(bus, published, [&](const PublishedFrames& seen) {
    return seen.of("BeltGripStatus").size() >= before + 2;
  }));
  EXPECT_EQ(published.last("BeltGripStatus").signals.at("FaultForeignSender"), 0);
  first.signal(SIGTERM);
  EXPECT_EQ(first.wait(kStopLimit), 0);
}

TEST_F(Daemon, OfTwoThatStartAtOnceOneRuns) {
  const BusSocket bus("vcan0");
  const std::vector<std::string> command = argv();
  Process one(command), other(command);
  PublishedFrames published;
  ASSERT_TRUE(listen(bus, published, has_status));
  const bool one_gone = one.wait(Milliseconds(0)).has_value();
  Process& gone = one_gone ? one : other;
  Process& stays = one_gone ? other : one;
  EXPECT_EQ(gone.wait(kLimit), 69);
  stays.signal(SIGTERM);
  EXPECT_EQ(stays.wait(kStopLimit), 0);
}

// One on another host of the bus: its frames alone tell.
TEST_F(Daemon, HearsAnotherSenderBeforeItsFirstFrame) {
  const BusSocket bus("vcan0");
  std::ofstream(folder() + "/status.log") << "(1.000000) vcan0 6A3#0000000000000000\n"
                                          << "(2.000000) vcan0 6A3#0000000000000000\n";
  const Process elsewhere(canplayer(folder() + "/status.log", "vcan0", true));
  const RunResult late = run(argv(), kLimit);
  EXPECT_EQ(late.status, 69);
  EXPECT_NE(late.err.find("another node sends 0x6A3 on vcan0"), std::string::npos) << late.err;
}

// Identifiers of its own: no conflict.
TEST_F(Daemon, ASecondOneWithOtherIdentifiersRuns) {
  const BusSocket bus("vcan0");
  const Process first(argv());
  PublishedFrames published;
  ASSERT_TRUE(listen(bus, published, has_status));
  std::ifstream same(write_rig_config(folder(), "vcan0"));
  std::string text((std::istreambuf_iterator<char>(same)), {});
  text.replace(text.find("[bus]\n"), 6,
               "[bus]\nidentifiers = { estimate = 0x6B0, slip = 0x6B1, clamp = 0x6B2, "
               "status = 0x6B3 }\n");
  const std::string path = folder() + "/other.toml";
  std::ofstream(path) << text;
  const Process second({program("beltgripd"), "--config", path});
  EXPECT_TRUE(bus.receive_until(
      [](const ReceivedFrame& seen) { return seen.frame.can_id == 0x6B3; }, kLimit));
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

// The experiment that a stop request ends is in the history, beside that of the run before.
TEST_F(Daemon, KeepsEveryExperimentInItsStateDirectory) {
  const std::string config =
      write_rig_config(folder(), "vcan0", "[daemon]\nstate_dir = \"state\"\n");
  for (int runs = 1; runs <= 2; ++runs) {
    const BusSocket bus("vcan0");
    const Process player(canplayer(write_steady_log(folder()), "vcan0", true));
    Process daemon({program("beltgripd"), "--config", config});
    PublishedFrames published;
    ASSERT_TRUE(listen(bus, published, in_experiment)) << daemon.err();
    daemon.signal(SIGTERM);
    ASSERT_EQ(daemon.wait(kStopLimit), 0) << daemon.err();
    const RunResult history =
        run({program("beltgrip"), "history", "--config", config, "--csv", "-"}, kLimit);
    EXPECT_EQ(history.status, 0) << history.err;
    EXPECT_EQ(std::count(history.out.begin(), history.out.end(), '\n'), runs + 1) << history.out;
    EXPECT_NE(history.out.find("inconclusive,shutdown,"), std::string::npos) << history.out;
  }
}

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

// --- SIGHUP and the log's level ---------------------------------------------------------------

constexpr canid_t kOtherStatus = 0x6B3;

bool sees(const BusSocket& bus, canid_t id) {
  return bus
      .receive_until([&](const ReceivedFrame& seen) { return seen.frame.can_id == id; }, kLimit)
      .has_value();
}

class Reloading : public Daemon {
 protected:
  // Writes it anew, with the status under this identifier.
  void configure(canid_t status, const std::string& more = "") {
    path_ = write_rig_config(folder(), "vcan0", more);
    std::stringstream text;
    text << std::ifstream(path_).rdbuf();
    std::string toml = text.str();
    char line[64];
    std::snprintf(line, sizeof line, "identifiers = { status = 0x%X }\n", status);
    toml.insert(toml.find("[signals]"), line);
    if (by_signal_) {
      toml.replace(toml.find("\"always\""), 8, "\"signal\"");
      toml.insert(toml.find("[experiment]"),
                  "experiment_active = { signal = \"RIG_State.ExperimentActive\", "
                  "period_ms = 1000 }\n");
    }
    std::ofstream(path_) << toml;
  }
  std::vector<std::string> argv() const { return {program("beltgripd"), "--config", path_}; }

  bool by_signal_ = false;
  std::string path_;
};

TEST_F(Reloading, TakesWhatIsRightAndKeepsTheOldOtherwise) {
  configure(0x6A3);
  const BusSocket bus("vcan0");
  Process daemon(argv());
  ASSERT_TRUE(sees(bus, 0x6A3)) << daemon.err();
  configure(kOtherStatus, "no_such_key = 1\n");
  daemon.signal(SIGHUP);
  ASSERT_TRUE(
      daemon.wait_for_error("reload refused, the old configuration stays: " + path_, kLimit))
      << daemon.err();
  EXPECT_NE(daemon.err().find("no_such_key"), std::string::npos) << daemon.err();
  const BusSocket after("vcan0");
  EXPECT_TRUE(sees(after, 0x6A3));
  configure(kOtherStatus);
  daemon.signal(SIGHUP);
  ASSERT_TRUE(daemon.wait_for_error("reload: " + path_ + " is in force", kLimit)) << daemon.err();
  EXPECT_TRUE(sees(after, kOtherStatus));
  const BusSocket later("vcan0");
  later.receive_until(
      [](const ReceivedFrame& seen) {
        EXPECT_NE(seen.frame.can_id, 0x6A3U);
        return seen.frame.can_id == kOtherStatus;
      },
      kLimit);
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(kStopLimit), 0) << daemon.err();
}

TEST_F(Reloading, WaitsForTheEndOfTheExperiment) {
  constexpr canid_t kState = 0x300;  // its second byte: experiment_active
  by_signal_ = true;
  configure(0x6A3);
  const std::string log = write_steady_log(folder());
  std::ofstream(log, std::ios::app) << "(0.999000) vcan0 300#00010000\n";
  const BusSocket bus("vcan0");
  auto player = std::make_unique<Process>(canplayer(log, "vcan0", true));
  Process daemon(argv());
  ASSERT_TRUE(daemon.wait_for_error("-> Ramping", kLimit)) << daemon.err();
  configure(kOtherStatus);
  daemon.signal(SIGHUP);
  ASSERT_TRUE(daemon.wait_for_error("waits for the end of the experiment", kLimit)) << daemon.err();
  const BusSocket during("vcan0");
  ASSERT_TRUE(sees(during, 0x6A3));
  EXPECT_EQ(daemon.err().find("is in force"), std::string::npos) << daemon.err();
  player.reset();
  bus.send(kState, {0, 0, 0, 0});
  EXPECT_TRUE(daemon.wait_for_error("is in force", kLimit)) << daemon.err();
  EXPECT_LT(daemon.err().find("stop reason"), daemon.err().find("is in force")) << daemon.err();
  const BusSocket after("vcan0");
  EXPECT_TRUE(sees(after, kOtherStatus));
}

// A load of frames, and an identifier that changes each time: the last one is in force in the end,
// nothing was missed for long, and the memory has not grown.
TEST_F(Reloading, AHundredInARowUnderLoad) {
  configure(0x6A3);
  const Process load({"cangen", "vcan0", "-g", "2", "-I", "110", "-L", "8", "-D", "r"});
  Process daemon(argv());
  ASSERT_TRUE(daemon.wait_for_error("fault", kLimit)) << daemon.err();
  const auto resident_kB = [&] {
    std::ifstream status("/proc/" + std::to_string(daemon.pid()) + "/status");
    for (std::string line; std::getline(status, line);) {
      if (line.starts_with("VmRSS:")) return std::stol(line.substr(6));
    }
    return 0L;
  };
  long before_kB = 0;
  for (int i = 1; i <= 100; ++i) {
    configure(i % 2 == 1 ? kOtherStatus : canid_t{0x6A3});
    daemon.signal(SIGHUP);
    const auto in_force = [&](const Process& seen) {
      int count = 0;
      for (std::size_t at = 0; (at = seen.err().find("is in force", at)) != std::string::npos; ++at)
        ++count;
      return count >= i;
    };
    ASSERT_TRUE(daemon.wait_until(in_force, kLimit)) << daemon.err();
    if (i == 20) before_kB = resident_kB();
  }
  EXPECT_LE(resident_kB(), before_kB + 2048);
  // And in a burst, which is one or a few.
  configure(kOtherStatus);
  for (int i = 0; i < 100; ++i) daemon.signal(SIGHUP);
  const BusSocket bus("vcan0");
  EXPECT_TRUE(sees(bus, kOtherStatus)) << daemon.err();
  EXPECT_EQ(daemon.err().find("refused, the old"), std::string::npos) << daemon.err();
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(kStopLimit), 0) << daemon.err();
}

TEST_F(Reloading, TheLogSaysMoreOrLessOnASignal) {
  configure(0x6A3);
  Process daemon(argv());
  ASSERT_TRUE(daemon.wait_for_error("fault", kLimit)) << daemon.err();
  EXPECT_EQ(daemon.err().find("samples, "), std::string::npos);
  daemon.signal(SIGUSR1);
  EXPECT_TRUE(daemon.wait_for_error("log level debug", kLimit)) << daemon.err();
  EXPECT_TRUE(daemon.wait_for_error(" frames taken", kLimit)) << daemon.err();
  daemon.signal(SIGUSR2);
  EXPECT_TRUE(daemon.wait_for_error("log level info", kLimit)) << daemon.err();
  daemon.signal(SIGUSR2);
  EXPECT_TRUE(daemon.wait_for_error("log level warning", kLimit)) << daemon.err();
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(kStopLimit), 0);
  EXPECT_EQ(daemon.err().find("stopped: "), std::string::npos) << "an info line";
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
