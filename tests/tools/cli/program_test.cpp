// The command line itself: help, version, exit codes of sysexits, one line for a mistake.
#include <gtest/gtest.h>

#include "tests/support/program.h"

namespace beltgrip::test {
namespace {

TEST(Program, HelpsAndNamesItsVersionEverywhere) {
  const RunResult help = beltgrip({"--help"});
  EXPECT_EQ(help.status, 0);
  EXPECT_EQ(help.err, "");
  for (const char* name : {"init", "monitor", "replay", "report", "run-demo", "simulate"}) {
    EXPECT_NE(help.out.find(name), std::string::npos) << name;
    const RunResult own = beltgrip({name, "--help"});
    EXPECT_EQ(own.status, 0) << name;
    EXPECT_NE(own.out.find("--help"), std::string::npos) << name;
    EXPECT_EQ(beltgrip({name, "--version"}).out, beltgrip({"--version"}).out) << name;
  }
  EXPECT_EQ(beltgrip({"--version"}).out.substr(0, 9), "beltgrip ");
}

TEST(Program, AMistakeOnTheCommandLineIsOneLine) {
  const std::vector<std::vector<std::string>> mistakes = {
      {},
      {"nonsense"},
      {"--nonsense"},
      {"replay"},
      {"replay", "x.log"},
      {"replay", "x.log", "--config"},
      {"replay", "x.log", "--config", "y", "--method", "magic"},
      {"replay", "x.log", "--config", "y", "--jobs", "0"},
      {"replay", "x.log", "y.log", "--config", "y", "--trace", "t.csv"},
      {"replay", "x.log", "--config", "y", "--trace", "-", "--json", "-"},
      {"simulate", "--out-dir", "x", "--bus", "vcan0"},
      {"simulate", "--seed", "x", "--log-out", "-"},
      {"simulate", "--start", "-1", "--log-out", "-"},
      {"simulate", "--log-out", "a", "--out-dir", "b"},
      {"simulate", "--bus", "vcan0", "--speed", "0"},
      {"replay", "x.log", "--bus", "vcan0", "--json", "-"},
      {"replay", "x.log", "y.log", "--bus", "vcan0"},
      {"replay", "x.log", "--config", "y", "--speed", "2"},
      {"monitor"},
      {"run-demo", "--method", "magic"},
      {"init"}};
  for (const auto& arguments : mistakes) {
    const RunResult result = beltgrip(arguments);
    const std::string shown = arguments.empty() ? "(nothing)" : arguments.front();
    EXPECT_EQ(result.status, 64) << shown << ": " << result.err;
    EXPECT_EQ(lines(result.err), 1) << shown << ": " << result.err;
    EXPECT_EQ(result.out, "") << shown;
  }
}

// In real time: five seconds.
TEST(Program, DemoEndsWithTheVerdictBesideTheTruth) {
  const RunResult result =
      beltgrip({"run-demo", "--scenario", "paper-rig", "--start", "88", "--duration", "5"});
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_NE(result.out.find("STOP"), std::string::npos) << result.out;
  EXPECT_NE(result.out.find("peak at 89.51 s"), std::string::npos) << result.out;
  const std::string mistake =
      beltgrip({"run-demo", "--scenario", "paper-rig", "--start", "5000"}).err;
  EXPECT_NE(mistake.find("--start"), std::string::npos) << mistake;
  EXPECT_EQ(beltgrip({"run-demo", "--set", "run.cycles=-1"}).status, 78);
}

// What the whole of it comes to is judged in virtual time (simulate_test), where no busy machine
// can be late.
TEST(Program, DemoTellsWhatTheCarDoes) {
  const RunResult result = beltgrip({"run-demo", "--duration", "4"});
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_NE(result.out.find("2.001 s  ** foot off the pedal at 72 km/h"), std::string::npos)
      << result.out;
  EXPECT_NE(result.out.find("idle"), std::string::npos) << result.out;
  EXPECT_NE(result.out.find("mu_max by BeltGrip"), std::string::npos) << result.out;
}

}  // namespace
}  // namespace beltgrip::test
