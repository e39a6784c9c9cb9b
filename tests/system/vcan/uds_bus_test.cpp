// The pressure from diagnostics, polled by beltgripd on a second vcan: an ECU of the test answers
// with what the rig broadcasts on the first. Losses, refusals, a silent ECU, another tester, the
// second interface going away. Plain frames on both sides; the kernel's ISO-TP as the ECU's side:
// tests/system/qemu/isotp_test.cpp.
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <csignal>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>

#include "tests/system/vcan/uds_rig.h"

namespace beltgrip::test {
namespace {

using nlohmann::json;

constexpr canid_t kRequest = kUdsRequest, kAnswer = kUdsAnswer, kRigPressure = 0x130;
const std::vector<std::uint8_t> kPoll{0x03, 0x22, 0x11, 0x01, 0xCC, 0xCC, 0xCC, 0xCC};

// An ECU on vcan1 in a thread of its own. It knows the pressure from the rig's broadcast.
class Ecu {
 public:
  enum class Mood { kAnswers, kLong, kSilent, kRefuses, kBusy, kPending, kLosesEveryFourth };
  explicit Ecu(Mood mood) : mood_(mood), thread_([this] { run(); }) {}
  ~Ecu() {
    stop_ = true;
    thread_.join();
  }
  void become(Mood mood) { mood_ = mood; }
  int requests() const { return requests_; }
  int flow_controls() const { return flow_controls_; }
  int strange() const { return strange_; }  // frames on its bus that it has no name for

 private:
  void run() {
    const BusSocket rig("vcan0"), bus("vcan1");
    while (!stop_) {
      while (const auto seen = rig.receive(Milliseconds{0})) {
        if (seen->frame.can_id != kRigPressure) continue;
        low_ = seen->frame.data[0];
        high_ = seen->frame.data[1];
      }
      const auto seen = bus.receive(Milliseconds{1});
      if (seen) take(bus, *seen);
    }
  }
  void take(const BusSocket& bus, const ReceivedFrame& seen) {
    const std::vector<std::uint8_t> bytes(seen.frame.data, seen.frame.data + seen.frame.len);
    if (seen.frame.can_id == kRequest && bytes == kPoll) {
      const int number = ++requests_;
      switch (mood_) {
        case Mood::kSilent:
          return;
        case Mood::kRefuses:
          return bus.send(kAnswer, {0x03, 0x7F, 0x22, 0x31});
        case Mood::kBusy:
          return bus.send(kAnswer, {0x03, 0x7F, 0x22, 0x21});
        case Mood::kPending:
          bus.send(kAnswer, {0x03, 0x7F, 0x22, 0x78});
          break;
        case Mood::kLosesEveryFourth:
          if (number % 4 == 0) return;
          break;
        case Mood::kLong:  // 11 bytes
          return bus.send(kAnswer, {0x10, 0x0B, 0x62, 0x11, 0x01, low_, high_, 0xAA});
        case Mood::kAnswers:
          break;
      }
      bus.send(kAnswer, {0x05, 0x62, 0x11, 0x01, low_, high_, 0xAA, 0xAA});
    } else if (seen.frame.can_id == kRequest && bytes[0] == 0x30) {
      ++flow_controls_;
      bus.send(kAnswer, {0x21, 1, 2, 3, 4, 5});
    } else {
      ++strange_;
    }
  }

  std::atomic<Mood> mood_;
  std::atomic<bool> stop_{false};
  std::atomic<int> requests_{0}, flow_controls_{0}, strange_{0};
  std::uint8_t low_ = 0xFF, high_ = 0xFF;  // not available
  std::thread thread_;
};

using Mood = Ecu::Mood;

std::string text_of(const std::string& path) {
  std::ifstream file(path);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

class Diagnostics : public Vcan {
 protected:
  void SetUp() override {
    Vcan::SetUp();
    add_interface("vcan1");
  }
  std::vector<std::string> steady_daemon(bool polls) const {
    return {program("beltgripd"), "--config",
            take_pressure_from_uds(write_rig_config(folder(), "vcan0"), polls)};
  }
  std::vector<std::string> steady_rig() const {
    return canplayer(write_steady_log(folder()), "vcan0", true);
  }
};

auto status_count(std::size_t count) {
  return [count](const PublishedFrames& published) {
    return published.of("BeltGripStatus").size() >= count;
  };
}

// Every 100 ms, and at a result.
auto estimate_count(std::size_t count) {
  return [count](const PublishedFrames& published) {
    return published.of("BeltGripEstimate").size() >= count;
  };
}

TEST_F(Diagnostics, ThePapersExperimentWithPolledPressure) {
  const RunResult simulated = run({program("beltgrip"), "simulate", "--scenario", "paper-rig",
                                   "--out-dir", folder(), "--start", "86", "--duration", "10"},
                                  kLimit);
  ASSERT_EQ(simulated.status, 0) << simulated.err;
  const double mu_max = json::parse(text_of(folder() + "/truth.json")).at("mu_max");
  const BusSocket bus("vcan0");
  const Ecu ecu(Mood::kLong);
  Process daemon({program("beltgripd"), "--config",
                  take_pressure_from_uds(folder() + "/beltgrip.toml", true)});
  PublishedFrames published;
  ASSERT_TRUE(listen(bus, published, status_count(1)));
  Process player(canplayer(folder() + "/trace.log", "vcan0"));
  ASSERT_TRUE(listen(bus, published, [](const PublishedFrames& seen) {
    const auto estimate = seen.last("BeltGripEstimate").signals;
    return !estimate.empty() && estimate.at("MuMaxValid") == 1;
  })) << daemon.err();
  EXPECT_NEAR(published.last("BeltGripEstimate").signals.at("MuMax"), mu_max, 0.02 * mu_max);
  EXPECT_EQ(published.problems(), std::vector<std::string>{});
  EXPECT_GT(ecu.flow_controls(), 50);
  EXPECT_EQ(ecu.strange(), 0);
  EXPECT_FALSE(is_set(published, "FaultFrameRefused"));
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(kLimit), 0);
  RecordProperty("mu_max", std::to_string(published.last("BeltGripEstimate").signals.at("MuMax")));
}

TEST_F(Diagnostics, NothingIsAskedWithoutAllowanceAndAnotherTestersAnswersCount) {
  const BusSocket bus("vcan0");
  const Ecu ecu(Mood::kAnswers);
  const Process player(steady_rig());
  const Process daemon(steady_daemon(false));
  PublishedFrames published;
  ASSERT_TRUE(listen(bus, published, status_count(3)));
  EXPECT_TRUE(is_set(published, "FaultInputMissing"));
  EXPECT_EQ(ecu.requests(), 0);
  EXPECT_EQ(ecu.strange(), 0);
  // Now somebody asks.
  const BusSocket tester("vcan1");
  ASSERT_TRUE(listen(bus, published, [&](const PublishedFrames& seen) {
    if (seen.of("BeltGripSlip").size() % 2 == 0) tester.send(kRequest, kPoll);
    return pressure_valid(seen);
  }));
  EXPECT_GT(ecu.requests(), 0);
}

TEST_F(Diagnostics, LossesAndRefusalsAreNoValueAndNoFlood) {
  const BusSocket bus("vcan0");
  Ecu ecu(Mood::kSilent);
  const Process player(steady_rig());
  const Process daemon(steady_daemon(true));
  PublishedFrames published;
  // 2.5 s, in which it is asked after 0, 0.2, 0.45, 0.8, 1.35 and 2.3 s.
  ASSERT_TRUE(listen(bus, published, estimate_count(25)));
  EXPECT_TRUE(is_set(published, "FaultInputMissing"));
  EXPECT_GE(ecu.requests(), 3);
  EXPECT_LE(ecu.requests(), 9);
  ecu.become(Mood::kPending);
  ASSERT_TRUE(listen(bus, published, pressure_valid));
  ecu.become(Mood::kBusy);
  ASSERT_TRUE(listen(bus, published,
                     [](const PublishedFrames& seen) { return is_set(seen, "FaultInputStale"); }));
  ecu.become(Mood::kLosesEveryFourth);
  ASSERT_TRUE(listen(bus, published, pressure_valid));
  ecu.become(Mood::kRefuses);
  ASSERT_TRUE(listen(bus, published,
                     [](const PublishedFrames& seen) { return is_set(seen, "FaultInputStale"); }));
  const int asked = ecu.requests();
  const std::size_t estimates = published.of("BeltGripEstimate").size();
  ASSERT_TRUE(listen(bus, published, estimate_count(estimates + 20)));
  EXPECT_LE(ecu.requests(), asked + 1);  // not for a minute
  EXPECT_EQ(ecu.strange(), 0);
  EXPECT_FALSE(is_set(published, "FaultFrameRefused"));
  EXPECT_EQ(published.problems(), std::vector<std::string>{});
}

TEST_F(Diagnostics, AnotherTesterHasTheRightOfWay) {
  const BusSocket bus("vcan0");
  const Ecu ecu(Mood::kAnswers);
  const Process player(steady_rig());
  const Process daemon(steady_daemon(true));
  PublishedFrames published;
  ASSERT_TRUE(listen(bus, published, pressure_valid));
  const BusSocket tester("vcan1");
  tester.send(kRequest, {0x03, 0x22, 0xF1, 0x90});
  const auto sent = std::chrono::steady_clock::now();
  // What the daemon had sent before it saw the tester is still on its way here.
  std::optional<ReceivedFrame> asked;
  do {
    asked = tester.receive_until(
        [](const ReceivedFrame& seen) { return seen.frame.can_id == kRequest; }, kLimit);
    ASSERT_TRUE(asked.has_value());
  } while (std::chrono::steady_clock::now() - sent < Milliseconds{500});
  EXPECT_GE(std::chrono::steady_clock::now() - sent, Milliseconds{4900});
  ASSERT_TRUE(listen(bus, published, pressure_valid));
}

TEST_F(Diagnostics, TheSecondInterfaceGoesAndComesBack) {
  const BusSocket bus("vcan0");
  const Ecu ecu(Mood::kAnswers);
  const Process player(steady_rig());
  Process daemon(steady_daemon(true));
  PublishedFrames published;
  ASSERT_TRUE(listen(bus, published, pressure_valid));
  ASSERT_NO_FATAL_FAILURE(ip({"link", "set", "vcan1", "down"}));
  ASSERT_TRUE(listen(bus, published,
                     [](const PublishedFrames& seen) { return is_set(seen, "FaultBusDown"); }));
  ASSERT_NO_FATAL_FAILURE(ip({"link", "set", "vcan1", "up"}));
  ASSERT_TRUE(listen(bus, published, [](const PublishedFrames& seen) {
    return pressure_valid(seen) && !is_set(seen, "FaultBusDown");
  }));
  EXPECT_EQ(published.problems(), std::vector<std::string>{});
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(kLimit), 0);
}

TEST_F(Diagnostics, ASecondInterfaceThatIsMissingIsNamed) {
  ASSERT_NO_FATAL_FAILURE(ip({"link", "delete", "vcan1"}));
  const RunResult result = run(steady_daemon(true), kLimit);
  EXPECT_EQ(result.status, 69);
  EXPECT_NE(result.err.find("bus.diag.interface: found no CAN interface \"vcan1\""),
            std::string::npos)
      << result.err;
}

}  // namespace
}  // namespace beltgrip::test
