// Logs as a timeline and as a port: merging, selection, garbled and stepping clocks; time passes
// only in wait_until and never beyond what has been taken.
#include "tools/ports/replay_port.h"

#include <gtest/gtest.h>

#include "tools/ports/log_timeline.h"

namespace beltgrip::ports {
namespace {

constexpr std::int64_t kMs = 1'000'000;
constexpr std::int64_t kS = 1'000'000'000;

struct Line {
  std::int64_t t_ns;
  std::uint32_t id = 0x100;
  const char* interface = "can0";
};

class FakeLog final : public can::LogReader {
 public:
  explicit FakeLog(std::vector<Line> lines) : lines_(std::move(lines)) {}
  bool next(can::LogRecord& record) override {
    if (stats_.frames == lines_.size()) return false;
    const Line& line = lines_[stats_.frames++];
    record.t_ns = line.t_ns;
    record.frame = {};
    record.frame.id.value = line.id;
    record.interface = line.interface;
    return true;
  }
  const can::LogStats& stats() const override { return stats_; }

 private:
  std::vector<Line> lines_;
  can::LogStats stats_;
};

LogTimeline timeline(std::vector<std::vector<Line>> logs, FrameSelection selection = {}) {
  std::vector<std::unique_ptr<can::LogReader>> readers;
  for (auto& log : logs) readers.push_back(std::make_unique<FakeLog>(std::move(log)));
  return LogTimeline(std::move(readers), std::move(selection));
}

std::vector<std::int64_t> stamps(LogTimeline& log) {
  std::vector<std::int64_t> result;
  can::StampedFrame frame;
  while (log.next(frame)) result.push_back(frame.t_ns);
  return result;
}

using Stamps = std::vector<std::int64_t>;

TEST(LogTimeline, MergesByStampAndKeepsTheOrderOfEqualOnes) {
  LogTimeline log =
      timeline({{{1 * kMs, 1}, {5 * kMs, 2}}, {{0, 3}, {5 * kMs, 4}, {9 * kMs, 5}}, {}});
  std::vector<std::uint32_t> ids;
  can::StampedFrame frame;
  while (log.next(frame)) ids.push_back(frame.frame.id.value);
  EXPECT_EQ(ids, (std::vector<std::uint32_t>{3, 1, 2, 4, 5}));
  EXPECT_EQ(log.counters().frames, 5u);
  EXPECT_EQ(log.counters().first_ns, 0);
  EXPECT_EQ(log.counters().last_ns, 9 * kMs);
  EXPECT_EQ(log.stats().frames, 5u);
}

TEST(LogTimeline, SelectsByInterfaceAndIdentifier) {
  FrameSelection selection;
  selection.interface = "can1";
  selection.ignored = {{0x6A0, false}};
  LogTimeline log = timeline({{{1, 0x100, "can0"},
                               {2, 0x100, "can1"},
                               {3, 0x6A0, "can1"},
                               {4, 0x6A0, "can0"},
                               {5, 0x101, "can1"},
                               {6, 0x101, "can11"}}},
                             selection);
  EXPECT_EQ(stamps(log), (Stamps{2, 5}));
}

TEST(LogTimeline, OfFramesThatAreNotWantedOnlyTheFirstAndTheLastAreHandedOver) {
  FrameSelection selection;
  selection.wanted = {{{0x100, false}, false}};
  LogTimeline log =
      timeline({{{1, 1}, {2, 0x100}, {3, 2}, {4, 2}, {5, 0x100}, {6, 3}, {7, 4}}}, selection);
  std::vector<std::uint32_t> ids;
  can::StampedFrame frame;
  while (log.next(frame)) ids.push_back(frame.frame.id.value);
  EXPECT_EQ(ids, (std::vector<std::uint32_t>{1, 0x100, 0x100, 4}));
  EXPECT_EQ(log.counters().frames, 7U);
  EXPECT_EQ(log.counters().first_ns, 1);
  EXPECT_EQ(log.counters().last_ns, 7);
}

// What is not wanted has a stamp as well, and keeps the order and the clock of the rest.
TEST(LogTimeline, FramesThatAreNotWantedKeepTheTime) {
  FrameSelection selection;
  selection.wanted = {{{0x100, false}, false}};
  LogTimeline log = timeline({{{1 * kS, 1},
                               {2 * kS, 0x100},
                               {900000000 * kS, 2},
                               {3 * kS, 2},
                               {2 * kS + 999 * kMs, 0x100},
                               {800000000 * kS, 2},
                               {800000001 * kS, 0x100}}},
                             selection);
  EXPECT_EQ(stamps(log), (Stamps{1 * kS, 2 * kS, 3 * kS, 603 * kS + 999 * kMs}));
  EXPECT_EQ(log.counters().frames_bad, 1U);
  EXPECT_EQ(log.counters().clock_steps, 1U);
}

TEST(WantedSet, GoesByIdentifierGroupAndBus) {
  const daemon::WantedFrames wanted[] = {
      {{0x100, false}, false}, {{0x200, false}, false, 1}, {{0x0CF00400, true}, true}};
  const WantedSet set(wanted);
  const auto has = [&](std::uint32_t id, bool extended, std::uint8_t bus, bool error = false) {
    can::CanFrame frame;
    frame.id = {id, extended};
    frame.error = error;
    return set.has(frame, bus);
  };
  EXPECT_TRUE(has(0x100, false, 0));
  EXPECT_FALSE(has(0x100, false, 1));
  EXPECT_FALSE(has(0x100, true, 0));
  EXPECT_TRUE(has(0x200, false, 1));
  EXPECT_FALSE(has(0x200, false, 0));
  EXPECT_TRUE(has(0x0CF004FE, true, 0));  // another source address of the group
  EXPECT_FALSE(has(0x0CF005FE, true, 0));
  EXPECT_FALSE(has(0x0CF004FE, true, 1));
  EXPECT_TRUE(has(0x4, false, 1, true));
  EXPECT_TRUE(WantedSet({}).has({}, 0));
}

TEST(LogTimeline, ALittleDisorderIsHeldBack) {
  LogTimeline log = timeline({{{10}, {30}, {20}, {40}}});
  EXPECT_EQ(stamps(log), (Stamps{10, 30, 30, 40}));
  EXPECT_EQ(log.counters().clock_steps, 0u);
}

TEST(LogTimeline, ALonelyLeapIsAGarbledLine) {
  LogTimeline log = timeline({{{1 * kS}, {900000000 * kS}, {1 * kS + kMs}, {1 * kS + 2 * kMs}}});
  EXPECT_EQ(stamps(log), (Stamps{1 * kS, 1 * kS + kMs, 1 * kS + 2 * kMs}));
  EXPECT_EQ(log.counters().frames_bad, 1u);
  EXPECT_EQ(log.counters().clock_steps, 0u);
}

// Time goes on from before it: no clock was set.
TEST(LogTimeline, ALonelyStepBackIsAGarbledLine) {
  for (const std::int64_t back : {0 * kS, 14 * kS}) {
    LogTimeline log = timeline({{{15 * kS + 540 * kMs},
                                 {15 * kS + 545 * kMs},
                                 {back},
                                 {15 * kS + 555 * kMs},
                                 {15 * kS + 560 * kMs}}});
    EXPECT_EQ(stamps(log), (Stamps{15 * kS + 540 * kMs, 15 * kS + 545 * kMs, 15 * kS + 555 * kMs,
                                   15 * kS + 560 * kMs}));
    EXPECT_EQ(log.counters().frames_bad, 1U);
    EXPECT_EQ(log.counters().clock_steps, 0U);
  }
}

TEST(LogTimeline, SoAreAFewStampsApartFromTheirNeighbours) {
  LogTimeline back = timeline({{{15 * kS}, {14 * kS - kMs}, {3 * kS}, {14 * kS}, {16 * kS}}});
  EXPECT_EQ(stamps(back), (Stamps{15 * kS, 15 * kS, 16 * kS})) << "14 s are a little disorder";
  EXPECT_EQ(back.counters().frames_bad, 2U);
  LogTimeline ahead = timeline({{{1 * kS}, {99 * kS}, {98 * kS}, {1 * kS + kMs}, {2 * kS}}});
  EXPECT_EQ(stamps(ahead), (Stamps{1 * kS, 1 * kS + kMs, 2 * kS}));
  EXPECT_EQ(ahead.counters().frames_bad, 2U);
  LogTimeline fall = timeline({{{1 * kS}, {99 * kS}, {50 * kS}, {1 * kS + kMs}, {2 * kS}}});
  EXPECT_EQ(stamps(fall), (Stamps{1 * kS, 1 * kS + kMs, 2 * kS}));
  EXPECT_EQ(fall.counters().frames_bad, 2U);
  // A row of a table is many frames of one stamp.
  std::vector<Line> rows{{5 * kS}};
  for (std::uint32_t column = 0; column < 40; ++column) rows.push_back({1 * kS, column});
  rows.push_back({5 * kS + kMs});
  LogTimeline row = timeline({rows});
  EXPECT_EQ(stamps(row), (Stamps{5 * kS, 5 * kS + kMs}));
  EXPECT_EQ(row.counters().frames_bad, 40U);
}

// It ran on from there until it passed the stamp from before, or the log ended.
TEST(LogTimeline, AStepBackThatLastsIsAClockThatWasSet) {
  std::vector<Line> lines{{10 * kS}};
  for (int i = 0; i <= 40; ++i) lines.push_back({8 * kS + 100 * i * kMs});
  LogTimeline log = timeline({lines});
  const Stamps found = stamps(log);
  ASSERT_EQ(found.size(), 42U);
  EXPECT_EQ(found[1], 10 * kS);
  EXPECT_EQ(found[41], 14 * kS);
  EXPECT_EQ(log.counters().frames_bad, 0U);
  EXPECT_EQ(log.counters().clock_steps, 1U);
  // Few frames, and a step so short that they come near the time before it at once.
  LogTimeline slow = timeline(
      {{{10 * kS}, {8 * kS + 800 * kMs}, {9 * kS}, {9 * kS + 200 * kMs}, {9 * kS + 400 * kMs}}});
  EXPECT_EQ(stamps(slow), (Stamps{10 * kS, 10 * kS, 10 * kS + 200 * kMs, 10 * kS + 400 * kMs,
                                  10 * kS + 600 * kMs}));
  EXPECT_EQ(slow.counters().frames_bad, 0U);
  LogTimeline last = timeline({{{10 * kS}, {11 * kS}, {2 * kS}}});
  EXPECT_EQ(stamps(last), (Stamps{10 * kS, 11 * kS, 11 * kS}));
  EXPECT_EQ(last.counters().clock_steps, 1U);
}

// However long the run of frames is that nobody can tell, it is held to its bound.
TEST(LogTimeline, AStampThatStandsLongIsNoGarbledLine) {
  std::vector<Line> lines{{5 * kS}};
  for (std::uint32_t i = 0; i < 10000; ++i) lines.push_back({1 * kS, i});
  lines.push_back({5 * kS});
  LogTimeline log = timeline({lines});
  EXPECT_EQ(stamps(log).size(), 10002U);
  EXPECT_EQ(log.counters().frames_bad, 0U);
}

TEST(LogTimeline, AClockSetBackOrFarAheadIsTakenOut) {
  LogTimeline back = timeline({{{5000 * kS}, {5001 * kS}, {1401 * kS}, {1402 * kS}}});
  EXPECT_EQ(stamps(back), (Stamps{5000 * kS, 5001 * kS, 5001 * kS, 5002 * kS}));
  EXPECT_EQ(back.counters().clock_steps, 1u);
  LogTimeline ahead = timeline({{{0}, {1 * kS}, {800000000 * kS}, {800000001 * kS}}});
  EXPECT_EQ(stamps(ahead), (Stamps{0, 1 * kS, 601 * kS, 602 * kS}));
  EXPECT_EQ(ahead.counters().clock_steps, 1u);
}

// A recorder that goes on after a stop, or over night: later results stand at the log's own stamps.
TEST(LogTimeline, APauseOfTheRecordingPasses) {
  constexpr std::int64_t kDay = 86'400 * kS;
  LogTimeline pause = timeline({{{0}, {1 * kS}, {1201 * kS}, {3 * kDay}, {3 * kDay + 1 * kS}}});
  EXPECT_EQ(stamps(pause), (Stamps{0, 1 * kS, 1201 * kS, 3 * kDay, 3 * kDay + 1 * kS}));
  EXPECT_EQ(pause.counters().clock_steps, 0u);
}

// Without a receiver nobody hears what is sent in a silence; with one, pauses alone are left out.
TEST(ReplayPort, WhatASilenceMayBeLeftOutOf) {
  const auto until = [](std::int64_t gap_ns, ReplayPort::Receiver receiver) {
    LogTimeline log = timeline({{{0}, {gap_ns}}});
    ReplayPort port(log, std::move(receiver));
    daemon::RxFrame frame;
    EXPECT_EQ(port.wait_until(daemon::MonoTime::of_ns(1 * kS)), daemon::Wake::kFrames);
    EXPECT_EQ(port.receive({&frame, 1}), 1u);
    EXPECT_EQ(port.wait_until(daemon::MonoTime::of_ns(1 * kS)), daemon::Wake::kDeadline);
    return port.silent_until();
  };
  const ReplayPort::Receiver heard = [](daemon::MonoTime, const can::CanFrame&, std::uint8_t) {};
  EXPECT_EQ(until(30 * kS, nullptr).ns(), 30 * kS);
  EXPECT_EQ(until(1201 * kS, nullptr).ns(), 1201 * kS);
  EXPECT_LE(until(30 * kS, heard).ns(), 1 * kS);
  EXPECT_EQ(until(1201 * kS, heard).ns(), 1201 * kS);
}

TEST(ReplayPort, StampsAreTheClock) {
  LogTimeline log = timeline({{{10 * kMs, 1}, {12 * kMs, 2}, {15 * kMs, 3}, {21 * kMs, 4}}});
  std::vector<std::int64_t> sent;
  ReplayPort port(
      log, [&](daemon::MonoTime t, const can::CanFrame&, std::uint8_t) { sent.push_back(t.ns()); });
  EXPECT_EQ(port.now().ns(), 10 * kMs);
  std::array<daemon::RxFrame, 2> two;
  EXPECT_EQ(port.receive(two), 1u);  // the first one has arrived
  EXPECT_EQ(two[0].frame.id.value, 1u);
  EXPECT_EQ(port.wait_until(daemon::MonoTime::of_ns(15 * kMs)), daemon::Wake::kFrames);
  EXPECT_EQ(port.receive(two), 2u);  // due before or at the deadline
  EXPECT_EQ(two[0].t.ns(), 12 * kMs);
  EXPECT_EQ(two[1].t.ns(), 15 * kMs);
  EXPECT_LE(two[1].t, port.now());
  EXPECT_EQ(port.receive(two), 0u);
  EXPECT_EQ(port.wait_until(daemon::MonoTime::of_ns(15 * kMs)), daemon::Wake::kDeadline);
  EXPECT_EQ(port.now().ns(), 15 * kMs);
  EXPECT_EQ(port.wait_until(daemon::MonoTime::of_ns(20 * kMs)), daemon::Wake::kDeadline);
  EXPECT_EQ(port.send({}), daemon::SendResult::kSent);
  EXPECT_EQ(port.wait_until(daemon::MonoTime::of_ns(25 * kMs)), daemon::Wake::kFrames);
  EXPECT_EQ(port.now().ns(), 20 * kMs);
  EXPECT_EQ(port.receive(two), 1u);  // what was sent is confirmed first, at once
  EXPECT_TRUE(two[0].own_echo);
  EXPECT_EQ(two[0].t.ns(), 20 * kMs);
  EXPECT_EQ(port.wait_until(daemon::MonoTime::of_ns(25 * kMs)), daemon::Wake::kFrames);
  EXPECT_EQ(port.now().ns(), 21 * kMs);
  EXPECT_EQ(port.receive(two), 1u);
  EXPECT_FALSE(two[0].own_echo);
  EXPECT_EQ(port.wait_until(daemon::MonoTime::of_ns(25 * kMs)), daemon::Wake::kClosed);
  EXPECT_EQ(port.now().ns(), 21 * kMs);
  EXPECT_EQ(sent, (Stamps{20 * kMs}));
}

TEST(ReplayPort, SmallBatchesLoseNothing) {
  LogTimeline log = timeline({{{1, 1}, {1, 2}, {1, 3}, {2, 4}, {2, 5}}});
  ReplayPort port(log, {});
  std::array<daemon::RxFrame, 1> one;
  std::uint32_t expected = 1;
  while (port.wait_until(daemon::MonoTime::of_ns(10)) != daemon::Wake::kClosed) {
    while (port.receive(one) == 1) EXPECT_EQ(one[0].frame.id.value, expected++);
  }
  EXPECT_EQ(expected, 6u);
}

TEST(ReplayPort, AnEmptyLogIsClosedAtOnce) {
  LogTimeline log = timeline({{}});
  ReplayPort port(log, {});
  EXPECT_EQ(port.wait_until(daemon::MonoTime::of_ns(1000)), daemon::Wake::kClosed);
}

}  // namespace
}  // namespace beltgrip::ports
