// Files and folders that the programs may not read or write: each is one line with its name and the
// reason.
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>

#include "tests/daemon/test_vehicle.h"
#include "tests/support/program.h"

namespace beltgrip::test {
namespace {

// Generous: it only ends a test that has already failed.
constexpr Milliseconds kLimit{30000};

long count(const std::string& text, const std::string& wanted) {
  long found = 0;
  for (std::size_t at = 0; (at = text.find(wanted, at)) != std::string::npos; ++at) ++found;
  return found;
}

class Permissions : public testing::Test {
 protected:
  Permissions() { place.write("vehicle.dbc", kVehicleDbc); }
  ~Permissions() override {
    for (const auto& each : std::filesystem::recursive_directory_iterator(place.path(""))) {
      chmod(each.path().c_str(), 0700);
    }
  }
  // The rights of files count for root too, once it may no longer pass them over.
  static std::vector<std::string> bound(std::vector<std::string> argv) {
    if (geteuid() != 0) return argv;
    const std::string less = "-dac_override,-dac_read_search";
    argv.insert(argv.begin(), {"setpriv", "--inh-caps=" + less, "--bounding-set=" + less});
    return argv;
  }
  std::vector<std::string> daemon() const {
    return bound({program_path("beltgripd"), "--config", place.path("beltgripd.toml"),
                  "--log-level", "debug"});
  }
  void forbid(const std::string& name, mode_t left = 0) const {
    ASSERT_EQ(chmod(place.path(name).c_str(), left), 0);
  }
  Workplace place;
};

TEST_F(Permissions, AConfigurationThatMayNotBeReadIsOneLineAndStatus66) {
  place.write("beltgripd.toml", kVehicleToml);
  forbid("beltgripd.toml");
  const RunResult result = run(daemon(), kLimit);
  EXPECT_EQ(result.status, 66);
  EXPECT_EQ(result.err, place.path("beltgripd.toml") +
                            ": found no readable file (Permission denied), expected a "
                            "configuration in TOML\n");
  EXPECT_EQ(result.out, "");
}

TEST_F(Permissions, ADbcThatMayNotBeReadIsOneLineAndStatus66) {
  place.write("beltgripd.toml", kVehicleToml);
  forbid("vehicle.dbc");
  const RunResult result = run(daemon(), kLimit);
  EXPECT_EQ(result.status, 66);
  EXPECT_EQ(lines(result.err), 1) << result.err;
  EXPECT_EQ(result.err.find(place.path("beltgripd.toml") +
                            ":3: bus.dbc: found \"vehicle.dbc\" that cannot be read (Permission "
                            "denied), expected "),
            0U)
      << result.err;
}

TEST_F(Permissions, AHistoryThatMayNotBeReadIsOneLineAndStatus66) {
  std::filesystem::create_directories(place.path("state"));
  place.write("state/history.db", "");
  const auto expect_refused = [&](const std::string& argument) {
    const RunResult result = run(bound({program_path(), "history", place.path(argument)}), kLimit);
    EXPECT_EQ(result.status, 66) << argument;
    EXPECT_EQ(result.err, "beltgrip: " + place.path("state/history.db") +
                              ": found no readable history (Permission denied), expected the "
                              "history.db of a daemon or its folder\n");
  };
  forbid("state/history.db");
  expect_refused("state");
  expect_refused("state/history.db");
  forbid("state");
  expect_refused("state");
  expect_refused("state/history.db");
}

// It runs on, and says it once.
class StateFolder : public Permissions {
 protected:
  void expect_one_line(const std::string& reason) const {
    place.write("beltgripd.toml",
                std::string(kVehicleToml) + "[daemon]\nstate_dir = \"a/state\"\n");
    Process process(daemon());
    // Written once a second from the first sample on: another turn of the helper thread is past.
    ASSERT_TRUE(process.wait_until(
        [](const Process& each) { return count(each.err(), " samples, ") >= 2; }, kLimit))
        << process.err();
    process.signal(SIGTERM);
    EXPECT_EQ(process.wait(kLimit), 0) << process.err();
    const std::string line = "beltgripd warning: " + place.path("a/state/history.db") +
                             ": the history cannot be opened (" + reason +
                             "); results are kept in memory, next attempt in a minute\n";
    EXPECT_EQ(count(process.err(), line), 1) << process.err();
    EXPECT_EQ(count(process.err(), "history.db"), 1) << process.err();
    EXPECT_NE(process.err().find("stopped: "), std::string::npos) << process.err();
  }
};

TEST_F(StateFolder, MayNotBeWritten) {
  std::filesystem::create_directories(place.path("a/state"));
  forbid("a/state", 0555);
  expect_one_line("Permission denied");
}

TEST_F(StateFolder, MayNotBeMade) {
  std::filesystem::create_directories(place.path("a"));
  forbid("a", 0555);
  expect_one_line("Permission denied");
}

TEST_F(StateFolder, HoldsAHistoryThatMayNotBeRead) {
  std::filesystem::create_directories(place.path("a/state"));
  place.write("a/state/history.db", "");
  forbid("a/state/history.db");
  expect_one_line("Permission denied");
}

TEST_F(StateFolder, IsAFile) {
  std::filesystem::create_directories(place.path("a"));
  place.write("a/state", "");
  expect_one_line("Not a directory");
}

}  // namespace
}  // namespace beltgrip::test
