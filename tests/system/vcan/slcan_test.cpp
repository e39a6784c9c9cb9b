// beltgripd and `beltgrip can` on a CAN controller that the test steers: bit rate, warning,
// passive, bus-off in the middle of an experiment and the traffic after it, a queue that is full,
// and an adapter that is pulled out. In user-mode Linux: VCAN_BACKEND=uml tests/system/vcan/run
// build/tests/slcan_test
#include <fcntl.h>
#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>

#include "tests/support/assertions.h"
#include "tests/system/vcan/rig.h"
#include "tests/system/vcan/slcan_adapter.h"
#include "tests/system/vcan/watch.h"

namespace beltgrip::test {
namespace {

// The rig's frames at a steady operating point, 200 times a second, as a node on the bus sends
// them.
class Node {
 public:
  explicit Node(SlcanAdapter& adapter)
      : thread_([this, &adapter] {
          auto next = std::chrono::steady_clock::now();
          while (!ending_) {
            for (const char* line :
                 {"t11083E808B6000000000", "t1206C40900000000", "t1306A00FA00F0000"}) {
              if (!silent_) adapter.say(line);
            }
            next += Milliseconds(5);
            std::this_thread::sleep_until(next);
          }
        }) {}
  ~Node() {
    ending_ = true;
    thread_.join();
  }
  Node(const Node&) = delete;
  Node& operator=(const Node&) = delete;
  void silence(bool silent) { silent_ = silent; }

 private:
  std::atomic<bool> ending_{false}, silent_{false};
  std::thread thread_;
};

class Controller : public testing::Test {
 protected:
  void SetUp() override {
    // The driver makes its interfaces in the first namespace: this test lives there.
    ASSERT_EQ(run({"modprobe", "slcan"}, kLimit).status, 0);
    const int first = open("/proc/1/ns/net", O_RDONLY | O_CLOEXEC);
    ASSERT_EQ(setns(first, CLONE_NEWNET), 0);
    close(first);
    adapter_ = std::make_unique<SlcanAdapter>();
    std::string name = std::filesystem::temp_directory_path() / "beltgrip_slcan.XXXXXX";
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  void TearDown() override {
    if (!folder_.empty()) std::filesystem::remove_all(folder_);
  }
  const std::string& interface() const { return adapter_->interface(); }
  RunResult can(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), {program("beltgrip"), "can"});
    return run(arguments, kLimit);
  }
  void up() const {
    const RunResult result = can({"up", interface(), "--bitrate", "500000"});
    ASSERT_EQ(result.status, 0) << result.err;
    ASSERT_EQ(result.err, "");
  }
  nlohmann::json status() const {
    const RunResult result = can({"status", interface(), "--json"});
    EXPECT_EQ(result.status, 0) << result.err;
    EXPECT_EQ(result.err, "");
    return nlohmann::json::parse(result.out);
  }
  std::unique_ptr<Process> daemon() const {
    return std::make_unique<Process>(std::vector<std::string>{
        program("beltgripd"), "--config", write_rig_config(folder_, interface())});
  }
  // The scenario's own configuration, with this interface.
  std::string vehicle_config(const std::string& scenario) const {
    const RunResult made = run({program("beltgrip"), "simulate", "--scenario", scenario,
                                "--duration", "0.2", "--out-dir", folder_},
                               kLimit);
    EXPECT_EQ(made.status, 0) << made.err;
    const std::string path = folder_ + "/beltgrip.toml";
    std::stringstream text;
    text << std::ifstream(path).rdbuf();
    std::string toml = text.str();
    const std::string given = "\"vcan0\"";
    toml.replace(toml.find(given), given.size(), '"' + interface() + '"');
    std::ofstream(path) << toml;
    return path;
  }
  // Frames of BeltGrip's status leave through the adapter.
  bool publishes() const {
    adapter_->forget();
    return adapter_->wait(
        [](const std::vector<std::string>& lines) {
          return std::any_of(lines.begin(), lines.end(),
                             [](const std::string& line) { return line.starts_with("t6A38"); });
        },
        kLimit);
  }
  SlcanAdapter& adapter() const { return *adapter_; }
  void unplug() { adapter_.reset(); }

 private:
  std::unique_ptr<SlcanAdapter> adapter_;
  std::string folder_;
};

TEST_F(Controller, UpStatusDown) {
  EXPECT_EQ(status().at("up"), false);
  ASSERT_NO_FATAL_FAILURE(up());
  // S6 sets 500 kbit/s, O opens the channel.
  EXPECT_TRUE(adapter().wait(
      [](const std::vector<std::string>& lines) {
        return std::find(lines.begin(), lines.end(), "S6") != lines.end() &&
               std::find(lines.begin(), lines.end(), "O") != lines.end();
      },
      kLimit));
  const nlohmann::json shown = status();
  EXPECT_EQ(shown.at("up"), true);
  EXPECT_EQ(shown.at("controller"), true);
  EXPECT_EQ(shown.at("state"), "error-active");
  EXPECT_EQ(shown.at("bit_timing").at("bitrate"), 500000);
  EXPECT_EQ(shown.at("error_counters"), nullptr) << "this driver has none to say";
  EXPECT_TRUE(shown.at("controller_counters").is_object());
  const RunResult text = can({"status", interface()});
  EXPECT_NE(text.out.find("error-active"), std::string::npos) << text.out;
  EXPECT_NE(text.out.find("500000 bit/s"), std::string::npos) << text.out;
  // Up already: a new bit rate takes it down and up again.
  EXPECT_EQ(can({"up", interface(), "--bitrate", "250000"}).status, 0);
  EXPECT_EQ(status().at("bit_timing").at("bitrate"), 250000);
  EXPECT_EQ(can({"down", interface()}).status, 0);
  EXPECT_EQ(status().at("up"), false);
}

TEST_F(Controller, WhatTheDriverCannotDoIsOneClearLine) {
  for (const auto& what : {std::vector<std::string>{"--bitrate", "123456"},
                           std::vector<std::string>{"--restart-ms", "100"}}) {
    std::vector<std::string> arguments{"up", interface()};
    arguments.insert(arguments.end(), what.begin(), what.end());
    const RunResult result = can(arguments);
    EXPECT_EQ(result.status, 69) << what[0];
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
    EXPECT_NE(result.err.find("refused"), std::string::npos) << result.err;
  }
}

TEST_F(Controller, WarningPassiveAndActiveAgain) {
  ASSERT_NO_FATAL_FAILURE(up());
  const Node node(adapter());
  const std::unique_ptr<Process> running = daemon();
  ASSERT_TRUE(running->wait_for_error("-> Ramping", kLimit)) << running->err();
  adapter().say("sw100000");
  adapter().say("sp128000");
  EXPECT_TRUE(running->wait_for_error("fault BusPassive", kLimit)) << running->err();
  EXPECT_EQ(status().at("state"), "error-passive");
  adapter().say("sa000000");
  EXPECT_TRUE(running->wait_for_error("fault BusPassive gone", kLimit)) << running->err();
  EXPECT_EQ(status().at("state"), "error-active");
  EXPECT_TRUE(publishes());
}

TEST_F(Controller, BusOffEndsTheExperimentAndTrafficResumesAfterwards) {
  ASSERT_NO_FATAL_FAILURE(up());
  Node node(adapter());
  const std::unique_ptr<Process> running = daemon();
  ASSERT_TRUE(running->wait_for_error("-> Ramping", kLimit)) << running->err();
  ASSERT_TRUE(publishes());
  node.silence(true);  // nobody hears anybody
  adapter().say("sb256000");
  EXPECT_TRUE(running->wait_for_error("fault BusOff", kLimit)) << running->err();
  EXPECT_TRUE(running->wait_for_error("experiment Aborted, stop reason Bus", kLimit))
      << running->err();
  EXPECT_EQ(status().at("state"), "bus-off");
  // What an operator does where the controller cannot restart by itself.
  adapter().say("sa000000");
  ASSERT_EQ(can({"down", interface()}).status, 0);
  ASSERT_NO_FATAL_FAILURE(up());
  node.silence(false);
  EXPECT_TRUE(running->wait_for_error("fault BusOff gone", kLimit)) << running->err();
  EXPECT_TRUE(publishes());
  running->signal(SIGTERM);
  EXPECT_EQ(running->wait(kLimit), 0);
}

// The virtual vehicle is the bus's other node and obeys; its own account of its belt is the judge.
TEST_F(Controller, BusOffEndsARequestAndAnotherOneComesThrough) {
  SlcanAdapter vehicles;
  const std::string scenario = BELTGRIP_SOURCE_DIR "/tests/system/vcan/downhill.toml";
  ASSERT_EQ(
      can({"up", vehicles.interface(), "--bitrate", "500000", "--queue-length", "1000"}).status, 0);
  // Long enough for a guest that stands still now and then; a queue that is full is another test.
  ASSERT_EQ(can({"up", interface(), "--bitrate", "500000", "--queue-length", "1000"}).status, 0);
  SlcanAdapter::join(adapter(), vehicles);
  const std::string config = vehicle_config(scenario);
  const BusSocket far(vehicles.interface());
  Process vehicle(
      {program("beltgrip"), "simulate", "--scenario", scenario, "--bus", vehicles.interface()});
  Process running({program("beltgripd"), "--config", config});
  Watch before;
  // In the midst of a request: half a second of it has been on the bus.
  ASSERT_TRUE(before.until(far, [](const Watch& now) { return active_at_end(now) >= 50; }))
      << running.err();

  adapter().cut_off(true);
  adapter().say("sb256000");
  EXPECT_TRUE(running.wait_for_error("experiment Aborted, stop reason Bus", kLimit))
      << running.err();
  EXPECT_EQ(status().at("state"), "bus-off");
  adapter().say("sa000000");
  ASSERT_EQ(can({"down", interface()}).status, 0);
  adapter().cut_off(false);
  ASSERT_NO_FATAL_FAILURE(up());
  EXPECT_TRUE(running.wait_for_error("fault BusOff gone", kLimit)) << running.err();

  // It asks again, and the vehicle hears it.
  const BusSocket again(vehicles.interface());
  Watch after;
  ASSERT_TRUE(after.until(again, asks)) << running.err();
  running.signal(SIGTERM);
  EXPECT_EQ(running.wait(kLimit), 0);
  vehicle.signal(SIGTERM);
  ASSERT_EQ(vehicle.wait(kLimit), 0) << vehicle.err();
  const auto truth = nlohmann::json::parse(vehicle.out());
  EXPECT_EQ(truth.at("requests_outside_limits"), 0) << truth.dump(1);
  EXPECT_GE(truth.at("requests").size(), 1U) << truth.dump(1);
}

TEST_F(Controller, AFullQueueIsAFaultAndPasses) {
  ASSERT_NO_FATAL_FAILURE(up());
  const Node node(adapter());
  const std::unique_ptr<Process> running = daemon();
  ASSERT_TRUE(running->wait_for_error("-> Ramping", kLimit)) << running->err();
  adapter().stick(true);
  EXPECT_TRUE(running->wait_for_error("fault SendFailed", kLimit)) << running->err();
  adapter().stick(false);
  EXPECT_TRUE(running->wait_for_error("fault SendFailed gone", kLimit)) << running->err();
  EXPECT_TRUE(publishes());
}

TEST_F(Controller, PulledOutItIsDownAndTheDaemonStillStops) {
  ASSERT_NO_FATAL_FAILURE(up());
  const std::unique_ptr<Process> running = daemon();
  ASSERT_TRUE(publishes()) << running->err();
  unplug();
  EXPECT_TRUE(running->wait_for_error("fault BusDown", kLimit)) << running->err();
  running->signal(SIGTERM);
  EXPECT_EQ(running->wait(kLimit), 0);
}

}  // namespace
}  // namespace beltgrip::test
