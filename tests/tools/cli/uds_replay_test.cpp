// Replay of the rig's trace with the pressure taken out of the broadcast and put where cars have
// it: into diagnostic answers, on the same bus or on a second one. The truth is the same trace with
// the broadcast.
#include <gtest/gtest.h>

#include <functional>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/support/program.h"

namespace beltgrip::test {
namespace {

using nlohmann::json;

// One line of a candump log.
struct Line {
  std::string stamp, interface, id, data;
  std::string text() const { return stamp + " " + interface + " " + id + "#" + data + "\n"; }
};

constexpr const char* kPressureId = "130";
constexpr const char* kUds =
    "{ uds = { request = 0x7E1, response = 0x7E9, did = 0x1101, start = 0, length = 16, byte_order "
    "= \"little\", scale = 0.001 }, unit = \"bar\", period_ms = ";

class UdsReplay : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    place_ = new Workplace;
    ASSERT_EQ(beltgrip({"simulate", "--start", "80", "--out-dir", place_->path("")}).status, 0);
    std::istringstream stream(place_->read("trace.log"));
    for (std::string text; std::getline(stream, text);) {
      std::istringstream words(text);
      Line line;
      words >> line.stamp >> line.interface >> line.data;
      const std::size_t at = line.data.find('#');
      line.id = line.data.substr(0, at);
      line.data.erase(0, at + 1);
      trace_.push_back(line);
    }
    ASSERT_GT(trace_.size(), 1000U);
  }
  static void TearDownTestSuite() {
    delete place_;
    place_ = nullptr;
    trace_.clear();
  }

  // The log with each pressure frame replaced by what `make` gives for its first two bytes; of
  // every `nth` one, the others are left out.
  static std::string log_with(const std::function<std::string(const Line&)>& make,
                              std::size_t nth = 1) {
    std::string log;
    std::size_t count = 0;
    for (const Line& line : trace_) {
      if (line.id != kPressureId) {
        log += line.text();
      } else if (count++ % nth == 0) {
        log += make(line);
      }
    }
    return log;
  }
  static std::string answer(const Line& pressure) {
    Line line = pressure;
    line.id = "7E9";
    line.data = "05621101" + pressure.data.substr(0, 4) + "CCCC";
    return line.text();
  }
  // The configuration with another secondary_pressure and more in [bus].
  static std::string config(const std::string& pressure, const std::string& bus = "") {
    std::string text = place_->read("beltgrip.toml");
    const std::string role = "\"RIG_Pressure.SecondaryPressure\"";
    text.replace(text.find(role), role.size(), pressure);
    return text.insert(text.find("[signals]"), bus);
  }
  static std::vector<json> replay(const std::string& toml, const std::string& log,
                                  const std::string& log_out = "out.log") {
    place_->write("case.toml", toml);
    place_->write("case.log", log);
    const RunResult result =
        beltgrip({"replay", place_->path("case.log"), "--config", place_->path("case.toml"),
                  "--json", "-", "--log-out", place_->path(log_out)});
    EXPECT_EQ(result.status, 0) << result.err;
    std::vector<json> lines;
    std::istringstream stream(result.out);
    for (std::string line; std::getline(stream, line);) lines.push_back(json::parse(line));
    return lines;
  }
  static json experiment(const std::string& toml, const std::string& log) {
    const auto lines = replay(toml, log);
    EXPECT_EQ(lines.size(), 2U);
    return lines.empty() ? json{} : lines[0];
  }
  static std::string broadcast(double period_ms) {
    return "{ signal = \"RIG_Pressure.SecondaryPressure\", period_ms = " +
           std::to_string(period_ms) + " }";
  }

  static Workplace* place_;
  static std::vector<Line> trace_;
};
Workplace* UdsReplay::place_ = nullptr;
std::vector<Line> UdsReplay::trace_;

TEST_F(UdsReplay, AnswersInPlaceOfBroadcastsGiveTheSameResult) {
  const auto kept = [](const Line& line) { return line.text(); };
  for (const auto& [nth, period_ms] : {std::pair{1U, 5.0}, std::pair{10U, 50.0}}) {
    const json truth = experiment(config(broadcast(period_ms)), log_with(kept, nth));
    EXPECT_EQ(truth.at("outcome"), "completed");
    EXPECT_NEAR(truth.at("mu_max").get<double>(), 0.105, 0.004);
    const json found =
        experiment(config(kUds + std::to_string(period_ms) + " }"), log_with(answer, nth));
    EXPECT_EQ(found, truth) << period_ms;
  }
}

// A local identifier among others, 29-bit addresses, and an answer on CAN FD, 5 ms after it was
// asked for.
TEST_F(UdsReplay, LocalIdentifiersOnCanFd) {
  const std::string role =
      "{ uds = { request = 0x18DA10F1, response = 0x18DAF110, service = 0x21, did = 0x10, bytes = "
      "2,"
      " start = 0, length = 16, byte_order = \"little\", scale = 0.001 }, unit = \"bar\", "
      "period_ms = 10 }";
  std::size_t count = 0;
  const auto asked_and_answered = [&count](const Line& pressure) {
    Line line = pressure;
    if (count++ % 2 == 0) {
      line.id = "18DAF110";
      line.data = "#100096110" + pressure.data.substr(0, 4) + "2011223344CC";
    } else {
      line.id = "18DA10F1";
      line.data = "03211020CCCCCCCC";
    }
    return line.text();
  };
  const std::string log = log_with(asked_and_answered);
  const json truth = experiment(config(broadcast(10.0)),
                                log_with([](const Line& line) { return line.text(); }, 2));
  EXPECT_EQ(experiment(config(role), log), truth);

  const RunResult result = beltgrip(
      {"check", place_->path("case.log"), "--config", place_->path("case.toml"), "--json", "-"});
  ASSERT_EQ(result.status, 0) << result.err;
  const json pressure = json::parse(result.out).at("roles").at("secondary_pressure");
  EXPECT_NEAR(pressure.at("rate_Hz").get<double>(), 100.0, 2.0);
  EXPECT_NEAR(pressure.at("request_Hz").get<double>(), 100.0, 2.0);
  EXPECT_NEAR(pressure.at("answer_s").get<double>(), 0.005, 0.0005);
  EXPECT_NEAR(pressure.at("requests").get<double>(), pressure.at("frames").get<double>(), 1.0);
}

TEST_F(UdsReplay, BigEndianAnswersAndSuchOfSeveralFrames) {
  const auto kept = [](const Line& line) { return line.text(); };
  const json truth = experiment(config(broadcast(5.0)), log_with(kept));
  std::string big = std::string(kUds) + "5.0 }";
  big.replace(big.find("start = 0"), 9, "start = 7");
  big.replace(big.find("little"), 6, "big");
  const auto swapped = [](const Line& pressure) {
    Line line = pressure;
    line.data = pressure.data.substr(2, 2) + pressure.data.substr(0, 2);
    return answer(line);
  };
  EXPECT_EQ(experiment(config(big), log_with(swapped)), truth);

  // Eleven bytes; the flow control is the tester's.
  const auto several = [](const Line& pressure) {
    Line first = pressure, flow = pressure, second = pressure;
    first.id = second.id = "7E9";
    flow.id = "7E1";
    first.data = "100B621101" + pressure.data.substr(0, 4) + "00";
    flow.data = "300000";
    second.data = "210102030405CCCC";
    return first.text() + flow.text() + second.text();
  };
  EXPECT_EQ(experiment(config(std::string(kUds) + "5.0 }"), log_with(several)), truth);
}

TEST_F(UdsReplay, RefusalsAndSilenceAreNoValue) {
  for (const char* instead : {"037F2231CCCCCCCC", "037F2278CCCCCCCC", "04621101AACCCCCC",
                              "05621102AAAACCCC", "100B621101AAAA00"}) {
    std::size_t count = 0;
    const auto refused = [&](const Line& pressure) {
      if (count++ < 1000) return answer(pressure);  // 5 s
      Line line = pressure;
      line.id = "7E9";
      line.data = instead;
      return line.text();
    };
    const json found = experiment(config(std::string(kUds) + "5.0 }"), log_with(refused));
    EXPECT_EQ(found.at("outcome"), "aborted") << instead;
    EXPECT_EQ(found.at("stop_reason"), "inputs") << instead;
    EXPECT_NEAR(found.at("stop_s").get<double>(), 85.05, 0.02) << instead;
  }
}

// Two interfaces interleaved: the pressure on can1, and there and on vcan0 what must not be taken.
TEST_F(UdsReplay, InterfacesAreTheBusesOfTheConfiguration) {
  const auto kept = [](const Line& line) { return line.text(); };
  const json truth = experiment(config(broadcast(5.0)), log_with(kept));
  const std::string bus = "[bus.diag]\ninterface = \"can1\"\n";
  const auto strangers = [](const Line& pressure) {
    Line line = pressure, wrong_bus = pressure, speeds = pressure;
    line.interface = speeds.interface = "can1";
    wrong_bus.data = "FFFF00000000";
    speeds.id = "110";
    speeds.data = "0000000000000000";
    return wrong_bus.text() + speeds.text() + line.text();
  };
  // "In the broadcast on vcan0" stands 65.535 bar, the speeds on can1 stand still.
  const std::string on_diag =
      "{ signal = \"RIG_Pressure.SecondaryPressure\", period_ms = 5.0, bus = \"diag\" }";
  EXPECT_EQ(experiment(config(on_diag, bus), log_with(strangers)), truth);

  const auto answers = [](const Line& pressure) {
    Line right = pressure, wrong = pressure;
    right.interface = "can1";
    wrong.data = "FFFE";
    return answer(wrong) + answer(right);
  };
  const std::string uds_on_diag = std::string(kUds) + "5.0, bus = \"diag\" }";
  EXPECT_EQ(experiment(config(uds_on_diag, bus), log_with(answers)), truth);
}

TEST_F(UdsReplay, RequestsOnlyWhereTheyAreAllowedAndAtTheirRate) {
  const std::string role = std::string(kUds) + "50.0, bus = \"diag\" }";
  const std::string bus = "[bus.diag]\ninterface = \"can1\"\n";
  const auto on_diag = [](const Line& pressure) {
    Line line = pressure;
    line.interface = "can1";
    return answer(line);
  };
  const std::string log = log_with(on_diag, 10);
  const json listened = replay(config(role, bus), log, "listen.log").at(0);
  EXPECT_EQ(place_->read("listen.log").find("7E1#"), std::string::npos);
  EXPECT_EQ(place_->read("listen.log").find("can1"), std::string::npos);

  const json polled = replay(config(role, "diagnostics = \"poll\"\n" + bus), log, "poll.log").at(0);
  EXPECT_EQ(polled, listened);
  const std::string out = place_->read("poll.log");
  std::istringstream stream(out);
  long requests = 0;
  for (std::string line; std::getline(stream, line);) {
    if (line.find("can1") == std::string::npos) continue;
    EXPECT_TRUE(line.ends_with("can1 7E1#03221101CCCCCCCC")) << line;
    ++requests;
  }
  // 20.8 s.
  EXPECT_GT(requests, 200);
  EXPECT_LE(requests, 418);
}

// A candump of a daemon that polled, replayed: its own requests are no other tester's.
TEST_F(UdsReplay, TheRequestsOfTheRecordedDaemonAreItsEchoes) {
  const std::string role = std::string(kUds) + "50.0 }";
  const std::string toml = config(role, "diagnostics = \"poll\"\n");
  const auto asked = [](const Line& pressure) {
    Line request = pressure;
    request.id = "7E1";
    request.data = "03221101CCCCCCCC";
    return request.text() + answer(pressure);
  };
  const json without = replay(toml, log_with(answer, 10), "1.log").at(0);
  EXPECT_EQ(replay(toml, log_with(asked, 10), "2.log").at(0), without);
  EXPECT_NE(place_->read("2.log").find("7E1#"), std::string::npos);
}

}  // namespace
}  // namespace beltgrip::test
