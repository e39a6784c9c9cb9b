// beltgrip monitor of logs, as a program: against what replay says of the same log, and what was
// recorded against what is computed here.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/support/program.h"

namespace beltgrip::test {
namespace {

using nlohmann::json;

class Monitor : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    place_ = new Workplace;
    ASSERT_EQ(
        beltgrip({"simulate", "--scenario", "demo", "--out-dir", place_->path("drive")}).status, 0);
    // The simulated daemon's frames stand in its log: the car's alone.
    std::istringstream in(place_->read("drive/trace.log"));
    std::string bare;
    for (std::string line; std::getline(in, line);) {
      if (line.find(" 6A") == std::string::npos) bare += line + "\n";
    }
    place_->write("bare.log", bare);
    // The drive as candump would have it with beltgripd on the bus.
    ASSERT_EQ(beltgrip({"replay", log(), "--config", config(), "--json", place_->path("results"),
                        "--log-out", place_->path("own.log")})
                  .status,
              0);
  }
  static void TearDownTestSuite() {
    delete place_;
    place_ = nullptr;
  }
  static std::string log() { return place_->path("bare.log"); }
  static std::string config() { return place_->path("drive/beltgrip.toml"); }
  static json results(std::size_t index) {
    std::istringstream in(place_->read("results"));
    std::string line;
    for (std::size_t i = 0; i <= index; ++i) std::getline(in, line);
    return json::parse(line);
  }
  static json once(const std::vector<std::string>& arguments) {
    std::vector<std::string> all{"monitor"};
    all.insert(all.end(), arguments.begin(), arguments.end());
    all.insert(all.end(), {"--once", "--json"});
    const RunResult run = beltgrip(all);
    EXPECT_EQ(run.status, 0) << run.err;
    return json::parse(run.out);
  }
  // Steps of the frames' codes.
  static constexpr double kMuStep = 1e-5;

  static Workplace* place_;
};
Workplace* Monitor::place_ = nullptr;

TEST_F(Monitor, SaysWhatWasCarriedAsReplayDoes) {
  const std::string drive = place_->path("carried");
  ASSERT_EQ(beltgrip({"simulate", "--duration", "20", "--out-dir", drive}).status, 0);
  const RunResult run = beltgrip(
      {"replay", drive + "/trace.log", "--config", drive + "/beltgrip.toml", "--json", "-"});
  const std::size_t last = run.out.find_last_of('\n', run.out.size() - 2) + 1;
  const json carried = json::parse(run.out.substr(last)).at("carried");
  ASSERT_EQ(carried.size(), 1U);
  const json view = once({drive + "/trace.log", "--config", drive + "/beltgrip.toml"});
  ASSERT_EQ(view.at("carried").size(), 1U);
  EXPECT_EQ(view.at("carried")[0].at("group"), "drive, overdrive");
  EXPECT_NEAR(view.at("carried")[0].at("mu_max_lower_bound").get<double>(),
              carried[0].at("mu_max_lower_bound").get<double>(), 1e-4);
}

TEST_F(Monitor, ALogIsReplayedAsReplayDoes) {
  const json view = once({log(), "--config", config()});
  EXPECT_TRUE(view.at("replayed_here"));
  ASSERT_EQ(view.at("experiments").size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    const json& seen = view.at("experiments").at(i);
    EXPECT_NEAR(seen.at("mu_max").get<double>(), results(i).at("mu_max").get<double>(), kMuStep);
    EXPECT_EQ(seen.at("outcome"), results(i).at("outcome"));
    EXPECT_EQ(seen.at("stop_reason"), results(i).at("stop_reason"));
  }
  EXPECT_NEAR(view.at("inputs").at("primary_speed").at("rate_Hz").get<double>(), 100.0, 10.0);
  EXPECT_EQ(view.at("inputs").at("primary_speed").at("trust"), "valid");
}

TEST_F(Monitor, SaysWhatKeepsARequestAway) {
  const std::string drive = place_->path("withheld");
  ASSERT_EQ(beltgrip({"simulate", "--scenario", "coast-overdrive", "--out-dir", drive}).status, 0);
  const json view = once({drive + "/trace.log", "--config", drive + "/beltgrip.toml"});
  ASSERT_FALSE(view.at("inhibits").empty());
  EXPECT_NE(view.at("inhibits")[0].at("means"), "");
}

TEST_F(Monitor, RecordedFramesAreShownAsTheyWere) {
  const json view = once({place_->path("own.log")});
  EXPECT_FALSE(view.at("replayed_here"));
  ASSERT_EQ(view.at("experiments").size(), 2U);
  EXPECT_NEAR(view.at("mu_max").get<double>(), results(1).at("mu_max").get<double>(), kMuStep);
  EXPECT_TRUE(view.at("inhibits").is_null());
  EXPECT_TRUE(view.at("inputs").empty());
  EXPECT_EQ(view.at("wrong_crc"), 0);
}

TEST_F(Monitor, AnInstantOfTheLogCanBeChosen) {
  const double stop_s = results(0).at("stop_s");
  const json first = once({log(), "--config", config(), "--from", "1"});
  const double begin_s = first.at("t_s").get<double>() - 1.0;
  const auto at = [&](double t_s) {
    return once({log(), "--config", config(), "--from", std::to_string(t_s - begin_s)});
  };
  EXPECT_EQ(at(stop_s - 0.2).at("state"), "ramping");
  EXPECT_FALSE(at(stop_s - 0.2).at("macro_slip_stop"));
  EXPECT_TRUE(at(stop_s + 0.05).at("macro_slip_stop"));
}

TEST_F(Monitor, LinesOfALogSortIntoIt) {
  const RunResult run = beltgrip({"monitor", place_->path("own.log"), "--plain"});
  ASSERT_EQ(run.status, 0) << run.err;
  std::istringstream in(run.out);
  std::string line, before;
  int stops = 0;
  while (std::getline(in, line)) {
    ASSERT_EQ(line.front(), '(') << line;
    const std::string stamp = line.substr(1, line.find(')') - 1);
    EXPECT_GE(std::stod(stamp), before.empty() ? 0.0 : std::stod(before));
    EXPECT_EQ(stamp.size() - stamp.find('.'), 7U) << line;
    before = stamp;
    stops += line.find(" STOP") != std::string::npos ? 1 : 0;
  }
  EXPECT_EQ(stops, 2) << run.out;
  EXPECT_NE(run.out.find("mu_max 0.1"), std::string::npos) << run.out;
}

TEST_F(Monitor, OnceIsAPageOfText) {
  const RunResult run = beltgrip({"monitor", log(), "--config", config(), "--once"});
  ASSERT_EQ(run.status, 0) << run.err;
  for (const char* part : {"bare.log", "replayed here", "primary_speed", "slope", "slip sigma*"}) {
    EXPECT_NE(run.out.find(part), std::string::npos) << part << "\n" << run.out;
  }
  std::istringstream in(run.out);
  for (std::string line; std::getline(in, line);) EXPECT_LE(line.size(), 80U) << line;
}

TEST_F(Monitor, FramesAreJsonLines) {
  const RunResult run =
      beltgrip({"monitor", place_->path("own.log"), "--json", "--from", "5", "--duration", "1"});
  ASSERT_EQ(run.status, 0) << run.err;
  std::istringstream in(run.out);
  std::string line;
  ASSERT_TRUE(std::getline(in, line));
  EXPECT_EQ(json::parse(line).at("protection"), "ok");
  EXPECT_GT(lines(run.out), 20);
}

TEST_F(Monitor, BadInputIsOneLineAndItsExitCode) {
  place_->write("empty.log", "");
  const std::vector<std::pair<std::vector<std::string>, int>> cases{
      {{place_->path("empty.log"), "--plain"}, 65},
      {{"missing.log", "--plain"}, 66},  // not the interface "missing.log"
      {{place_->path("missing.log"), "--plain"}, 66},
      {{log(), "--config", place_->path("none.toml"), "--plain"}, 66},
      {{log(), "--plain", "--once"}, 64},
      {{log(), "--plain", "--json"}, 64},
      {{"vcan9", "--from", "1"}, 64},
      {{"vcan9", "--once"}, 69}};
  for (const auto& [arguments, status] : cases) {
    std::vector<std::string> all{"monitor"};
    all.insert(all.end(), arguments.begin(), arguments.end());
    const RunResult run = beltgrip(all);
    EXPECT_EQ(run.status, status) << arguments.back();
    EXPECT_EQ(lines(run.err), 1) << run.err;
  }
}

}  // namespace
}  // namespace beltgrip::test
