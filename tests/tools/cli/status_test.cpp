// beltgrip status against a server of its own that says what a daemon would.
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <csignal>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "daemon/io/status_server.h"
#include "tests/support/program.h"

namespace beltgrip::test {
namespace {

constexpr Milliseconds kStatusLimit{20'000};

// Gives one answer to each of the first clients, the last of them to all that follow unless it is
// empty: then nobody listens any more.
class Server {
 public:
  Server(std::string path, std::vector<std::string> answers)
      : path_(std::move(path)), answers_(std::move(answers)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path_.copy(address.sun_path, sizeof address.sun_path - 1);
    socket_ = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    EXPECT_EQ(bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    EXPECT_EQ(listen(socket_, 8), 0);
    thread_ = std::jthread([this] { serve(); });
  }
  ~Server() {
    shutdown(socket_, SHUT_RDWR);
    thread_.join();
    close(socket_);
  }
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

 private:
  void serve() {
    for (std::size_t turn = 0;; ++turn) {
      const std::string& answer = answers_[std::min(turn, answers_.size() - 1)];
      if (answer.empty()) {
        unlink(path_.c_str());
        return;
      }
      const int client = accept(socket_, nullptr, nullptr);
      if (client < 0) return;
      static_cast<void>(!write(client, answer.data(), answer.size()));
      close(client);
    }
  }

  std::string path_;
  std::vector<std::string> answers_;
  int socket_ = -1;
  std::jthread thread_;
};

daemon::Observation observed() {
  daemon::Observation observation;
  observation.pipeline.frames = 1234;
  return observation;
}

std::string answer(const daemon::Observation& observation) {
  daemon::Config config;
  config.interface = "can0";
  return daemon::status_json(config, daemon::MonoTime{2 * daemon::kSecond}, observation);
}

std::string answer_with_result() {
  daemon::Observation observation = observed();
  daemon::ExperimentResult& result = observation.report.result;
  result.outcome = daemon::Outcome::kCompleted;
  result.stop_reason = estimator::StopReason::kSlope;
  result.peak.kind = estimator::PeakKind::kValue;
  result.peak.mu_max = 0.0925;
  result.peak.mu_max_std = 0.0015;
  result.end = daemon::MonoTime{daemon::kSecond};
  observation.report.faults = 1;
  return answer(observation);
}

class StatusCommand : public testing::Test {
 protected:
  std::vector<std::string> command(std::vector<std::string> more) const {
    std::vector<std::string> words{"status", "--socket", place_.path("status.sock")};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  Workplace place_;
};

TEST_F(StatusCommand, SaysWhatWasCarriedWithoutSlip) {
  daemon::CarriedBounds bounds{};
  bounds[0].mu_star = 0.08;
  bounds[0].mu_max_least = 0.07;
  bounds[0].torque_Nm = 64.0;
  bounds[0].clamp_force_N = 5000.0;
  bounds[0].force_N_s = 100.0;
  bounds[0].used_N_s = 6.0;
  bounds[3].refused_mu_star = 0.4;
  const std::string text = daemon::status_json({}, daemon::MonoTime{}, observed(), bounds);
  const Server server(place_.path("status.sock"), {text});
  const std::string words = beltgrip(command({})).out;
  EXPECT_NE(
      words.find("drive, overdrive mu_max at least 0.0700, carried without slip at 64 Nm, 5000 "
                 "N; of the force 25 % and more was reserve\n"),
      std::string::npos)
      << words;
  EXPECT_NE(
      words.find("overrun, low     mu* 0.400 is read where the belt holds: more than any belt "
                 "has\n"),
      std::string::npos)
      << words;
  EXPECT_EQ(beltgrip(command({"--prometheus", place_.path("out.prom")})).status, 0);
  const std::string metrics = place_.read("out.prom");
  EXPECT_NE(
      metrics.find("beltgrip_carried_mu_max_lower_bound{interface=\"vcan0\",direction=\"drive\","
                   "ratio=\"overdrive\"} 0.07\n"),
      std::string::npos)
      << metrics;
}

TEST_F(StatusCommand, SaysItInWordsAndAsJson) {
  const Server server(place_.path("status.sock"), {answer_with_result()});
  const std::string words = beltgrip(command({})).out;
  EXPECT_NE(words.find("interface        can0, observe\n"), std::string::npos) << words;
  EXPECT_NE(words.find("last result      Completed, Slope, mu_max 0.0925 +- 0.0015, 1 s ago\n"),
            std::string::npos)
      << words;
  EXPECT_NE(words.find("frames           1234\n"), std::string::npos) << words;
  EXPECT_EQ(beltgrip(command({"--json"})).out, answer_with_result());
}

// Each sample of a text is "beltgrip_NAME{LABELS} NUMBER", below the lines that say what it is.
TEST_F(StatusCommand, WritesMetrics) {
  const Server server(place_.path("status.sock"), {answer_with_result()});
  const RunResult written = beltgrip(command({"--prometheus", place_.path("b.prom")}));
  EXPECT_EQ(written.status, 0) << written.err;
  const std::string text = place_.read("b.prom");
  for (const char* sample :
       {"beltgrip_up{interface=\"can0\"} 1\n", "beltgrip_mu_max{interface=\"can0\"} 0.0925\n",
        "# TYPE beltgrip_mu_max gauge\n", "beltgrip_result_age_seconds{interface=\"can0\"} 1\n",
        "beltgrip_frames_total{interface=\"can0\"} 1234\n",
        "# TYPE beltgrip_frames_total counter\n",
        "beltgrip_state{interface=\"can0\",state=\"Inhibited\"} 1\n"}) {
    EXPECT_NE(text.find(sample), std::string::npos) << sample << text;
  }
  std::istringstream in(text);
  std::string known;
  for (std::string line; std::getline(in, line);) {
    if (line.starts_with("# TYPE ")) known = line.substr(7, line.find(' ', 7) - 7);
    if (!line.starts_with('#')) {
      EXPECT_EQ(line.substr(0, line.find('{')), known);
    }
  }
}

TEST_F(StatusCommand, MetricsSayThatNobodyAnswers) {
  const RunResult result = beltgrip(command({"can0", "--prometheus", place_.path("b.prom")}));
  EXPECT_EQ(result.status, 69) << result.err;
  EXPECT_EQ(lines(result.err), 1) << result.err;
  const std::string text = place_.read("b.prom");
  EXPECT_NE(text.find("beltgrip_up{interface=\"can0\"} 0\n"), std::string::npos) << text;
  EXPECT_EQ(text.find("mu_max"), std::string::npos) << text;
}

TEST_F(StatusCommand, FollowsChangesAndWaitsForWhoIsGone) {
  const std::string quiet = answer(observed());
  const Server server(place_.path("status.sock"), {quiet, quiet, quiet, answer_with_result(), ""});
  std::vector<std::string> words = command({"--follow", "--interval", "0.1"});
  words.insert(words.begin(), program_path());
  Process follows(words);
  EXPECT_TRUE(follows.wait_for_error("waiting", kStatusLimit)) << follows.err();
  follows.signal(SIGINT);
  EXPECT_EQ(follows.wait(kStatusLimit), 0);
  EXPECT_EQ(lines(follows.out()), 2) << "one for each change: " << follows.out();
  EXPECT_NE(follows.out().find("last result: none yet"), std::string::npos) << follows.out();
  EXPECT_NE(follows.out().find("mu_max 0.0925"), std::string::npos) << follows.out();
  EXPECT_EQ(lines(follows.err()), 1) << follows.err();
}

TEST_F(StatusCommand, FollowsAsJsonLines) {
  const Server server(place_.path("status.sock"), {answer(observed())});
  std::vector<std::string> words = command({"--follow", "--json", "--interval", "0.1"});
  words.insert(words.begin(), program_path());
  Process follows(words);
  EXPECT_TRUE(follows.wait_until([](const Process& process) { return lines(process.out()) >= 3; },
                                 kStatusLimit));
  follows.signal(SIGTERM);
  EXPECT_EQ(follows.wait(kStatusLimit), 0) << follows.err();
  std::istringstream in(follows.out());
  for (std::string line; std::getline(in, line);) {
    EXPECT_EQ(nlohmann::json::parse(line).at("interface"), "can0");
  }
}

TEST_F(StatusCommand, RefusesWhatDoesNotGoTogether) {
  const RunResult result = beltgrip(command({"--prometheus", place_.path("b.prom"), "--json"}));
  EXPECT_EQ(result.status, 64);
  EXPECT_EQ(lines(result.err), 1) << result.err;
}

}  // namespace
}  // namespace beltgrip::test
