// beltgrip replay of a log that a daemon made in `command` mode: it follows the requests of the log
// and finds what was found live; without it, or where the log lacks part of a request, as said.
// What was found live is what the simulated car's own daemon wrote.
#include <gtest/gtest.h>

#include <cstdio>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/support/program.h"

namespace beltgrip::test {
namespace {

using nlohmann::json;

// Two coast-downs. In the second the driver may come back to the pedal while a request stands.
std::string drive_toml(bool pedal) {
  std::string text =
      "plant = \"vehicle\"\nname = \"twice\"\n[run]\nduration_s = 62.0\n"
      "[[driver.step]]\nat_s = 0.0\nhold_speed_km_h = 81.0\n"
      "[[driver.step]]\nat_s = 3.0\naccelerator_percent = 0.0\n"
      "[[driver.step]]\nat_s = 22.0\nhold_speed_km_h = 81.0\n"
      "[[driver.step]]\nat_s = 40.0\naccelerator_percent = 0.0\n";
  if (pedal) text += "[[driver.step]]\nat_s = 52.0\naccelerator_percent = 30.0\n";
  return text;
}

struct Summary {
  std::vector<json> experiments;
  json summary;
};

Summary summary_of(const std::string& text) {
  Summary result;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) {
    json each = json::parse(line);
    if (each.at("type") == "experiment") result.experiments.push_back(each);
    if (each.at("type") == "summary") result.summary = each;
  }
  return result;
}

// Lines between two times; a line with one of these texts is left out.
std::string part(const std::string& log, double from_s, double to_s,
                 const std::string& without = "\n") {
  std::istringstream stream(log);
  std::string out;
  for (std::string line; std::getline(stream, line);) {
    double t_s = 0.0;
    EXPECT_EQ(std::sscanf(line.c_str(), "(%lf)", &t_s), 1);
    if (t_s >= from_s && t_s < to_s && line.find(without) == std::string::npos) out += line + "\n";
  }
  return out;
}

class ReplayAsRecorded : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    place_ = new Workplace;
    place_->write("twice.toml", drive_toml(false));
    place_->write("pedal.toml", drive_toml(true));
    for (const std::string drive : {"twice", "pedal"}) {
      const RunResult result =
          beltgrip({"simulate", "--scenario", place_->path(drive + ".toml"), "--out-dir",
                    place_->path(drive), "--json", place_->path(drive + ".json")});
      ASSERT_EQ(result.status, 0) << result.err;
    }
    // A daemon that rests for a minute would not have asked in this one.
    std::string config = place_->read("twice/beltgrip.toml");
    const std::string key = "cooldown_s                  = 2";
    const std::size_t at = config.find(key);
    ASSERT_NE(at, std::string::npos);
    config.replace(at, key.size(), "cooldown_s = 60");
    place_->write("twice/resting.toml", config);
  }
  static void TearDownTestSuite() {
    delete place_;
    place_ = nullptr;
  }
  static std::string path(const std::string& name) { return place_->path(name); }
  // As the simulated controller saw it: the frame that follows the sample of the decision.
  static double begin_s(std::size_t request) {
    const auto truth = nlohmann::json::parse(place_->read("twice/truth.json"));
    return truth.at("requests").at(request).at("begin_s");
  }
  static constexpr double kSampleAndFrame_s = 0.0105;
  static RunResult replay(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "replay");
    return beltgrip(arguments);
  }
  static RunResult replay_log(const std::string& log, const std::vector<std::string>& more = {}) {
    place_->write("case.log", log);
    std::vector<std::string> arguments{path("case.log"), "--config", path("twice/beltgrip.toml"),
                                       "--json", "-"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return replay(arguments);
  }

  static Workplace* place_;
};
Workplace* ReplayAsRecorded::place_ = nullptr;

TEST_F(ReplayAsRecorded, SameExperimentsSameStopsSameValues) {
  for (const std::string drive : {"twice", "pedal"}) {
    for (const std::string config : {"twice/beltgrip.toml", "twice/resting.toml"}) {
      const Summary live = summary_of(place_->read(drive + ".json"));
      const RunResult run =
          replay({path(drive + "/trace.log"), "--config", path(config), "--json", "-"});
      ASSERT_EQ(run.status, 0) << run.err;
      const Summary found = summary_of(run.out);
      EXPECT_NE(run.err.find("follow the 2 clamp requests"), std::string::npos) << run.err;
      EXPECT_EQ(found.summary.at("requests_followed"), 2);
      ASSERT_EQ(live.experiments.size(), 2u);
      ASSERT_EQ(found.experiments.size(), 2u) << drive << config;
      for (std::size_t i = 0; i < 2; ++i) {
        const json& then = live.experiments[i];
        const json& now = found.experiments[i];
        for (const char* key : {"outcome", "stop_reason", "direction", "ratio"}) {
          EXPECT_EQ(now.at(key), then.at(key)) << drive << config << i << key;
        }
        // Frames leave up to 1 ms after their sample, and the samples here lie between those there:
        // the request begins one sample apart at the most, and what stops it, seen with other
        // samples, two.
        EXPECT_NEAR(now.at("start_s").get<double>(), then.at("start_s").get<double>(), 0.0061);
        EXPECT_NEAR(now.at("stop_s").get<double>(), then.at("stop_s").get<double>(), 0.0111);
        if (then.at("outcome") == "completed") {
          EXPECT_NEAR(now.at("mu_max").get<double>(), then.at("mu_max").get<double>(),
                      0.2 * then.at("mu_max_std").get<double>());
        } else {
          EXPECT_EQ(now.at("reason").get<std::string>().substr(0, 25),
                    then.at("reason").get<std::string>().substr(0, 25));
        }
      }
    }
  }
  EXPECT_EQ(summary_of(place_->read("pedal.json")).experiments.at(1).at("stop_reason"), "driver");
}

TEST_F(ReplayAsRecorded, DecidedAnewItAsksWhenItWouldNow) {
  const RunResult anew = replay({path("twice/trace.log"), "--config", path("twice/resting.toml"),
                                 "--decide-anew", "--json", "-"});
  ASSERT_EQ(anew.status, 0) << anew.err;
  const Summary found = summary_of(anew.out);
  EXPECT_EQ(found.experiments.size(), 0u);
  EXPECT_TRUE(found.summary.at("requests_followed").is_null());
  EXPECT_EQ(anew.err.find("as recorded"), std::string::npos);
}

TEST_F(ReplayAsRecorded, ALogWithoutClampFramesIsDecidedAnew) {
  const std::string log = place_->read("twice/trace.log");
  const RunResult anew = replay_log(part(log, 0.0, 62.0, " 6A2#"));
  EXPECT_TRUE(summary_of(anew.out).summary.at("requests_followed").is_null());
  EXPECT_EQ(summary_of(anew.out).experiments.size(), 2u);
  const RunResult none = replay_log(part(log, 0.0, 62.0, " 6A2#"), {"--as-recorded"});
  EXPECT_EQ(summary_of(none.out).summary.at("requests_followed"), 0);
  EXPECT_EQ(summary_of(none.out).experiments.size(), 0u) << none.out;
}

TEST_F(ReplayAsRecorded, ARequestThatTheLogCutsOffEndsWithTheLog) {
  const RunResult run = replay_log(part(place_->read("twice/trace.log"), 0.0, 16.0));
  const Summary found = summary_of(run.out);
  EXPECT_EQ(found.summary.at("requests_followed"), 1);
  ASSERT_EQ(found.experiments.size(), 1u) << run.out;
  EXPECT_EQ(found.experiments[0].at("stop_reason"), "trace_end");
  EXPECT_NE(found.experiments[0].at("outcome"), "completed");
  EXPECT_NEAR(found.experiments[0].at("start_s").get<double>(), begin_s(0), kSampleAndFrame_s);
}

TEST_F(ReplayAsRecorded, ARequestWithoutItsBeginningIsNoExperiment) {
  const RunResult run = replay_log(part(place_->read("twice/trace.log"), 16.0, 62.0));
  const Summary found = summary_of(run.out);
  EXPECT_EQ(found.summary.at("requests_followed"), 1);
  ASSERT_EQ(found.experiments.size(), 1u) << run.out;
  EXPECT_NEAR(found.experiments[0].at("start_s").get<double>(), begin_s(1), kSampleAndFrame_s);
  EXPECT_NE(run.err.find("1 more lack their beginning"), std::string::npos) << run.err;
}

// A recorder that starts anew a moment before a request: nothing has settled yet.
TEST_F(ReplayAsRecorded, ALogThatBeginsJustBeforeARequestHasItsExperiment) {
  const std::string log = part(place_->read("twice/trace.log"), 49.0, 62.0);
  const Summary found = summary_of(replay_log(log).out);
  ASSERT_EQ(found.experiments.size(), 1u);
  EXPECT_EQ(found.experiments[0].at("outcome"), "completed");
  EXPECT_NEAR(found.experiments[0].at("start_s").get<double>(), begin_s(1), kSampleAndFrame_s);
}

// Nobody obeys a request for 50 ms after its last frame: there it ends, whatever comes later.
TEST_F(ReplayAsRecorded, FramesThatFallSilentEndTheRequest) {
  const std::string log = place_->read("twice/trace.log");
  const Summary found =
      summary_of(replay_log(part(log, 0.0, 15.0) + part(log, 15.0, 62.0, " 6A")).out);
  ASSERT_EQ(found.experiments.size(), 1u);
  EXPECT_NEAR(found.experiments[0].at("start_s").get<double>() +
                  found.experiments[0].at("samples").get<double>() / 200.0,
              15.05, 0.015);
  EXPECT_EQ(found.experiments[0].at("stop_reason"), "none");
}

TEST_F(ReplayAsRecorded, AsksForNothingItself) {
  const auto clamp_frames = [&](const std::string& how) {
    std::vector<std::string> arguments{path("twice/trace.log"), "--config",
                                       path("twice/beltgrip.toml"), "--log-out", path("out.log")};
    if (!how.empty()) arguments.push_back(how);
    EXPECT_EQ(replay(arguments).status, 0);
    const std::string out = place_->read("out.log");
    EXPECT_NE(out.find(" 6A0#"), std::string::npos);
    return lines(part(out, 0.0, 100.0)) - lines(part(out, 0.0, 100.0, " 6A2#"));
  };
  EXPECT_EQ(clamp_frames(""), 0);
  EXPECT_GT(clamp_frames("--decide-anew"), 1000);
}

// What stood in the way is told in the words of tools/NO_RESULT.md.
TEST_F(ReplayAsRecorded, TheEndTellsWhatEachInhibitMeansAndWhatToDo) {
  const RunResult run =
      replay({path("twice/trace.log"), "--config", path("twice/resting.toml"), "--decide-anew"});
  EXPECT_NE(
      run.out.find("    cool-down (limits 60 s and 0 m): too little time or distance since the "
                   "last request; to do: wait: `cooldown_s`, `cooldown_m`\n"),
      std::string::npos)
      << run.out;
}

TEST_F(ReplayAsRecorded, WhatDoesNotFitIsSaid) {
  const std::string log = path("twice/trace.log"), config = path("twice/beltgrip.toml");
  EXPECT_EQ(replay({log, "--config", config, "--as-recorded", "--decide-anew"}).status, 64);
  EXPECT_EQ(replay({"-", "--config", config, "--as-recorded"}).status, 64);
  std::string observing = place_->read("twice/beltgrip.toml");
  const std::string key = "control = \"command\"";
  observing.replace(observing.find(key), key.size(), "control = \"observe\"");
  place_->write("twice/observing.toml", observing);
  EXPECT_EQ(replay({log, "--config", path("twice/observing.toml"), "--as-recorded"}).status, 64);
}

}  // namespace
}  // namespace beltgrip::test
