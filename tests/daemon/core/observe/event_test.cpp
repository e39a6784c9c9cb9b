// Events between reports, their text, and the ring they cross.
#include "daemon/core/observe/event.h"
#include "daemon/core/observe/reasons_now.h"
#include "daemon/core/publish/names.h"

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "daemon/core/experiment/arming.h"

namespace beltgrip::daemon {

using estimator::ReadingVerdict;
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
  EXPECT_EQ(bench.report(),
            (std::vector<std::string>{
                "fault InputStale: it came and has stopped; to do: `beltgrip status` names the "
                "role; `period_ms` of a role that comes seldom",
                "fault FrameRefused: the transmit gate stopped a frame of our own; to do: a defect "
                "of BeltGrip: please report it"}));
  bench.now.faults = fault_bit(Fault::kFrameRefused);
  EXPECT_EQ(bench.report(), std::vector<std::string>{"fault InputStale gone"});
  bench.now.faults |= fault_bit(Fault::kForeignSender);
  bench.now.foreign_identifier = 0x6A3;
  EXPECT_EQ(bench.report(),
            std::vector<std::string>{
                "fault ForeignSender (0x6A3): another node sends with BeltGrip's identifiers; to "
                "do: a second daemon, or a log that is being played"});
}

TEST(EventSink, WhatAloneKeepsAnExperimentFromBeginning) {
  Bench bench;
  const auto after = [&](Duration duration, std::uint32_t inhibits) {
    bench.now.t += duration;
    bench.now.inhibits = inhibits;
    return bench.report();
  };
  const std::uint32_t brake = inhibit_bit(Inhibit::kBrake), pedal = inhibit_bit(Inhibit::kPedal);
  EXPECT_TRUE(after(kSecond, brake).empty());
  EXPECT_TRUE(after(kSecond - kNanosecond, brake).empty());
  EXPECT_EQ(after(kNanosecond, brake),
            std::vector<std::string>{
                "no experiment: brake: the brake is pressed; to do: coast without braking"});
  EXPECT_TRUE(after(kSecond, brake).empty());
  EXPECT_TRUE(after(kSecond, brake | pedal).empty());
  EXPECT_TRUE(after(2 * kSecond, brake | pedal).empty());
  EXPECT_TRUE(after(kSecond, inhibit_bit(Inhibit::kUnreachable)).empty());
  EXPECT_EQ(after(kSecond, inhibit_bit(Inhibit::kUnreachable)),
            std::vector<std::string>{
                "no experiment: unreachable: the floor of the clamping force lies above the force "
                "of the peak; to do: more torque, a lower pressure floor, a lower speed in "
                "overdrive; else a lower bound is all there is"});
  bench.now.in_experiment = true;
  EXPECT_TRUE(after(5 * kSecond, inhibit_bit(Inhibit::kUnreachable)).empty());
}

TEST(EventSink, StopAndResult) {
  Bench bench;
  bench.now.macro_slip_stop = true;
  bench.now.stop_reason = StopReason::kSlope;
  bench.now.stop_cause = {
      .what = "friction no longer rises with slip: slope", .figure = -0.0021, .unit = "1/%"};
  bench.now.curve.sigma_star_percent = 3.456;
  bench.now.curve.mu_star = 0.10451;
  EXPECT_EQ(bench.report(), std::vector<std::string>{
                                "MacroSlipStop, reason Slope (friction no longer rises with slip: "
                                "slope -0.0021 1/%), slip 3.46 %, mu* 0.1045"});
  bench.now.new_result = true;
  bench.now.result.outcome = Outcome::kCompleted;
  bench.now.result.stop_reason = StopReason::kSlope;
  bench.now.result.peak.kind = PeakKind::kValue;
  bench.now.result.peak.mu_max = 0.1049;
  bench.now.result.peak.mu_max_std = 0.0003;
  EXPECT_EQ(bench.report(),
            std::vector<std::string>{"experiment Completed, stop reason Slope (friction no longer "
                                     "rises with slip), mu_max 0.1049 +- 0.0003"});
  bench.now.new_result = true;
  bench.now.result.outcome = Outcome::kInconclusive;
  bench.now.result.stop_reason = StopReason::kTraceEnd;
  bench.now.result.peak.kind = PeakKind::kLowerBound;
  EXPECT_EQ(
      bench.report(),
      std::vector<std::string>{
          "experiment Inconclusive, stop reason TraceEnd (the log ended), mu_max above 0.1049"});
}

TEST(EventSink, AnAbortNamesItsOwnReason) {
  Bench bench;
  bench.now.macro_slip_stop = true;
  bench.now.stop_reason = StopReason::kInputs;
  bench.now.new_result = true;
  bench.now.result.outcome = Outcome::kAborted;
  bench.now.result.stop_reason = StopReason::kInputs;
  bench.now.result.cause = {.what = "silent for",
                            .figure = 0.055,
                            .limit = 0.05,
                            .unit = "s",
                            .role = Role::kSecondaryPressure};
  const auto texts = bench.report();
  ASSERT_EQ(texts.size(), 2U);
  EXPECT_TRUE(texts[0].starts_with("MacroSlipStop, reason Inputs"));
  EXPECT_EQ(texts[1],
            "experiment Aborted, stop reason Inputs (secondary_pressure: silent for 0.055 s, limit "
            "0.05 s); to do: the role stands in `reason`; `beltgrip status`");
}

// Without a value it is said first why, then how it ended, then what to do.
TEST(Event, AResultWithoutAValueSaysWhyAndWhatToDo) {
  Event event;
  event.id = EventId::kResult;
  event.result.outcome = Outcome::kInconclusive;
  event.result.stop_reason = StopReason::kForceFloor;
  event.result.cause = {.what = "the force floor lies above the peak's force",
                        .figure = 2203.0,
                        .limit = 1168.0,
                        .unit = "N"};
  EXPECT_EQ(
      text_of(event),
      "experiment Inconclusive, stop reason ForceFloor (too short, or too little torque or "
      "clamp force, or an input that stood still (the force floor lies above the peak's force "
      "2203 N, limit 1168 N)); to do: more torque, a lower floor, a lower speed");
  event.result.peak.kind = PeakKind::kLowerBound;
  event.result.peak.mu_max = 0.05;
  EXPECT_EQ(
      text_of(event),
      "experiment Inconclusive, stop reason ForceFloor (the force floor lies above the peak's "
      "force 2203 N, limit 1168 N), mu_max above 0.0500; to do: more torque, a lower floor, a "
      "lower speed");
  event.result.stop_reason = StopReason::kNone;
  event.result.cause = {};
  EXPECT_EQ(text_of(event),
            "experiment Inconclusive, stop reason None (it ended before friction came to its top: "
            "the clamping force was not lowered far enough), mu_max above 0.0500; to do: lower the "
            "clamping force further before the experiment ends");
}

// Each with its figure and limit, from the sample; by hand.
TEST(ReasonsNow, SayTheFigureBesideTheLimit) {
  Config config;
  config.trigger = Trigger::kCoastDown;
  config.control = Control::kCommand;
  config.experiment.primary_speed_min_rad_s = 100.0;
  SampleReport report;
  Signals signals{};
  for (SignalObservation& each : signals) each.status.verdict = ReadingVerdict::kUnbound;
  const auto now = [&] {
    std::vector<Reason> all;
    each_inhibit(config, report, signals, [&](Reason each) { all.push_back(std::move(each)); });
    return all;
  };
  const auto figure = [&](Inhibit inhibit) {
    report.inhibits = inhibit_bit(inhibit);
    const auto all = now();
    EXPECT_EQ(all.size(), 1U);
    EXPECT_FALSE(all[0].means.empty());
    return all[0].figure;
  };
  report.sample.omega_p_rad_s = 92.1;
  report.sample.omega_s_rad_s = 184.2;
  report.curve.torque_p_Nm = 4.0;
  report.oil_degC = 35.0;
  EXPECT_EQ(figure(Inhibit::kSpeed), "92.1 rad/s, limit 100 rad/s");
  EXPECT_EQ(figure(Inhibit::kRatio), "2.000, end stops 0.405 and 2.25");
  EXPECT_EQ(figure(Inhibit::kTorque), "4 Nm, limits 10 and 100 Nm of overrun");
  EXPECT_EQ(figure(Inhibit::kOil), "35 degC, limit 40 degC");
  EXPECT_EQ(figure(Inhibit::kCooldown), "limits 60 s and 1000 m");
  signals[static_cast<std::size_t>(Role::kAcceleratorPedal)] = {
      .status = {.verdict = ReadingVerdict::kValid}, .seen = true, .value = 0.125, .t = {}};
  EXPECT_EQ(figure(Inhibit::kPedal), "12.5 %, limit 2 %");
  signals[static_cast<std::size_t>(Role::kSecondaryPressure)].status.verdict =
      ReadingVerdict::kStale;
  EXPECT_EQ(figure(Inhibit::kInputs), "secondary_pressure stale");
  report.obstacle = {.what = "the ramp would last for", .figure = 18.0, .limit = 15.0, .unit = "s"};
  EXPECT_EQ(figure(Inhibit::kTime), "the ramp would last for 18 s, limit 15 s");
  EXPECT_EQ(figure(Inhibit::kBrake), "");
  // The obstacle is that of the most lasting one.
  report.inhibits = inhibit_bit(Inhibit::kTime) | inhibit_bit(Inhibit::kUnreachable);
  const auto both = now();
  ASSERT_EQ(both.size(), 2U);
  EXPECT_FALSE(both[0].figure.empty());
  EXPECT_TRUE(both[1].figure.empty());
  report.faults = fault_bit(Fault::kInputStale);
  std::string fault;
  each_fault(report, signals, [&](const Reason& each) { fault += reason_text(each); });
  EXPECT_EQ(fault,
            "InputStale (secondary_pressure): it came and has stopped; to do: `beltgrip status` "
            "names the role; `period_ms` of a role that comes seldom");
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

TEST(LineBudget, TenLinesASecondAndWhatWasLeftOut) {
  LineBudget budget;
  int lines = 0;
  unsigned more = 0;
  for (int i = 0; i < 100; ++i) {
    Event event;
    event.t = MonoTime{10 * kSecond + i * 5 * kMillisecond};
    event.id = EventId::kFaultRaised;
    lines += budget.take(event) ? 1 : 0;
    more += budget.left_out(event.t);
  }
  EXPECT_EQ(lines, static_cast<int>(LineBudget::kMost));
  Event stop;
  stop.t = MonoTime{10 * kSecond + 500 * kMillisecond};
  stop.id = EventId::kStop;
  EXPECT_TRUE(budget.take(stop));
  Event later;
  later.t = MonoTime{12 * kSecond};
  EXPECT_TRUE(budget.take(later));
  more += budget.left_out(later.t);
  EXPECT_EQ(more, 100U - LineBudget::kMost);
}

// What the program says, the document explains: a row for every inhibit, stop reason and fault.
TEST(NoResult, EveryReasonHasItsRow) {
  std::ifstream in(std::string(BELTGRIP_SOURCE_DIR) + "/tools/NO_RESULT.md");
  const std::string text((std::istreambuf_iterator<char>(in)), {});
  ASSERT_FALSE(text.empty());
  // First cells, which may name several.
  std::string cells;
  for (std::size_t at = text.find("\n| "); at != std::string::npos;
       at = text.find("\n| ", at + 1)) {
    cells += ", " + text.substr(at + 3, text.find(" |", at + 3) - at - 3);
  }
  cells += ",";
  const auto expect_row = [&](std::string_view name) {
    EXPECT_NE(cells.find(", " + std::string(name) + ","), std::string::npos) << name;
  };
  for (const auto& each : kInhibits) expect_row(each.name);
  for (const auto& each : kFaults) expect_row(each.name);
  for (std::size_t i = 0; i < estimator::kStopReasonCount; ++i) {
    expect_row(stop_reason_name(static_cast<StopReason>(i)));
  }
}

}  // namespace
}  // namespace beltgrip::daemon
