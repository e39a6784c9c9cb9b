// What the helper thread sees of the loop: the newest value without tearing, latency classes, and
// an observation of a running pipeline.
#include "daemon/core/observe/observation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <random>
#include <thread>
#include <vector>

#include "tests/daemon/frame_player.h"
#include "tests/daemon/test_vehicle.h"

namespace beltgrip::daemon {

using estimator::ReadingVerdict;
namespace {

struct Pair {
  std::uint64_t number = 0;
  std::array<std::uint64_t, 64> copies{};
};

TEST(LatestSlot, GivesTheNewestOnceAndKeepsIt) {
  LatestSlot<int> slot;
  EXPECT_FALSE(slot.take());
  slot.draft() = 1;
  slot.publish();
  slot.draft() = 2;
  slot.publish();
  EXPECT_TRUE(slot.take());
  EXPECT_EQ(slot.latest(), 2);
  EXPECT_FALSE(slot.take());
  EXPECT_EQ(slot.latest(), 2);
}

TEST(LatestSlot, IsNeverTornBetweenTwoThreads) {
  constexpr std::uint64_t kLast = 200'000;
  auto slot = std::make_unique<LatestSlot<Pair>>();
  std::thread producer([&] {
    for (std::uint64_t n = 1; n <= kLast; ++n) {
      slot->draft().number = n;
      slot->draft().copies.fill(n);
      slot->publish();
    }
  });
  std::uint64_t last = 0, torn = 0, backwards = 0;
  while (last < kLast) {
    if (!slot->take()) {
      std::this_thread::yield();
      continue;
    }
    const Pair& seen = slot->latest();
    for (const std::uint64_t copy : seen.copies) torn += copy != seen.number;
    backwards += seen.number <= last;
    last = seen.number;
  }
  producer.join();
  EXPECT_EQ(torn, 0U);
  EXPECT_EQ(backwards, 0U);
}

TEST(LatencyHistogram, EveryValueLiesBelowItsClassesBoundAndNotBelowTheOneBefore) {
  std::mt19937_64 random(1);
  for (int i = 0; i < 20000; ++i) {
    const auto value = Duration::of_ns(static_cast<std::int64_t>(random() >> (random() % 63 + 1)));
    LatencyHistogram one;
    one.add(value);
    std::size_t index = 0;
    while (one.count_of(index) == 0) ++index;
    if (index + 1 < LatencyHistogram::kClasses) {
      ASSERT_LT(value, one.upper_bound(index));
    }
    if (index > 0) {
      ASSERT_GE(value, one.upper_bound(index - 1)) << index;
    }
    ASSERT_EQ(one.maximum(), value);
  }
}

TEST(LatencyHistogram, QuantilesAreWithinAQuarterOfTheSortedOnes) {
  std::mt19937_64 random(2);
  std::lognormal_distribution<double> latency_ns(11.0, 1.0);  // about 60 us
  LatencyHistogram histogram;
  std::vector<Duration> sorted;
  for (int i = 0; i < 100000; ++i) {
    sorted.push_back(Duration::of_ns(static_cast<std::int64_t>(latency_ns(random))));
    histogram.add(sorted.back());
  }
  std::sort(sorted.begin(), sorted.end());
  EXPECT_EQ(histogram.count(), sorted.size());
  EXPECT_EQ(histogram.maximum(), sorted.back());
  for (const double q : {0.5, 0.9, 0.99, 0.999}) {
    const auto truth =
        static_cast<double>(sorted[static_cast<std::size_t>(q * double(sorted.size())) - 1].ns());
    const auto found = static_cast<double>(histogram.quantile(q).ns());
    EXPECT_GE(found, truth) << q;
    EXPECT_LE(found, 1.26 * truth) << q;
  }
}

TEST(LatencyHistogram, EdgesAreNumbers) {
  LatencyHistogram histogram;
  EXPECT_EQ(histogram.quantile(0.5), Duration{});
  histogram.add(Duration::of_ns(-5));
  EXPECT_EQ(histogram.quantile(1.0), Duration{});
  histogram.add(Duration::max());
  EXPECT_EQ(histogram.quantile(1.0), Duration::max());
  EXPECT_EQ(histogram.count(), 2U);
}

TEST(Observation, ShowsSignalsCountersAndState) {
  const Config config = test::vehicle_config();
  Pipeline pipeline(config);
  LoopMeters meters;
  auto slot = std::make_unique<LatestSlot<Observation>>();
  ObservationSink sink(pipeline, meters, *slot);
  test::Drive drive;
  drive.duration_s = 2.0;
  test::FramePlayer port(test::drive_frames(drive));
  run_loop(port, pipeline, 200.0, estimator::StopReason::kTraceEnd, &sink, &meters);
  ASSERT_TRUE(slot->take());
  const Observation& seen = slot->latest();
  EXPECT_GE(seen.pipeline.samples, 400U - ObservationSink::kSamples);
  // In log time everything is punctual, and counted.
  EXPECT_GT(meters.frame_age.count(), 400U);
  EXPECT_GT(meters.sample_to_frame.count(), 20U);
  EXPECT_EQ(meters.sample_to_frame.maximum(), Duration{});
  const SignalObservation& speed = seen.signals[static_cast<std::size_t>(Role::kPrimarySpeed)];
  EXPECT_EQ(speed.status.verdict, ReadingVerdict::kValid);
  ASSERT_TRUE(speed.seen);
  EXPECT_LE(seen.t - speed.t, 50 * kMillisecond);
  EXPECT_NEAR(speed.value, seen.report.sample.omega_p_rad_s, 0.05 * speed.value);
  const SignalObservation& oil = seen.signals[static_cast<std::size_t>(Role::kOilTemperature)];
  EXPECT_EQ(oil.status.verdict, pipeline.signal(Role::kOilTemperature).status.verdict);
}

TEST(Observation, IsRareUnlessSomethingIsNews) {
  Pipeline pipeline(test::vehicle_config());
  const LoopMeters meters;
  auto slot = std::make_unique<LatestSlot<Observation>>();
  ObservationSink sink(pipeline, meters, *slot);
  SampleReport report;
  int published = 0;
  for (int i = 0; i < 100; ++i) {
    sink.on_report(report);
    published += slot->take();
  }
  EXPECT_EQ(published, 100 / ObservationSink::kSamples);
  report.faults = fault_bit(Fault::kBusDown);
  sink.on_report(report);
  EXPECT_TRUE(slot->take());
  EXPECT_EQ(slot->latest().report.faults, report.faults);
}

}  // namespace
}  // namespace beltgrip::daemon
