// After start-up the loop's thread allocates nothing: a full run on the embedded bus, from before
// the first frame to after the last, with an experiment from its start to its result, and again
// with everything that goes wrong on the way. The guard is seen to fail on a planted allocation.
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "daemon/core/loop/loop.h"
#include "daemon/core/loop/pipeline.h"
#include "daemon/core/observe/event.h"
#include "daemon/core/observe/observation.h"
#include "daemon/io/inproc_bus.h"
#include "tests/daemon/test_vehicle.h"
#include "tests/support/alloc_guard.h"

namespace beltgrip::daemon {
namespace {

// Keeps the last result; allocates on the first report where it is told to.
class Sink final : public SampleSink {
 public:
  Sink(const Pipeline& pipeline, bool allocates)
      : allocates_(allocates), events_(ring), observations_(pipeline, meters, slot_) {}
  void on_report(const SampleReport& report) noexcept override {
    events_.on_report(report);
    observations_.on_report(report);
    if (report.new_result) result = report.result;
    samples += 1;
    if (allocates_) planted_ = std::make_unique<int>(1);
    allocates_ = false;
  }
  EventRing ring;
  LoopMeters meters;
  ExperimentResult result;
  std::size_t samples = 0;

 private:
  bool allocates_;
  EventSink events_;
  LatestSlot<Observation> slot_;
  ObservationSink observations_;
  std::unique_ptr<int> planted_;
};

struct Observed {
  std::size_t allocations = 0, frees = 0, first_size = 0;
  std::size_t samples = 0;
  ExperimentResult result;
};

Observed run_guarded(const Config& config, const std::vector<can::StampedFrame>& frames,
                     bool planted = false) {
  const auto bus = InprocBus::create(InprocBus::Clock::kVirtual);
  const std::unique_ptr<Port> port = bus->connect();
  std::unique_ptr<Port> feeder = bus->connect();
  Pipeline pipeline(config);
  Sink sink(pipeline, planted);
  std::thread vehicle([&] {
    for (const can::StampedFrame& each : frames) {
      while (feeder->now().ns() < each.t_ns) {
        if (feeder->wait_until(MonoTime::of_ns(each.t_ns)) != Wake::kFrames) continue;
        std::array<RxFrame, 16> ignored;
        feeder->receive(ignored);
      }
      feeder->send(each.frame);
    }
    bus->close();
    feeder.reset();
  });
  Observed observed;
  const auto record = std::make_unique<RecordRings>();
  RecordTap tap(*record);
  {
    const test::AllocGuard guard;
    run_loop(*port, pipeline, config.estimator.sample_rate_hz, estimator::StopReason::kShutdown,
             &sink, &sink.meters, &tap);
    observed.allocations = test::AllocGuard::allocations();
    observed.frees = test::AllocGuard::frees();
    observed.first_size = test::AllocGuard::first_size();
  }
  vehicle.join();
  observed.samples = sink.samples;
  observed.result = sink.result;
  return observed;
}

TEST(AllocGuard, SeesEveryKindOfAllocation) {
  const auto count = [](const auto& act) {
    const test::AllocGuard guard;
    act();
    return test::AllocGuard::allocations();
  };
  EXPECT_EQ(count([] {}), 0U);
  void* volatile kept = nullptr;
  EXPECT_EQ(count([&] { kept = std::malloc(10); }), 1U);
  EXPECT_EQ(count([&] { std::free(kept); }), 0U);
  EXPECT_GE(count([&] { kept = ::operator new(10); }), 1U);
  ::operator delete(kept);
  EXPECT_GE(count([&] { kept = ::operator new (10, std::align_val_t{64}); }), 1U);
  ::operator delete (kept, std::align_val_t{64});
  EXPECT_GE(count([] { std::vector<int>(100).swap(*std::make_unique<std::vector<int>>()); }), 1U);
  EXPECT_GE(count([] { EXPECT_NE(std::string(100, 'x'), ""); }), 1U);
}

TEST(NoAlloc, AWholeRunWithAnExperiment) {
  for (const char* method : {"robust", "paper"}) {
    const Config config = test::vehicle_config(std::string(test::kVehicleToml) +
                                               "[estimator]\nmethod = \"" + method + "\"\n");
    const Observed observed = run_guarded(config, test::drive_frames({}));
    EXPECT_GT(observed.samples, 2000U) << method;
    EXPECT_NE(observed.result.outcome, Outcome::kNone) << method;
    EXPECT_EQ(observed.allocations, 0U) << method << ", first " << observed.first_size << " bytes";
    EXPECT_EQ(observed.frees, 0U) << method;
  }
}

TEST(NoAlloc, AnExperimentThatRestsOnAssumptions) {
  Config config = test::vehicle_config();
  config.assumed_constants.set();
  config.friction_is_assumed = true;
  const Observed observed = run_guarded(config, test::drive_frames({}));
  EXPECT_EQ(observed.result.outcome, Outcome::kCompleted);
  EXPECT_LT(observed.result.peak.ci95_low, 0.09);
  EXPECT_EQ(observed.allocations, 0U) << "first " << observed.first_size << " bytes";
}

TEST(NoAlloc, ARunWithEverythingWrong) {
  auto frames = test::drive_frames({});
  for (std::size_t i = 0; i < frames.size(); ++i) {
    can::CanFrame& frame = frames[i].frame;
    if (i % 97 == 0) frame.length = 3;
    if (i % 101 == 0) frame.data.fill(0xFF);
    if (i % 103 == 0) frame.id = {0x6A1, false};
    if (i % 107 == 0) frame.error = true, frame.id = {0x40, false};
    if (i % 109 == 0) frame.fd = true;
  }
  const Observed observed = run_guarded(test::vehicle_config(), frames);
  EXPECT_EQ(observed.result.outcome, Outcome::kAborted);
  EXPECT_EQ(observed.allocations, 0U) << "first " << observed.first_size << " bytes";
}

// The pressure in diagnostic answers, every tenth of them a long one, and polled for.
TEST(NoAlloc, ARunWithDiagnostics) {
  std::string toml = test::kVehicleToml;
  const std::string role = "\"Pressure.SecondaryPressure\"";
  toml.replace(toml.find(role), role.size(),
               "{ uds = { request = 0x7E1, response = 0x7E9, did = 0x1101, start = 7, length = 16, "
               "scale = 0.001 }, unit = \"bar\", period_ms = 20 }");
  toml.insert(toml.find("[signals]"), "diagnostics = \"poll\"\n");
  std::vector<can::StampedFrame> frames;
  std::size_t count = 0;
  for (const can::StampedFrame& each : test::drive_frames({})) {
    frames.push_back(each);
    can::CanFrame& frame = frames.back().frame;
    if (frame.id != can::CanId{0x101, false}) continue;
    const auto high = frame.data[0], low = frame.data[1];
    const bool is_long = count++ % 10 == 9;
    frame.id = {0x7E9, false};
    frame.length = 8;
    frame.data = is_long ? decltype(frame.data){0x10, 0x09, 0x62, 0x11, 0x01, high, low, 0}
                         : decltype(frame.data){0x05, 0x62, 0x11, 0x01, high, low, 0xAA, 0xAA};
    if (!is_long) continue;
    frames.push_back(frames.back());
    frames.back().frame.data = {0x21, 1, 2, 3, 0xAA, 0xAA, 0xAA, 0xAA};
  }
  ASSERT_GT(count, 100U);
  const Observed observed = run_guarded(test::vehicle_config(toml), frames);
  EXPECT_EQ(observed.result.outcome, Outcome::kCompleted);
  EXPECT_EQ(observed.allocations, 0U) << "first " << observed.first_size << " bytes";
  EXPECT_EQ(observed.frees, 0U);
}

TEST(NoAlloc, APlantedAllocationIsSeen) {
  test::Drive drive;
  drive.duration_s = 0.1;
  const Observed observed = run_guarded(test::vehicle_config(), test::drive_frames(drive), true);
  EXPECT_EQ(observed.allocations, 1U);
  EXPECT_EQ(observed.first_size, sizeof(int));
}

}  // namespace
}  // namespace beltgrip::daemon
