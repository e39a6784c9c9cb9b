// beltgripd and `beltgrip can` on the driver of a real CAN controller: bit timing, restart time and
// error counters through netlink and libsocketcan, frames from one SJA1000 to the other, a card
// that is pulled out and put back. In the emulated machine: tests/system/qemu/run
// build/tests/sja1000_test
#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>

#include "tests/support/assertions.h"
#include "tests/system/vcan/rig.h"

namespace beltgrip::test {
namespace {

RunResult can(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), {program("beltgrip"), "can"});
  return run(arguments, kLimit);
}

void up(const std::string& interface) {
  const RunResult result = can({"up", interface, "--bitrate", "500000", "--restart-ms", "100"});
  ASSERT_EQ(result.status, 0) << result.err;
  ASSERT_EQ(result.err, "");
}

nlohmann::json status(const std::string& interface) {
  const RunResult result = can({"status", interface, "--json"});
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_EQ(result.err, "");
  return nlohmann::json::parse(result.out);
}

class Sja1000 : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(std::filesystem::exists("/sys/class/net/can1/device"))
        << "tests/system/qemu/run has two";
    std::string name = std::filesystem::temp_directory_path() / "beltgrip_sja1000.XXXXXX";
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  void TearDown() override {
    can({"down", "can0"});
    can({"down", "can1"});
    if (!folder_.empty()) std::filesystem::remove_all(folder_);
  }
  std::unique_ptr<Process> daemon() const {
    return std::make_unique<Process>(std::vector<std::string>{program("beltgripd"), "--config",
                                                              write_rig_config(folder_, "can0")});
  }
  const std::string& folder() const { return folder_; }

 private:
  std::string folder_;
};

TEST_F(Sja1000, WhatIsSetIsWhatTheControllerSays) {
  ASSERT_EQ(status("can0").at("up"), false);
  const RunResult result = can({"up", "can0", "--bitrate", "250000", "--sample-point", "0.75",
                                "--restart-ms", "50", "--queue-length", "32"});
  ASSERT_EQ(result.status, 0) << result.err;
  nlohmann::json shown = status("can0");
  EXPECT_EQ(shown.at("up"), true);
  EXPECT_EQ(shown.at("controller"), true);
  EXPECT_EQ(shown.at("state"), "error-active");
  EXPECT_EQ(shown.at("bit_timing").at("bitrate"), 250000);
  EXPECT_EQ(shown.at("bit_timing").at("sample_point"), 0.75);
  EXPECT_EQ(shown.at("restart_ms"), 50);
  EXPECT_EQ(shown.at("queue_length"), 32);
  EXPECT_EQ(shown.at("error_counters").at("transmit"), 0);
  EXPECT_EQ(shown.at("error_counters").at("receive"), 0);
  EXPECT_EQ(shown.at("controller_counters").at("bus_offs"), 0);
  // Up already: it is taken down for the new timing and comes up again.
  EXPECT_EQ(can({"up", "can0", "--bitrate", "500000"}).status, 0);
  shown = status("can0");
  EXPECT_EQ(shown.at("bit_timing").at("bitrate"), 500000);
  EXPECT_EQ(shown.at("restart_ms"), 50) << "what is not given stays";
  EXPECT_EQ(can({"down", "can0"}).status, 0);
  EXPECT_EQ(status("can0").at("up"), false);
}

TEST_F(Sja1000, ABitRateThatItsClockCannotMakeIsOneClearLine) {
  const RunResult result = can({"up", "can0", "--bitrate", "8000000"});
  EXPECT_EQ(result.status, 69);
  EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
  EXPECT_NE(result.err.find("can0"), std::string::npos) << result.err;
  EXPECT_NE(result.err.find("8000000"), std::string::npos) << result.err;
}

TEST_F(Sja1000, FramesComeFromOneControllerAndEstimatesGoBackToIt) {
  ASSERT_NO_FATAL_FAILURE(up("can0"));
  ASSERT_NO_FATAL_FAILURE(up("can1"));
  const BusSocket far("can1");
  const std::unique_ptr<Process> running = daemon();
  Process player(canplayer(write_steady_log(folder()), "can1", true));
  EXPECT_TRUE(running->wait_for_error("-> Ramping", kLimit)) << running->err();
  PublishedFrames published;
  EXPECT_TRUE(listen(far, published, [](const PublishedFrames& seen) {
    return seen.of("BeltGripStatus").size() > 1 && seen.of("BeltGripEstimate").size() > 1;
  })) << running->err();
  EXPECT_GT(status("can0").at("frames").at("received"), 100);
  player.signal(SIGTERM);
  running->signal(SIGTERM);
  EXPECT_EQ(running->wait(kLimit), 0);
}

TEST_F(Sja1000, ACardThatIsPulledOutAndPutBack) {
  ASSERT_NO_FATAL_FAILURE(up("can0"));
  ASSERT_NO_FATAL_FAILURE(up("can1"));
  const std::unique_ptr<Process> running = daemon();
  ASSERT_TRUE(running->wait_for_error("InputMissing", kLimit)) << running->err();
  std::ofstream("/sys/class/net/can0/device/remove") << "1" << std::flush;
  EXPECT_TRUE(running->wait_for_error("fault BusDown", kLimit)) << running->err();
  std::ofstream("/sys/bus/pci/rescan") << "1" << std::flush;
  ASSERT_TRUE(std::filesystem::exists("/sys/class/net/can0"));
  ASSERT_NO_FATAL_FAILURE(up("can0"));
  EXPECT_TRUE(running->wait_for_error("fault BusDown gone", kLimit)) << running->err();
  const BusSocket far("can1");
  PublishedFrames published;
  EXPECT_TRUE(listen(far, published, [](const PublishedFrames& seen) {
    return seen.of("BeltGripStatus").size() > 0;
  })) << running->err();
  running->signal(SIGTERM);
  EXPECT_EQ(running->wait(kLimit), 0);
}

}  // namespace
}  // namespace beltgrip::test
