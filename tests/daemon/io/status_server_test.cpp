// What a client of the status socket gets.
#include "daemon/io/status_server.h"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/daemon/test_vehicle.h"

namespace beltgrip::daemon {

using estimator::ReadingVerdict;
namespace {

int connect_to(const std::string& folder) {
  const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  (folder + "/status.sock").copy(address.sun_path, sizeof address.sun_path - 1);
  EXPECT_EQ(connect(fd, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  return fd;
}

std::string read_all(int fd) {
  std::string text;
  std::array<char, 4096> buffer{};
  for (ssize_t size; (size = read(fd, buffer.data(), buffer.size())) > 0;) {
    text.append(buffer.data(), static_cast<std::size_t>(size));
  }
  close(fd);
  return text;
}

TEST(StatusServer, AnswersEachClientOnceTheLoopHasSampled) {
  const test::TemporaryDirectory folder;
  StatusServer server(folder.path());
  ASSERT_EQ(server.error(), "");
  struct stat status {};
  ASSERT_EQ(stat((folder.path() + "/status.sock").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777U, 0666U) << "for every user";
  const int first = connect_to(folder.path());
  const int second = connect_to(folder.path());
  const Config config;
  server.turn(config, MonoTime{}, nullptr);  // they wait on
  Observation observation;
  observation.pipeline.samples = 7;
  server.turn(config, MonoTime{}, &observation);
  for (const int fd : {first, second}) {
    EXPECT_EQ(nlohmann::json::parse(read_all(fd)).at("counters").at("samples"), 7);
  }
}

TEST(StatusServer, OneThatWasKilledLeavesNothingInTheWay) {
  const test::TemporaryDirectory folder;
  folder.write("status.sock", "left behind");
  const StatusServer server(folder.path());
  EXPECT_EQ(server.error(), "");
}

TEST(StatusServer, WithoutAFolderThatCanBeWrittenItSaysSoAndGoesOn) {
  StatusServer server("/nowhere");
  EXPECT_NE(server.error().find("/nowhere/status.sock"), std::string::npos) << server.error();
  const Observation observation;
  server.turn(Config{}, MonoTime{}, &observation);
  const StatusServer unasked("");
  EXPECT_EQ(unasked.error(), "");
}

TEST(StatusServer, ClientsThatLeaveOrNeverReadDoNoHarm) {
  const test::TemporaryDirectory folder;
  StatusServer server(folder.path());
  close(connect_to(folder.path()));
  const int lazy = connect_to(folder.path());
  const Observation observation;
  server.turn(Config{}, MonoTime{}, &observation);
  EXPECT_FALSE(read_all(lazy).empty());
}

TEST(StatusJson, SaysWhatIsKnownAndNullForTheRest) {
  Observation observation;
  observation.t = MonoTime{9 * kSecond};
  observation.report.state = State::kRamping;
  observation.report.faults = fault_bit(Fault::kInputStale);
  observation.report.curve.usable = true;  // but the sample is not
  observation.report.curve.mu_star = 0.1;
  SignalObservation& speed = observation.signals[static_cast<std::size_t>(Role::kPrimarySpeed)];
  speed = {.status = {.verdict = ReadingVerdict::kStale,
                      .since_ns = (6 * kSecond).ns(),
                      .expected = 104.5,
                      .variance = 0.25,
                      .test_ratio = 0.4},
           .seen = true,
           .value = 105.0,
           .t = MonoTime{8 * kSecond}};
  SignalObservation& torque = observation.signals[static_cast<std::size_t>(Role::kEngineTorque)];
  torque.status.verdict = ReadingVerdict::kMissing;
  observation.loop.wake_up.add(Duration::of_ns(100'000));
  auto status = nlohmann::json::parse(status_json(Config{}, MonoTime{10 * kSecond}, observation));
  EXPECT_EQ(status.at("state"), "Ramping");
  EXPECT_EQ(status.at("faults"), nlohmann::json::array({"InputStale"}));
  EXPECT_EQ(status.at("result"), nullptr);
  EXPECT_EQ(status.at("mu_star"), nullptr);
  EXPECT_EQ(status.at("age_s"), 1.0);
  EXPECT_EQ(status.at("signals").at("primary_speed").at("age_s"), 2.0);
  EXPECT_EQ(status.at("signals").at("primary_speed").at("unit"), "rad/s");
  EXPECT_EQ(status.at("signals").at("primary_speed").at("since_s"), 4.0);
  EXPECT_EQ(status.at("signals").at("primary_speed").at("expected"), 104.5);
  EXPECT_EQ(status.at("signals").at("primary_speed").at("deviation"), 0.5);
  EXPECT_EQ(status.at("signals").at("primary_speed").at("test_ratio"), 0.4);
  EXPECT_EQ(status.at("signals").at("engine_torque").at("test_ratio"), nullptr);
  EXPECT_EQ(status.at("signals").at("engine_torque").at("value"), nullptr);
  EXPECT_FALSE(status.at("signals").contains("oil_temperature")) << "has no signal";
  EXPECT_EQ(status.at("latency").at("wake_up").at("max_us"), 100.0);
  EXPECT_EQ(status.at("latency").at("wake_up").at("classes").size(), 1U);

  observation.report.sample.usable = true;
  observation.report.curve.friction_slope = std::numeric_limits<double>::infinity();
  observation.report.result.outcome = Outcome::kInconclusive;
  observation.report.result.peak.kind = estimator::PeakKind::kLowerBound;
  observation.report.result.peak.mu_max = 0.09;
  status = nlohmann::json::parse(status_json(Config{}, MonoTime{10 * kSecond}, observation));
  EXPECT_EQ(status.at("mu_star"), 0.1);
  EXPECT_EQ(status.at("friction_slope"), nullptr);
  EXPECT_EQ(status.at("result").at("mu_max"), nullptr) << "a bound is no value";
  EXPECT_EQ(status.at("result").at("mu_max_lower_bound"), 0.09);
}

}  // namespace
}  // namespace beltgrip::daemon
