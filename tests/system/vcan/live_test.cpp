// The main job on SocketCAN: a trace of the paper's experiment, played by canplayer, passes through
// beltgripd and comes back as frames; candump records, and replay of the record says the same.
#include <gtest/gtest.h>
#include <linux/can/error.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/system/vcan/rig.h"

namespace beltgrip::test {
namespace {

using nlohmann::json;

constexpr canid_t kRigSpeed = 0x110;

std::string text_of(const std::string& path) {
  std::ifstream file(path);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

std::string log_of(Process& process) {
  process.wait(Milliseconds{0});  // takes what it has written
  return process.err();
}

// A program whose output goes to a file, where it can be as long as it likes.
std::vector<std::string> into_file(const std::string& command, const std::string& path) {
  return {"sh", "-c", "exec " + command + " >" + path};
}

class Live : public Vcan {
 protected:
  // Writes the trace with its configuration and truth to the test's folder.
  void simulate(const std::string& trigger, const std::vector<std::string>& options) {
    std::vector<std::string> argv{program("beltgrip"), "simulate", "--scenario", "paper-rig",
                                  "--out-dir",         folder(),   "--start",    "86"};
    argv.insert(argv.end(), options.begin(), options.end());
    const RunResult result = run(argv, kLimit);
    ASSERT_EQ(result.status, 0) << result.err;
    std::string toml = text_of(config());
    const std::string shipped = "trigger = \"always\"";
    ASSERT_NE(toml.find(shipped), std::string::npos) << toml;
    toml.replace(toml.find(shipped), shipped.size(), "trigger = \"" + trigger + "\"");
    std::ofstream(config()) << toml;
    truth_ = json::parse(text_of(folder() + "/truth.json"));
  }
  std::string trace() const { return folder() + "/trace.log"; }
  std::string config() const { return folder() + "/beltgrip.toml"; }
  const json& truth() const { return truth_; }
  std::vector<std::string> daemon() const { return {program("beltgripd"), "--config", config()}; }

 private:
  json truth_;
};

bool has_result(const PublishedFrames& published) {
  const auto estimate = published.last("BeltGripEstimate").signals;
  return !estimate.empty() && estimate.at("MuMaxValid") == 1;
}

bool stop_is_set(const PublishedFrames& published) {
  const auto slip = published.last("BeltGripSlip").signals;
  return !slip.empty() && slip.at("MacroSlipStop") == 1;
}

TEST_F(Live, ThePapersExperimentComesBackAsFrames) {
  ASSERT_NO_FATAL_FAILURE(simulate("signal", {"--duration", "12"}));
  const std::string record = folder() + "/record.log";
  const std::string shown = folder() + "/monitor.txt";
  const BusSocket bus("vcan0");
  Process candump(into_file("candump -L vcan0", record));
  Process monitor(into_file(program("beltgrip") + " monitor vcan0", shown));
  Process beltgripd(daemon());
  PublishedFrames published;
  ASSERT_TRUE(listen(bus, published, [&](const PublishedFrames&) {
    return std::filesystem::file_size(record) > 0 && std::filesystem::file_size(shown) > 0;
  })) << log_of(beltgripd);

  Process player(canplayer(trace(), "vcan0"));
  std::int64_t first_ns = 0;  // of the trace on the bus
  const auto over = [&](const ReceivedFrame& seen) {
    if (first_ns == 0 && seen.frame.can_id == kRigSpeed) first_ns = seen.t_ns;
    return published.take(seen) && has_result(published) && !stop_is_set(published);
  };
  ASSERT_TRUE(bus.receive_until(over, kLimit)) << log_of(beltgripd);
  EXPECT_EQ(player.wait(kLimit), 0);
  beltgripd.signal(SIGTERM);
  EXPECT_EQ(beltgripd.wait(kLimit), 0) << beltgripd.err();
  for (Process* each : {&monitor, &candump}) each->signal(SIGTERM);
  EXPECT_EQ(monitor.wait(kLimit), 0) << monitor.err();
  candump.wait(kLimit);

  EXPECT_EQ(published.problems(), std::vector<std::string>{});

  // The result, against the truth of the simulated belt.
  const auto estimate = published.last("BeltGripEstimate").signals;
  const double mu_max = truth().at("mu_max");
  EXPECT_NEAR(estimate.at("MuMax"), mu_max, 0.02 * mu_max);
  EXPECT_GT(estimate.at("MuMaxStd"), 0);
  EXPECT_LT(estimate.at("MuMaxStd"), 0.05 * mu_max);
  EXPECT_EQ(estimate.at("MuMaxKind"), 1);
  EXPECT_EQ(estimate.at("ExperimentCount"), 1);

  // The stop flag: set once, between the peak and the moment the operator noticed; then kept until
  // the experiment was over.
  std::vector<double> changes_s;
  double last = 0;
  for (const Published& slip : published.of("BeltGripSlip")) {
    const double stop = slip.signals.at("MacroSlipStop");
    if (stop != last) changes_s.push_back(static_cast<double>(slip.t_ns - first_ns) * 1e-9);
    last = stop;
  }
  ASSERT_EQ(changes_s.size(), 2U);
  const double first_frame_s = truth().at("first_frame_s");
  const json& experiment = truth().at("experiments").at(0);
  EXPECT_GT(first_frame_s + changes_s[0], experiment.at("peak_s").get<double>());
  EXPECT_LT(first_frame_s + changes_s[0], experiment.at("let_go_s").get<double>());

  // In the experiment a slip frame every 10 ms, always an estimate every 100 ms.
  std::vector<Published> during;
  for (const Published& slip : published.of("BeltGripSlip")) {
    const double t_s = static_cast<double>(slip.t_ns - first_ns) * 1e-9;
    if (t_s > 1.0 && t_s < changes_s[0]) during.push_back(slip);
  }
  ASSERT_GT(during.size(), 100U);
  EXPECT_NEAR(static_cast<double>(during.back().t_ns - during.front().t_ns) * 1e-6 /
                  static_cast<double>(during.size() - 1),
              10.0, 0.5);

  // The record says the same when it is replayed: the samples lie elsewhere between the frames.
  const RunResult replay =
      run({program("beltgrip"), "replay", record, "--config", config(), "--json", "-"}, kLimit);
  ASSERT_EQ(replay.status, 0) << replay.err;
  const json replayed = json::parse(replay.out.substr(0, replay.out.find('\n')));
  EXPECT_EQ(replayed.at("outcome"), "completed");
  EXPECT_NEAR(replayed.at("mu_max").get<double>(), estimate.at("MuMax"), 0.003 * mu_max);
  const double replay_stop_s =
      replayed.at("stop_s").get<double>() - static_cast<double>(first_ns) * 1e-9;
  EXPECT_NEAR(replay_stop_s, changes_s[0], 0.3);
  RecordProperty("mu_max_live", std::to_string(estimate.at("MuMax")));
  RecordProperty("mu_max_replayed", replayed.at("mu_max").dump());
  RecordProperty("stop_live_s", std::to_string(changes_s[0]));
  RecordProperty("stop_replayed_s", std::to_string(replay_stop_s));

  // What a person at the monitor saw.
  char text[16];
  std::snprintf(text, sizeof text, "%.4f", estimate.at("MuMax"));
  EXPECT_NE(text_of(shown).find(text), std::string::npos) << text_of(shown);
  EXPECT_NE(text_of(shown).find("STOP"), std::string::npos);
}

// What the flight recorder kept of a run, replayed, gives the frames that were on the bus: the same
// bytes in the same order, on whatever machine and however late its samples were.
TEST_F(Live, TheFlightRecordersRunIsReplayedByteByByte) {
  ASSERT_NO_FATAL_FAILURE(simulate("signal", {"--duration", "12"}));
  const std::string kept = folder() + "/kept";
  const BusSocket bus("vcan0");
  std::vector<std::string> argv = daemon();
  argv.insert(argv.end(), {"--record", kept});
  Process beltgripd(argv);
  PublishedFrames published;
  std::string live;
  const auto take = [&](const ReceivedFrame& seen) {
    if (seen.frame.can_id >= 0x6A0 && seen.frame.can_id <= 0x6A3) {
      live += std::to_string(seen.frame.can_id);
      for (int i = 0; i < seen.frame.len; ++i) live += ' ' + std::to_string(seen.frame.data[i]);
      live += '\n';
    }
    return published.take(seen);
  };
  // The fault of inputs that have not come yet begins the record, at the daemon's first sample.
  ASSERT_TRUE(beltgripd.wait_for_error("recording to " + kept, kLimit)) << log_of(beltgripd);
  Process player(canplayer(trace(), "vcan0"));
  ASSERT_TRUE(bus.receive_until(
      [&](const ReceivedFrame& seen) {
        if (!take(seen)) return false;
        const auto status = published.last("BeltGripStatus").signals;
        return !status.empty() && status.at("Outcome") != 0 && !stop_is_set(published);
      },
      kLimit))
      << log_of(beltgripd);
  beltgripd.signal(SIGTERM);
  EXPECT_EQ(beltgripd.wait(kLimit), 0) << beltgripd.err();
  player.signal(SIGTERM);
  player.wait(kLimit);
  while (const auto seen = bus.receive(Milliseconds(100))) take(*seen);

  std::vector<std::string> files;
  for (const auto& each : std::filesystem::directory_iterator(kept)) files.push_back(each.path());
  ASSERT_EQ(files.size(), 1U);
  const std::string sent = folder() + "/sent.log";
  const RunResult replay = run({program("beltgrip"), "replay", files[0], "--config", config(),
                                "--json", "-", "--log-out", sent},
                               kLimit);
  ASSERT_EQ(replay.status, 0) << replay.err;
  EXPECT_EQ(json::parse(replay.out.substr(0, replay.out.find('\n'))).at("type"), "experiment");
  std::string replayed;
  std::ifstream log(sent);
  for (std::string stamp, interface, frame; log >> stamp >> interface >> frame;) {
    const std::size_t hash = frame.find('#');
    replayed += std::to_string(std::stoul(frame.substr(0, hash), nullptr, 16));
    for (std::size_t i = hash + 1; i + 1 < frame.size(); i += 2) {
      replayed += ' ' + std::to_string(std::stoul(frame.substr(i, 2), nullptr, 16));
    }
    replayed += '\n';
  }
  EXPECT_GT(std::count(live.begin(), live.end(), '\n'), 500);
  EXPECT_EQ(replayed, live);
  const std::string late = beltgripd.err().substr(beltgripd.err().find("stopped: "));
  RecordProperty("daemon", late.substr(0, late.find('\n')));
}

// Frames that carry an input's number but are not that input, and such as other nodes send.
const std::vector<std::pair<canid_t, std::vector<std::uint8_t>>> kStrangers{
    {kRigSpeed | CAN_EFF_FLAG, {0, 0, 0, 0, 0, 0, 0, 0}},
    {0x130 | CAN_EFF_FLAG, {0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF}},
    {kRigSpeed | CAN_RTR_FLAG, {}},
    {0x120 | CAN_RTR_FLAG, {}},
    {0x6A0 | CAN_EFF_FLAG, {1, 2, 3, 4, 5, 6, 7, 8}},
    {0x6A1 | CAN_RTR_FLAG, {}},
    {CAN_ERR_FLAG | CAN_ERR_LOSTARB, {0, 0, 0, 0, 0, 0, 0, 0}},
    {CAN_ERR_FLAG | CAN_ERR_PROT, {0, 0, 1, 0, 0, 0, 0, 0}},
    {CAN_ERR_FLAG | CAN_ERR_ACK, {0, 0, 0, 0, 0, 0, 0, 0}},
    {0x7FF, {1}},
    {0x000, {}},
};

TEST_F(Live, StrangersOnTheBusChangeNothing) {
  ASSERT_NO_FATAL_FAILURE(simulate("always", {"--duration", "8"}));
  const BusSocket bus("vcan0");
  const BusSocket stranger("vcan0");
  Process beltgripd(daemon());
  PublishedFrames published;
  ASSERT_TRUE(listen(bus, published, [](const PublishedFrames&) { return true; }));
  const Process load({"cangen", "vcan0", "-g", "2", "-I", "2AA", "-L", "8", "-D", "r"});
  Process player(canplayer(trace(), "vcan0"));
  std::size_t next = 0;
  const auto result = [&](const ReceivedFrame& seen) {
    if (seen.frame.can_id == kRigSpeed) {
      const auto& [id, data] = kStrangers[next++ % kStrangers.size()];
      stranger.send(id, data);
    }
    return published.take(seen) && has_result(published);
  };
  ASSERT_TRUE(bus.receive_until(result, kLimit)) << log_of(beltgripd);
  EXPECT_GT(next, 50 * kStrangers.size());
  EXPECT_EQ(published.problems(), std::vector<std::string>{});
  const double mu_max = truth().at("mu_max");
  EXPECT_NEAR(published.last("BeltGripEstimate").signals.at("MuMax"), mu_max, 0.02 * mu_max);
  for (const Published& status : published.of("BeltGripStatus")) {
    for (const char* fault : {"FaultInputFrame", "FaultForeignSender", "FaultBusOff",
                              "FaultBusPassive", "FaultFramesLost"}) {
      EXPECT_EQ(status.signals.at(fault), 0) << fault;
    }
  }
}

}  // namespace
}  // namespace beltgrip::test
