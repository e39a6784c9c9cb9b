// Events between reports, their text, and the ring they cross.
#include "daemon/core/event.h"

#include <gtest/gtest.h>

#include <memory>
#include <thread>
#include <vector>

namespace beltgrip::daemon {
namespace {

using estimator::PeakKind;
using estimator::StopReason;

struct Bench {
  std::vector<std::string> report() {
    sink.on_report(now);
    now.new_result = false;
    std::vector<std::string> texts;
    Event event;
    while (ring->pop(event)) texts.push_back(text_of(event));
    return texts;
  }
  std::unique_ptr<EventRing> ring = std::make_unique<EventRing>();
  EventSink sink{*ring};
  SampleReport now;
};

TEST(EventSink, OneEventForEachChange) {
  Bench bench;
  EXPECT_TRUE(bench.report().empty());
  bench.now.state = State::kRamping;
  EXPECT_EQ(bench.report(), std::vector<std::string>{"state Inhibited -> Ramping"});
  EXPECT_TRUE(bench.report().empty());
  bench.now.faults = fault_bit(Fault::kInputStale) | fault_bit(Fault::kFrameRefused);
  EXPECT_EQ(bench.report(), (std::vector<std::string>{"fault InputStale", "fault FrameRefused"}));
  bench.now.faults = fault_bit(Fault::kFrameRefused);
  EXPECT_EQ(bench.report(), std::vector<std::string>{"fault InputStale gone"});
}

TEST(EventSink, StopAndResult) {
  Bench bench;
  bench.now.macro_slip_stop = true;
  bench.now.curve.stop = StopReason::kSlope;
  bench.now.curve.sigma_star_percent = 3.456;
  bench.now.curve.mu_star = 0.10451;
  EXPECT_EQ(bench.report(),
            std::vector<std::string>{"MacroSlipStop, reason Slope, slip 3.46 %, mu* 0.1045"});
  bench.now.new_result = true;
  bench.now.result.outcome = Outcome::kCompleted;
  bench.now.result.stop_reason = StopReason::kSlope;
  bench.now.result.peak.kind = PeakKind::kValue;
  bench.now.result.peak.mu_max = 0.1049;
  bench.now.result.peak.mu_max_std = 0.0003;
  EXPECT_EQ(
      bench.report(),
      std::vector<std::string>{"experiment Completed, stop reason Slope, mu_max 0.1049 +- 0.0003"});
  bench.now.new_result = true;
  bench.now.result.outcome = Outcome::kInconclusive;
  bench.now.result.stop_reason = StopReason::kTraceEnd;
  bench.now.result.peak.kind = PeakKind::kLowerBound;
  EXPECT_EQ(bench.report(),
            std::vector<std::string>{
                "experiment Inconclusive, stop reason TraceEnd, mu_max above 0.1049"});
}

TEST(EventSink, AnAbortNamesItsOwnReason) {
  Bench bench;
  bench.now.macro_slip_stop = true;
  bench.now.new_result = true;
  bench.now.result.outcome = Outcome::kAborted;
  bench.now.result.stop_reason = StopReason::kInputs;
  const auto texts = bench.report();
  ASSERT_EQ(texts.size(), 2U);
  EXPECT_TRUE(texts[0].starts_with("MacroSlipStop, reason Inputs"));
  EXPECT_EQ(texts[1], "experiment Aborted, stop reason Inputs");
}

TEST(SpscRing, DropsAndCountsWhenFull) {
  SpscRing<int, 4> ring;
  for (int i = 0; i < 6; ++i) EXPECT_EQ(ring.push(i), i < 4);
  EXPECT_EQ(ring.dropped(), 2U);
  int value = 0;
  for (int i = 0; i < 4; ++i) {
    EXPECT_TRUE(ring.pop(value));
    EXPECT_EQ(value, i);
  }
  EXPECT_FALSE(ring.pop(value));
  EXPECT_TRUE(ring.push(9));
  EXPECT_TRUE(ring.pop(value));
  EXPECT_EQ(value, 9);
}

TEST(SpscRing, ElementsCrossInOrder) {
  constexpr std::uint64_t kCount = 200'000;
  SpscRing<std::uint64_t, 64> ring;
  std::thread producer([&] {
    for (std::uint64_t i = 0; i < kCount;) i += ring.push(i) ? 1 : 0;
  });
  std::uint64_t value = 0;
  for (std::uint64_t i = 0; i < kCount;) {
    if (!ring.pop(value)) continue;
    ASSERT_EQ(value, i);
    ++i;
  }
  producer.join();
}

}  // namespace
}  // namespace beltgrip::daemon
