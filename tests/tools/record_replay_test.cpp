// The flight recorder's file as users call `beltgrip replay` on it.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "can_dbc/can_log.h"
#include "daemon/core/loop.h"
#include "daemon/io/flight_recorder.h"
#include "tests/daemon/frame_player.h"
#include "tests/daemon/test_vehicle.h"
#include "tests/tools/program.h"

namespace beltgrip::test {
namespace {

using namespace daemon;

// A run on two interfaces: every frame stands under the name of the interface it came from or went
// to, and `beltgrip replay` of the record gives the result and the frames of the run.
TEST(RecordReplay, TwoBusesUnderTheirNames) {
  const Workplace place;
  place.write("vehicle.dbc", kVehicleDbc);
  place.write("beltgrip.toml", two_bus_toml());
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

}  // namespace
}  // namespace beltgrip::test
