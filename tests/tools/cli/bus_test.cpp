// The programs on a real SocketCAN: simulate and replay play onto it, monitor shows what beltgripd
// says, each as a process of its own.
#include <csignal>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/support/program.h"
#include "tests/system/vcan/vcan_fixture.h"

namespace beltgrip::test {
namespace {

class Bus : public Vcan {};

std::string program(const char* name) {
  const std::string beltgrip = program_path();
  return beltgrip.substr(0, beltgrip.rfind('/') + 1) + name;
}

TEST_F(Bus, ASimulatedExperimentComesBackAsAResult) {
  const std::string place = folder();
  ASSERT_EQ(beltgrip({"simulate", "--start", "86", "--duration", "7", "--out-dir", place}).status,
            0);
  Process daemon({program("beltgripd"), "--config", place + "/beltgrip.toml"});
  ASSERT_TRUE(daemon.wait_for_error("InputMissing", kLimit)) << daemon.err();
  // Into files: a pipe that nobody empties would stop them.
  const std::string monitor = "exec " + program("beltgrip") + " monitor vcan0 ";
  Process json({"sh", "-c", monitor + "--json >" + place + "/json"});
  Process table({"sh", "-c", monitor + "--truth " + place + "/truth.json >" + place + "/table"});
  const RunResult played =
      beltgrip({"simulate", "--start", "86", "--duration", "7", "--bus", "vcan0"});
  EXPECT_EQ(played.status, 0) << played.err;
  for (Process* process : {&daemon, &json, &table}) {
    process->signal(SIGTERM);
    EXPECT_EQ(process->wait(kLimit), 0);
  }

  double mu_max = 0.0;
  std::ifstream stream(place + "/json");
  for (std::string line; std::getline(stream, line);) {
    const auto frame = nlohmann::json::parse(line);
    EXPECT_TRUE(frame.at("protection") == "ok" || frame.at("protection") == "ok_some_lost") << line;
    if (frame.at("message") == "BeltGripEstimate" && frame.at("signals").at("MuMaxValid") == 1) {
      mu_max = frame.at("signals").at("MuMax").get<double>();
    }
  }
  EXPECT_NEAR(mu_max, 0.105, 0.004);
  std::ostringstream shown;
  shown << std::ifstream(place + "/table").rdbuf();
  EXPECT_NE(shown.str().find("STOP"), std::string::npos) << shown.str();
  EXPECT_NE(shown.str().find("peak at 89.5"), std::string::npos) << shown.str();
}

TEST_F(Bus, ReplayPlaysALogAtItsOwnPace) {
  std::ofstream(folder() + "/x.log")
      << "(10.000000) can7 123#01\n(10.100000) can7 6A0#02\n"
         "(10.200000) can7 00000124#03\n(11.000000) can7 125##0AABB\n";
  const BusSocket bus("vcan0");
  const RunResult result =
      beltgrip({"replay", folder() + "/x.log", "--bus", "vcan0", "--speed", "2"});
  EXPECT_EQ(result.status, 0) << result.err;
  std::vector<ReceivedFrame> seen;
  while (const auto frame = bus.receive(Milliseconds{20})) seen.push_back(*frame);
  ASSERT_EQ(seen.size(), 3U);  // BeltGrip's own stays out
  EXPECT_EQ(seen[0].frame.can_id, 0x123U);
  EXPECT_EQ(seen[1].frame.can_id, 0x124U | CAN_EFF_FLAG);
  EXPECT_TRUE(seen[2].fd);
  const auto ms = (seen[2].t_ns - seen[0].t_ns) / 1'000'000;
  EXPECT_GE(ms, 499);
  EXPECT_LT(ms, 2000);
}

// check sees every frame, those of no role too, and sends none.
TEST_F(Bus, CheckListensAndSendsNothing) {
  const std::string place = folder();
  ASSERT_EQ(
      beltgrip({"simulate", "--scenario", "coast-overdrive", "--duration", "8", "--out-dir", place})
          .status,
      0);
  const BusSocket bus("vcan0");
  Process car({program("beltgrip"), "replay", place + "/trace.log", "--bus", "vcan0"});
  const RunResult result =
      beltgrip({"check", "--live", "4", "--config", place + "/beltgrip.toml", "--json", "-"});
  EXPECT_EQ(result.status, 0) << result.err;
  car.signal(SIGTERM);
  car.wait(kLimit);
  const auto found = nlohmann::json::parse(result.out);
  EXPECT_TRUE(found.at("roles").at("primary_speed").at("seen"));
  EXPECT_NEAR(found.at("roles").at("primary_speed").at("rate_Hz"), 100.0, 20.0);
  while (const auto frame = bus.receive(Milliseconds{20})) {
    EXPECT_LT(frame->frame.can_id, 0x6A0U);
  }
}

TEST_F(Bus, ABusThatIsNotThereIs69) {
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{"monitor", "vcan9"},
        std::vector<std::string>{"simulate", "--bus", "vcan9"}}) {
    const RunResult result = beltgrip(arguments);
    EXPECT_EQ(result.status, 69);
    EXPECT_EQ(lines(result.err), 1) << result.err;
    EXPECT_NE(result.err.find("vcan9"), std::string::npos);
  }
  ip({"link", "set", "vcan0", "down"});
  EXPECT_EQ(beltgrip({"simulate", "--bus", "vcan0"}).status, 69);
}

}  // namespace
}  // namespace beltgrip::test
