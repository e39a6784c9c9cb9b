// The flight recorder's file as users call `beltgrip replay` on it.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "can_dbc/log/can_log.h"
#include "daemon/core/loop/loop.h"
#include "daemon/io/flight_recorder.h"
#include "tests/daemon/frame_player.h"
#include "tests/daemon/test_vehicle.h"
#include "tests/support/program.h"

namespace beltgrip::test {
namespace {

using namespace daemon;

// A run on two interfaces: every frame stands under the name of the interface it came from or went
// to, and `beltgrip replay` of the record gives the result and the frames of the run.
TEST(RecordReplay, TwoBusesUnderTheirNames) {
  const Workplace place;
  place.write("vehicle.dbc", kVehicleDbc);
  place.write("beltgrip.toml", stated(two_bus_toml()));
  const Config config = vehicle_config(two_bus_toml());
  Drive drive;
  drive.active_from_ms = 1000;
  drive.active_to_ms = 9500;
  const std::vector<can::StampedFrame> all = two_bus_frames(drive);
  FramePlayer live(all);
  ReportKeeper reports;
  {
    RecordRings rings;
    RecordTap tap(rings);
    Pipeline pipeline(config);
    RecordLimits limits;
    limits.before = limits.after = 60 * kSecond;
    FlightRecorder recorder(place.path("record"), {"can0", "can1"}, rings, 0, limits);
    run_loop(live, pipeline, config.estimator.sample_rate_hz, estimator::StopReason::kShutdown,
             &reports, nullptr, &tap);
    recorder.stop();
    ASSERT_EQ(rings.items.dropped(), 0U);
  }
  std::vector<std::string> files;
  for (const auto& each : std::filesystem::directory_iterator(place.path("record"))) {
    files.push_back(each.path().string());
  }
  ASSERT_EQ(files.size(), 1U);
  const std::string& record = files[0];
  const auto log = can::LogReader::open(record);
  std::size_t count = 0;
  for (can::LogRecord line; log->next(line); ++count) {
    ASSERT_LT(count, all.size());
    EXPECT_EQ(line.interface, all[count].bus == 0 ? "can0" : "can1") << count;
    EXPECT_EQ(line.frame, all[count].frame) << count;
    EXPECT_EQ(line.t_ns, all[count].t_ns) << count;
  }
  EXPECT_EQ(count, all.size());

  const RunResult replay = beltgrip({"replay", record, "--config", place.path("beltgrip.toml"),
                                     "--json", "-", "--log-out", place.path("sent.log")});
  ASSERT_EQ(replay.status, 0) << replay.err;
  ASSERT_EQ(reports.results.size(), 1U);
  const ExperimentResult& result = reports.results[0];
  EXPECT_NEAR(result.peak.mu_max, kTrueMuMax, 0.01 * kTrueMuMax);
  const auto told = nlohmann::json::parse(replay.out.substr(0, replay.out.find('\n')));
  EXPECT_EQ(told.at("outcome"), "completed") << replay.out;
  EXPECT_EQ(told.at("mu_max").get<double>(), result.peak.mu_max);
  EXPECT_EQ(told.at("mu_max_std").get<double>(), result.peak.mu_max_std);
  const auto sent = can::LogReader::open(place.path("sent.log"));
  std::size_t again = 0;
  for (can::LogRecord line; sent->next(line); ++again) {
    ASSERT_LT(again, live.sent.size());
    EXPECT_EQ(line.interface, live.sent[again].bus == 0 ? "can0" : "can1") << again;
    EXPECT_EQ(line.frame, live.sent[again].frame) << again;
  }
  EXPECT_EQ(again, live.sent.size());
}

// Records of other versions than what this program writes.
TEST(RecordReplay, AnEarlierVersionIsUnderstoodAndALaterOneRefused) {
  const Workplace place;
  place.write("vehicle.dbc", kVehicleDbc);
  place.write("beltgrip.toml", stated(kVehicleToml));
  const auto replayed = [&](const std::string& version) {
    place.write("record.log", "# beltgrip-record " + version +
                                  " can0\n# (1.000000000) learned 0 0 0.1 - - -\n"
                                  "# (1.000000000) start\n(1.000000000) can0 103#0000\n"
                                  "# (2.000000000) end 2000000000\n");
    return beltgrip({"replay", place.path("record.log"), "--config", place.path("beltgrip.toml")});
  };
  for (const std::string version : {"1", "2"}) {
    const RunResult earlier = replayed(version);
    EXPECT_EQ(earlier.status, 0) << earlier.err;
    EXPECT_NE(earlier.err.find("record.log: a flight record of version " + version + ": "),
              std::string::npos)
        << earlier.err;
    EXPECT_EQ(lines(earlier.err.substr(0, earlier.err.find("frames/s"))), 1) << earlier.err;
  }
  const RunResult now = replayed("3");
  EXPECT_EQ(now.status, 0) << now.err;
  EXPECT_EQ(now.err.find("version"), std::string::npos) << now.err;
  for (const char* version : {"0", "4", "x", "99999999999999999999"}) {
    const RunResult other = replayed(version);
    EXPECT_EQ(other.status, 65) << version << other.err;
    EXPECT_NE(other.err.find("record.log: found a flight record of version "), std::string::npos)
        << other.err;
    EXPECT_NE(other.err.find("expected 1 to 3"), std::string::npos) << other.err;
    EXPECT_EQ(lines(other.err), 1) << other.err;
  }
}

// Two records in one file: what is between them costs nothing.
TEST(RecordReplay, ASilenceOfYearsEndsAtOnce) {
  const Workplace place;
  place.write("vehicle.dbc", kVehicleDbc);
  place.write("beltgrip.toml", stated(kVehicleToml));
  place.write("record.log",
              "# beltgrip-record 2 can0\n# (1.000000000) start\n(1.000000000) can0 103#0000\n"
              "(100000000.000000000) can0 103#0000\n");
  const RunResult result =
      run({"sh", "-c", "ulimit -t 8; exec \"$0\" \"$@\"", program_path(), "replay",
           place.path("record.log"), "--config", place.path("beltgrip.toml")},
          Milliseconds{240000});
  EXPECT_EQ(result.status, 0) << result.err;
}

// A pipe is read once only, from its beginning.
TEST(RecordReplay, ALogOutOfAPipeIsWhole) {
  const Workplace place;
  place.write("vehicle.dbc", kVehicleDbc);
  place.write("beltgrip.toml", stated(kVehicleToml));
  std::string log;
  for (int i = 0; i < 1000; ++i) {
    log += "(" + std::to_string(1 + i / 100) + "." + std::to_string(100 + i % 100) +
           ") can0 103#0000\n";
  }
  place.write("trace.log", log);
  const RunResult result =
      run({"sh", "-c", "cat \"$1\" | \"$0\" replay /dev/stdin --config \"$2\"", program_path(),
           place.path("trace.log"), place.path("beltgrip.toml")},
          Milliseconds{60000});
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_NE(result.out.find("1000 frames"), std::string::npos) << result.out;
}

}  // namespace
}  // namespace beltgrip::test
