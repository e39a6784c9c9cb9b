// beltgrip report: what the page holds, read by hand from its text; and bad input.
#include <gtest/gtest.h>

#include <string>

#include "tests/support/program.h"

namespace beltgrip::test {
namespace {

long count(const std::string& text, const std::string& what) {
  long n = 0;
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++n;
  return n;
}

class Report : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(
        beltgrip({"simulate", "--scenario", "demo", "--out-dir", place_.path("drive")}).status, 0);
  }
  RunResult report(const std::string& log) {
    return beltgrip({"report", place_.path(log), "--config", place_.path("drive/beltgrip.toml"),
                     "--out", place_.path("page.html")});
  }
  Workplace place_;
};

// The demo coasts down twice; its log holds both.
TEST_F(Report, ShowsEveryExperimentOfTheLog) {
  const RunResult run = report("drive/trace.log");
  ASSERT_EQ(run.status, 0) << run.err;
  EXPECT_EQ(run.out, "2 experiments: " + place_.path("page.html") + "\n");
  const std::string page = place_.read("page.html");
  EXPECT_EQ(count(page, "<h2>trace.log, from "), 2);
  EXPECT_EQ(count(page, "<td>completed, slope</td>"), 2);
  EXPECT_EQ(count(page, "<canvas "), 2);                 // a traction curve each
  EXPECT_EQ(count(page, "<div class=\"courses\" "), 3);  // the drive, and each over time
  for (const char* name : {"Quiet", "Excited", "Peak", "MacroSlip", "mu_max", "stop"}) {
    EXPECT_NE(page.find("[\"" + std::string(name) + "\","), std::string::npos) << name;
  }
  EXPECT_EQ(count(page, "<h2>Reserve of least loss</h2>"), 1);
  EXPECT_NE(page.find("Configured: 0 Nm."), std::string::npos);
  EXPECT_EQ(count(page, "<td>while an experiment ran or could have begun</td>"), 1);
  EXPECT_EQ(count(page, "<td>cool-down</td>"), 1);
}

TEST_F(Report, TellsLogsOfOneNameApart) {
  place_.write("trace.log", place_.read("drive/trace.log"));
  const RunResult run =
      beltgrip({"report", place_.path("trace.log"), place_.path("drive/trace.log"), "--config",
                place_.path("drive/beltgrip.toml"), "--out", place_.path("page.html")});
  ASSERT_EQ(run.status, 0) << run.err;
  const std::string page = place_.read("page.html");
  for (const char* log : {"trace.log", "drive/trace.log"}) {
    EXPECT_EQ(count(page, "<h2>" + place_.path(log) + "</h2>"), 1) << log;
    EXPECT_EQ(count(page, "<h2>" + place_.path(log) + ", from "), 2) << log;
  }
}

// A table of the signals is a log too.
TEST_F(Report, ShowsATable) {
  ASSERT_EQ(beltgrip({"dbc", "decode", place_.path("drive/trace.log"), "--dbc",
                      place_.path("drive/vehicle.dbc"), "--csv", place_.path("table.csv")})
                .status,
            0);
  const RunResult run = report("table.csv");
  ASSERT_EQ(run.status, 0) << run.err;
  const RunResult replayed = beltgrip({"replay", place_.path("table.csv"), "--config",
                                       place_.path("drive/beltgrip.toml"), "--json", "-"});
  const long experiments = count(replayed.out, "\"type\":\"experiment\"");
  EXPECT_GT(experiments, 0);
  EXPECT_TRUE(run.out.starts_with(std::to_string(experiments) + " experiment")) << run.out;
}

TEST_F(Report, SaysWhyThereIsNoExperiment) {
  const std::string log = place_.read("drive/trace.log");
  place_.write("short.log", log.substr(0, log.find('\n', 20'000) + 1));
  const RunResult run = report("short.log");
  ASSERT_EQ(run.status, 0) << run.err;
  EXPECT_TRUE(run.out.starts_with("0 experiments: ")) << run.out;
  EXPECT_NE(place_.read("page.html").find("no experiment: "), std::string::npos);
  EXPECT_EQ(place_.read("page.html").find("Reserve of least loss"), std::string::npos);
}

TEST_F(Report, BadInputIsOneLineAndItsExitCode) {
  place_.write("empty.log", "");
  EXPECT_EQ(report("empty.log").status, 65);
  EXPECT_EQ(report("missing.log").status, 66);
  const RunResult nowhere =
      beltgrip({"report", place_.path("drive/trace.log"), "--config",
                place_.path("drive/beltgrip.toml"), "--out", place_.path("no/such/folder.html")});
  EXPECT_EQ(nowhere.status, 73);
  EXPECT_EQ(lines(nowhere.err), 1) << nowhere.err;
  EXPECT_EQ(beltgrip({"report"}).status, 64);
  EXPECT_EQ(beltgrip({"report", place_.path("drive/trace.log")}).status, 64);  // no configuration
  EXPECT_EQ(beltgrip({"report", "a.log", "--history", place_.path("drive")}).status, 64);
  EXPECT_EQ(beltgrip({"report", "--history", place_.path("missing.db")}).status, 66);
}

}  // namespace
}  // namespace beltgrip::test
