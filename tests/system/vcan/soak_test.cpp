// The daemon on a busy bus for a long time, in real time, while it is told to reload, its interface
// goes down and the disk under its state folder is full: it goes on measuring, loses no frame, and
// memory, descriptors and threads stay what they were. BELTGRIP_SOAK_S=1800 makes half an hour of
// it, BELTGRIP_SOAK_GAP_MS=0.25 a bus of 4,000 foreign frames a second.
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/mount.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>

#include "tests/system/vcan/rig.h"
#include "tests/system/vcan/watch.h"

namespace beltgrip::test {
namespace {

constexpr double kMuMax = 0.105;
constexpr long kMemory_kB = 256;  // that it may be larger in the second half of the time

struct Holdings {
  long memory_kB = 0, threads = 0, descriptors = 0;
};

Holdings holdings_of(pid_t pid) {
  const std::string process = "/proc/" + std::to_string(pid);
  Holdings out;
  std::ifstream status(process + "/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with("VmRSS:")) out.memory_kB = std::atol(line.c_str() + 6);
    if (line.starts_with("Threads:")) out.threads = std::atol(line.c_str() + 8);
  }
  out.descriptors = std::distance(std::filesystem::directory_iterator(process + "/fd"),
                                  std::filesystem::directory_iterator());
  return out;
}

using Held = std::vector<Holdings>::const_iterator;
Holdings most(Held begin, Held end) {
  Holdings out;
  for (; begin != end; ++begin) {
    out.memory_kB = std::max(out.memory_kB, begin->memory_kB);
    out.threads = std::max(out.threads, begin->threads);
    out.descriptors = std::max(out.descriptors, begin->descriptors);
  }
  return out;
}

std::string variable(const char* name, const char* otherwise) {
  const char* given = std::getenv(name);
  return given != nullptr ? given : otherwise;
}

class Soak : public Vcan {
 protected:
  void SetUp() override {
    ASSERT_NO_FATAL_FAILURE(Vcan::SetUp());
    const std::string scenario = BELTGRIP_SOURCE_DIR "/tests/system/vcan/downhill.toml";
    const RunResult made = run({program("beltgrip"), "simulate", "--scenario", scenario,
                                "--duration", "0.2", "--out-dir", folder() + "/car"},
                               kLimit);
    ASSERT_EQ(made.status, 0) << made.err;
    // A disk of its own, seen by this program and its children alone.
    state_ = folder() + "/state";
    std::filesystem::create_directory(state_);
    ASSERT_EQ(unshare(CLONE_NEWNS), 0);
    ASSERT_EQ(mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr), 0);
    ASSERT_EQ(mount("tmpfs", state_.c_str(), "tmpfs", 0, "size=2m"), 0);
    config_ = folder() + "/car/beltgrip.toml";
    std::ofstream(config_, std::ios::app) << "\n[daemon]\nstate_dir = \"" << state_ << "\"\n";
    vehicle_ = std::make_unique<Process>(std::vector<std::string>{
        program("beltgrip"), "simulate", "--scenario", scenario, "--bus", "vcan0"});
  }
  void TearDown() override {
    vehicle_.reset();
    umount2(state_.c_str(), MNT_DETACH);
    Vcan::TearDown();
  }

  // The next value of an experiment, and nothing wrong on the way to it.
  void expect_value(const BusSocket& bus, Process& beltgripd) {
    Watch watch;
    ASSERT_TRUE(watch.until(bus, asks)) << beltgripd.err();
    ASSERT_TRUE(watch.until(bus, [](const Watch& now) { return !now.asking(); }))
        << beltgripd.err();
    ASSERT_TRUE(watch.until(bus, has_value)) << beltgripd.err();
    EXPECT_NEAR(watch.estimate("MuMax"), kMuMax, 0.04 * kMuMax);
    EXPECT_EQ(watch.status("FaultFramesLost"), 0.0);
    EXPECT_EQ(watch.published.problems(), std::vector<std::string>{});
    ++values_;
  }

  static std::string said(Process& process) {
    process.wait(Milliseconds(0));
    return process.err();
  }

  std::string state_, config_;
  std::unique_ptr<Process> vehicle_;
  int values_ = 0;
};

TEST_F(Soak, MeasuresOnThroughReloadsAnInterfaceThatGoesDownAndAFullDisk) {
  const std::chrono::seconds wanted(std::stol(variable("BELTGRIP_SOAK_S", "30")));
  const std::string gap_ms = variable("BELTGRIP_SOAK_GAP_MS", "0.5");
  const auto end = std::chrono::steady_clock::now() + wanted;
  Process beltgripd({program("beltgripd"), "--config", config_, "--record", state_ + "/record"});
  // At the end of each round; now and then a record is just being written, and open.
  std::vector<Holdings> held;
  do {
    {
      const BusSocket bus("vcan0");
      const Process load({"cangen", "vcan0", "-g", gap_ms, "-I", "050", "-L", "8", "-D", "r"});
      ASSERT_NO_FATAL_FAILURE(expect_value(bus, beltgripd));
      beltgripd.signal(SIGHUP);
      ASSERT_NO_FATAL_FAILURE(expect_value(bus, beltgripd));
      std::ofstream full(state_ + "/ballast", std::ios::binary);
      const std::string block(4096, 'x');
      while (full.write(block.data(), static_cast<std::streamsize>(block.size())).flush()) {
      }
      full.close();
      ASSERT_NO_FATAL_FAILURE(expect_value(bus, beltgripd));
      std::filesystem::remove(state_ + "/ballast");
    }
    ASSERT_NO_FATAL_FAILURE(ip({"link", "set", "vcan0", "down"}));
    ASSERT_NO_FATAL_FAILURE(ip({"link", "set", "vcan0", "up"}));
    {
      const BusSocket bus("vcan0");
      ASSERT_NO_FATAL_FAILURE(expect_value(bus, beltgripd));
    }
    held.push_back(holdings_of(beltgripd.pid()));
  } while (std::chrono::steady_clock::now() < end);
  const auto middle = held.begin() + static_cast<std::ptrdiff_t>((held.size() + 1) / 2);
  const Holdings first = most(held.begin(), middle);
  const Holdings last = most(held.begin(), held.end());
  beltgripd.signal(SIGTERM);
  EXPECT_EQ(beltgripd.wait(kLimit), 0) << beltgripd.err();
  EXPECT_LE(last.memory_kB, first.memory_kB + kMemory_kB);
  EXPECT_EQ(last.threads, first.threads);
  EXPECT_EQ(last.descriptors, first.descriptors);
  vehicle_->signal(SIGTERM);
  EXPECT_EQ(vehicle_->wait(kLimit), 0) << vehicle_->err();
  const auto truth = nlohmann::json::parse(vehicle_->out());
  EXPECT_EQ(truth.at("requests_outside_limits"), 0) << truth.dump(1);
  std::printf(
      "%zu rounds of a reload, a full disk and an interface that went down, %d values; memory %ld "
      "-> %ld "
      "kB, descriptors %ld -> %ld, threads %ld -> %ld; no frame lost of a bus with one every %s "
      "ms\n",
      held.size(), values_, first.memory_kB, last.memory_kB, first.descriptors, last.descriptors,
      first.threads, last.threads, gap_ms.c_str());
}

}  // namespace
}  // namespace beltgrip::test
